# SPDX-License-Identifier: Apache-2.0
"""Tasks one after the other: what is written of them, and how far a session is in one.

A sequence is a prior, not a cage. Its first step begins it when that task is recognised; the next
step begins when its condition holds, or when it is recognised. Another task leads out of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.untrusted import YamlChecks

RECOGNISED = "recognised"
IN_REGION = "_in"
"""What follows the name of a body in the key of a region: `wrist_in`."""
CHECKS = YamlChecks("docs/combining.md describes sequences.")


@dataclass(frozen=True)
class Condition:
    """When a step begins; it also does when its task is recognised.

    Attributes:
        body: whose place counts, such as `wrist`; empty for none.
        center, radius_m: of the region, in the world frame.
        after_s: time since the step before was done; None for no matter how long.
        rest_s: time for which the person has been at rest; None where that does not count.
    """

    body: str = ""
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius_m: float = 0.0
    after_s: float | None = None
    rest_s: float | None = None

    @property
    def by_itself(self) -> bool:
        """Whether a step with it may begin without being recognised."""
        return bool(self.body) or self.after_s is not None or self.rest_s is not None

    def __str__(self) -> str:
        parts = [f"{self.body} within {self.radius_m:g} m of {self.center}"] if self.body else []
        parts += [] if self.after_s is None else [f"{self.after_s:g} s after the step before"]
        parts += [] if self.rest_s is None else [f"at rest for {self.rest_s:g} s"]
        return " and ".join(parts) or RECOGNISED


@dataclass(frozen=True)
class Step:
    """One task of a sequence.

    Attributes:
        when: what begins it, besides being recognised.
        within_s: time after the step before for which it is waited for, as long as a habit tells
            something (`recognition.FORGET_AFTER_S`).
    """

    task: str
    when: Condition = Condition()
    within_s: float = 60.0


Sequences = Mapping[str, tuple[Step, ...]]
"""Sequences by name, each of at least two steps."""


class Moment(NamedTuple):
    """What is known at a time, which never decreases.

    Attributes:
        n_started: interactions that the arm has begun so far.
        active: task of the newest of them, until the arm is home again; empty when there is none.
        resting_s: how long the person has been at rest; 0 in a movement.
        places: position (3,) [m] of each body that was measured lately, by name.
    """

    now_s: float
    n_started: int = 0
    active: str = ""
    arrived: bool = False
    resting_s: float = 0.0
    places: Mapping[str, Floats] = MappingProxyType({})


class SequenceProgress(NamedTuple):
    """How far a session is in a sequence."""

    name: str = ""  # of the sequence; empty outside of any
    step: int = 0  # number of the step that runs or is waited for
    running: bool = False
    since_s: float = 0.0
    ordered: bool = False  # whether its condition has held: it shall begin
    n_started: int = 0  # interactions that were taken into account


def advance(sequences: Sequences, progress: SequenceProgress, moment: Moment) -> SequenceProgress:
    """Take a moment into account; `progress` is that of the moment before."""
    out = SequenceProgress(n_started=moment.n_started)
    if moment.n_started != progress.n_started:
        return _begun(sequences, progress, moment)
    if not progress.name:
        return progress
    steps = sequences[progress.name]
    step = steps[progress.step]
    if progress.running:
        if moment.active == step.task and moment.arrived:
            last = progress.step == len(steps) - 1
            following = progress._replace(
                step=progress.step + 1, running=False, since_s=moment.now_s, ordered=False
            )
            return out if last else following
        if moment.active != step.task:  # it did not get there
            again = progress._replace(running=False, since_s=moment.now_s, ordered=False)
            return out if step.when.by_itself else again
        return progress
    if moment.now_s - progress.since_s > step.within_s:
        return out
    if not progress.ordered and _holds(step.when, moment, moment.now_s - progress.since_s):
        return progress._replace(ordered=True)
    return progress


def awaited(sequences: Sequences, progress: SequenceProgress) -> Step | None:
    """The step that runs or is waited for; None outside of any sequence."""
    return sequences[progress.name][progress.step] if progress.name else None


def _begun(sequences: Sequences, progress: SequenceProgress, moment: Moment) -> SequenceProgress:
    """The arm has begun an interaction: the step waited for, a first step, or neither."""
    step = awaited(sequences, progress)
    begun = SequenceProgress(
        progress.name, progress.step, True, moment.now_s, False, moment.n_started
    )
    if step is not None and moment.active == step.task:
        return begun
    for name, steps in sequences.items():
        if steps[0].task == moment.active:
            return begun._replace(name=name, step=0)
    return SequenceProgress(n_started=moment.n_started)


def _holds(when: Condition, moment: Moment, waited_s: float) -> bool:
    if not when.by_itself:
        return False
    if when.body:
        place = moment.places.get(when.body)
        if place is None or not np.linalg.norm(place - when.center) <= when.radius_m:
            return False
    return waited_s >= (when.after_s or 0.0) and moment.resting_s >= (when.rest_s or 0.0)


def read_sequences(text: str, labels: Sequence[str] | None = None) -> dict[str, tuple[Step, ...]]:
    """Sequences of tasks, by name, read from a YAML text.

    Such as::

        toolbox:
        - task: plate_handover
        - task: hold_screwdriver
          when: {wrist_in: {center: [0.3, 0.4, 0.1], radius: 0.15}}
          within: 30

    `when` is `recognised` (the default), or has `BODY_in`, `after` [s] and `at_rest` [s], all of
    which must hold. `within` [s] bounds how long a step is waited for. A first step is recognised,
    and no two sequences begin with the same task.

    Raises:
        ArgumentError: it is none, or its tasks are not among the labels, where these are given.
    """
    content = CHECKS.load("sequences", text)
    if not isinstance(content, Mapping) or not content:
        CHECKS.refuse("sequences", "NAME: [steps]", content)
    found = {str(name): _steps(str(name), steps) for name, steps in content.items()}
    if (n_steps := sum(map(len, found.values()))) > 1000:
        CHECKS.refuse("sequences", "at most 1000 steps", n_steps)
    first = [steps[0].task for steps in found.values()]
    if doubled := sorted({task for task in first if first.count(task) > 1}):
        CHECKS.refuse(
            "sequences", "each to begin with another task", f"two with {', '.join(doubled)}"
        )
    unknown = {step.task for steps in found.values() for step in steps}.difference(labels or ())
    if labels is not None and unknown:
        CHECKS.refuse("sequences", f"tasks of {', '.join(labels)}", ", ".join(sorted(unknown)))
    return found


def _steps(name: str, content: Any) -> tuple[Step, ...]:
    place = f"sequence {name}"
    if not isinstance(content, list) or len(content) < 2:
        CHECKS.refuse(place, "a list of two steps or more", content)
    steps = tuple(_step(f"{place}, step {k + 1}", one) for k, one in enumerate(content))
    if steps[0].when.by_itself:
        CHECKS.refuse(f"{place}, step 1", f"when: {RECOGNISED}", steps[0].when)
    return steps


def _step(place: str, content: Any) -> Step:
    if not isinstance(content, Mapping) or not isinstance(content.get("task"), str):
        CHECKS.refuse(place, "a task", content)
    CHECKS.keys(place, content, ("task", "when", "within"))
    within_s = CHECKS.number(place, content.get("within", Step.within_s), 0.0)
    return Step(content["task"], _condition(place, content.get("when", RECOGNISED)), within_s)


def _condition(place: str, content: Any) -> Condition:
    if content == RECOGNISED:
        return Condition()
    if not isinstance(content, Mapping) or not content:
        CHECKS.refuse(place, f"when: {RECOGNISED}, BODY_in, after or at_rest", content)
    values: dict[str, Any] = {}
    for key, value in content.items():
        if key in ("after", "at_rest"):
            values["after_s" if key == "after" else "rest_s"] = CHECKS.number(place, value, 0.0)
        elif isinstance(key, str) and key.endswith(IN_REGION) and "body" not in values:
            if not isinstance(value, Mapping) or set(value) != {"center", "radius"}:
                CHECKS.refuse(place, f"{key}: {{center: [x, y, z], radius: r}}", value)
            if not isinstance(value["center"], list) or len(value["center"]) != 3:
                CHECKS.refuse(place, "center: [x, y, z] in metres", value["center"])
            values["body"] = key.removesuffix(IN_REGION)
            values["center"] = tuple(CHECKS.number(place, x) for x in value["center"])
            values["radius_m"] = CHECKS.number(place, value["radius"], 0.0)
        else:
            CHECKS.refuse(place, "one BODY_in, after and at_rest", key)
    return Condition(**values)
