# SPDX-License-Identifier: Apache-2.0
"""Sequences of tasks: their YAML format, and the progress of a session in a sequence.

A sequence begins when the task of its first step is recognised. The next step begins when its
condition holds, or when its task is recognised. If another task is recognised, the sequence ends.
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
"""Suffix of the key of a region, after the name of the body: `wrist_in`."""
CHECKS = YamlChecks("docs/combining.md describes sequences.")


@dataclass(frozen=True)
class Condition:
    """Condition on which a step begins; it also begins when its task is recognised.

    Attributes:
        body: body that must be in the region, such as `wrist`; empty for none.
        center, radius_m: centre and radius of the region, in the world frame [m].
        after_s: least time since the previous step was done; None for any.
        rest_s: least time for which the person has been at rest; None for any.
    """

    body: str = ""
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius_m: float = 0.0
    after_s: float | None = None
    rest_s: float | None = None

    @property
    def by_itself(self) -> bool:
        """Whether a step with this condition may begin without being recognised."""
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
        task: label of the task.
        when: condition on which it begins, besides being recognised.
        within_s: longest wait after the previous step; by default `recognition.FORGET_AFTER_S`.
    """

    task: str
    when: Condition = Condition()
    within_s: float = 60.0


Sequences = Mapping[str, tuple[Step, ...]]
"""Sequences by name, each of at least two steps."""


class Moment(NamedTuple):
    """State of arm and person at a time.

    Attributes:
        now_s: the time, which never decreases.
        n_started: number of interactions that the arm has begun so far.
        active: task of the newest one until the arm is home again; empty if none.
        arrived: whether the arm is at the end of that task.
        resting_s: how long the person has been at rest; 0 in a movement.
        places: position (3,) [m] of each body with a recent measurement, by name.
    """

    now_s: float
    n_started: int = 0
    active: str = ""
    arrived: bool = False
    resting_s: float = 0.0
    places: Mapping[str, Floats] = MappingProxyType({})


class SequenceProgress(NamedTuple):
    """Progress of a session in a sequence."""

    name: str = ""  # name of the sequence; empty outside of any
    step: int = 0  # index of the step that runs or is awaited
    running: bool = False  # whether the step runs
    since_s: float = 0.0  # when it began to run or to be awaited
    ordered: bool = False  # whether its condition has held, so that it is to begin
    n_started: int = 0  # number of interactions taken into account


def advance(sequences: Sequences, progress: SequenceProgress, moment: Moment) -> SequenceProgress:
    """Progress after a moment, given the progress at the previous moment."""
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
        if moment.active != step.task:  # the step ended before the arm arrived
            again = progress._replace(running=False, since_s=moment.now_s, ordered=False)
            return out if step.when.by_itself else again
        return progress
    if moment.now_s - progress.since_s > step.within_s:
        return out
    if not progress.ordered and _holds(step.when, moment, moment.now_s - progress.since_s):
        return progress._replace(ordered=True)
    return progress


def awaited(sequences: Sequences, progress: SequenceProgress) -> Step | None:
    """Step that runs or is awaited; None outside of any sequence."""
    return sequences[progress.name][progress.step] if progress.name else None


def _begun(sequences: Sequences, progress: SequenceProgress, moment: Moment) -> SequenceProgress:
    """Progress once the arm has begun an interaction: the awaited step, a first one, or neither."""
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
    """Read sequences of tasks, by name, from a YAML text.

    For example::

        toolbox:
        - task: plate_handover
        - task: hold_screwdriver
          when: {wrist_in: {center: [0.3, 0.4, 0.1], radius: 0.15}}
          within: 30

    `when` is `recognised` (the default), or has some of `BODY_in`, `after` [s] and `at_rest` [s],
    all of which must hold. `within` [s] limits the wait for a step. A first step begins only when
    recognised, and no two sequences begin with the same task.

    Raises:
        ArgumentError: the text is no such YAML, or a task is not among `labels`, if given.
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
