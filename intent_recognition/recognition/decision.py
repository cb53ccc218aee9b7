# SPDX-License-Identifier: Apache-2.0
"""The decision when to act on a recognised task, and when to withdraw it.

`decide` is a pure function, used by the activation node and by replays of recordings:

- A task activates when it was probable and evident enough at `n_observations` consecutive
  observations, and its predicted end is certain enough. Probable: its probability among the tasks
  bounds the share of wrong actions (`promp.risk_of`), and `none` is improbable; without such a
  `risk`, its probability is at least `threshold`. Evident: it has at least `min_evidence` of the
  movement's own evidence among the tasks, which does not favour none. Certain: the standard
  deviation of the end is within the limit learned for the task, or given in rad and m.
- An active task stays active, even while the human holds still, until the interaction is over (the
  estimator reports idle) or the evidence turns against it.
- The evidence turns against it when another task, or none, has been more probable than
  1 - `release_below` for `n_observations` consecutive observations. Near their goals, tasks may be
  alike, so the robot continues while nothing else is that probable. If another task fulfils the
  conditions above by then, it takes over ("switched"). Otherwise nothing is active ("withdrawn")
  until a task fulfils them.
- Until the interaction is over, another task than the one that was active last also needs the
  probability `switch_threshold`: the first was evident, and minds seldom change. Movements without
  a rest between them are one interaction here.

Both counts make a single outlier harmless, and the gap between `threshold` and `release_below`
keeps a task from flickering. `min_evidence` keeps a habit from moving the arm: a task that is
probable because it usually comes next still has to be seen, and an unknown movement stays unknown
even when a known one is expected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError, check_type, check_whole, number
from intent_recognition.filtering import switch_threshold
from intent_recognition.gaussian import log_sum
from intent_recognition.promp import (
    LEAST_SHARE,
    MAX_NONE,
    NONE,
    USUAL_END_STD,
    Risk,
    TaskLibrary,
    end_std_limits,
    risk_of,
)
from intent_recognition.recognition.arguments import LIBRARY_CURE

USUAL_THRESHOLD = 0.9
"""Least probability at which to act on a task without a learned risk."""
MAX_WRONG = 0.05
"""Default limit of the share of interactions with a wrong action."""
MAX_SWITCHED = 0.01
"""Largest share of movements in which an active task may give way to another although the mind did
not change (docs/decisions/change_of_mind.md)."""

_SENDER = "Check the sender and its settings."
"""Cure in errors about received numbers."""


@dataclass(frozen=True)
class DecisionSettings:
    """Settings of the decision to act.

    Attributes:
        threshold: probability that a task must reach if there is no `risk`, in (0.5, 1].
        n_observations: number of consecutive observations to activate or release, at least 1.
        max_end_std_rad: largest standard deviation of the predicted end over the controlled DOFs in
            radians; infinity for no limit, None for the learned one
            (docs/decisions/end_certainty.md).
        max_end_std_m: the same over the controlled DOFs in metres.
        learned_end_std: learned limits by task and unit (`end_std_limits`); other tasks have
            `USUAL_END_STD`.
        release_below: the active task is released if another one, or none, is more probable than
            one minus this, in [0, threshold).
        min_evidence: least share of the likelihood among the tasks, in [0, 1): the probability that
            the task would have if the prior of the tasks were uniform.
        idle_margin: the estimator is idle if the probability of `none` >= 1 - idle_margin.
        risk: threshold that bounds the share of wrong actions, learned from held-out
            demonstrations; None for `threshold`.
        switch_threshold: probability among the tasks that another task than the one that was
            active last needs as well.
    """

    threshold: float = USUAL_THRESHOLD
    n_observations: int = 5
    max_end_std_rad: float | None = None
    max_end_std_m: float | None = None
    release_below: float = 0.5
    min_evidence: float = LEAST_SHARE
    idle_margin: float = 1e-12
    learned_end_std: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    risk: Risk | None = None
    switch_threshold: float = switch_threshold(MAX_SWITCHED)

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.5 < number(self.threshold) <= 1.0:
            _refuse("threshold", "a probability in (0.5, 1]", self.threshold)
        check_whole("n_observations", self.n_observations, 1, "Try 5.")
        for name in ("max_end_std_rad", "max_end_std_m"):
            limit = getattr(self, name)
            if limit is not None and not number(limit) > 0.0:
                _refuse(name, "a positive number, or None for the learned limit", limit)
        if not 0.0 <= number(self.release_below) < self.threshold:
            _refuse("release_below", "a probability below threshold", self.release_below)
        if not 0.0 <= number(self.min_evidence) < 1.0:
            _refuse("min_evidence", "a share in [0, 1)", self.min_evidence)
        if not 0.0 <= number(self.switch_threshold) <= 1.0:
            _refuse("switch_threshold", "a probability", self.switch_threshold)

    def is_sure(self, labels: Sequence[str], p: Floats, task: int) -> bool:
        """Whether a task is probable enough to act on."""
        if self.risk is None:
            return bool(p[task] >= self.threshold)
        none = p[list(labels).index(NONE)]
        return bool(none <= MAX_NONE and p[task] >= self.risk.threshold * (1.0 - none))

    def max_end_std(self, unit: str, task: str) -> float:
        """Largest accepted standard deviation of a task's end in a unit; 0 for unknown units."""
        fixed = {"rad": self.max_end_std_rad, "m": self.max_end_std_m}.get(unit)
        if fixed is not None:
            return fixed
        learned = self.learned_end_std.get(task, {})
        return learned.get(unit, USUAL_END_STD.get(unit, 0.0))


def decision_settings(library: TaskLibrary, max_wrong: float = MAX_WRONG) -> DecisionSettings:
    """Default settings, with the limits and the risk learned for a library.

    Args:
        library: the learned tasks.
        max_wrong: largest accepted share of interactions with a wrong action, in (0, 0.5].

    Raises:
        ArgumentError: `library` is no `TaskLibrary`, or `max_wrong` is not in (0, 0.5].
    """
    check_type("library", library, TaskLibrary, LIBRARY_CURE)
    return DecisionSettings(
        learned_end_std=end_std_limits(library), risk=learned_risk(library, max_wrong)
    )


def learned_risk(library: TaskLibrary, max_wrong: float = MAX_WRONG) -> Risk | None:
    """Threshold at which to act; None if the library has no odds of held-out demonstrations.

    Raises:
        ArgumentError: `max_wrong` is not in (0, 0.5].
    """
    if not 0.0 < number(max_wrong) <= 0.5:
        _refuse("max_wrong", "a share in (0, 0.5]", max_wrong)
    return risk_of(library.left_out_odds, max_wrong) if library.left_out_odds.odds else None


def possible_tasks(
    settings: DecisionSettings, labels: Sequence[str], probabilities: Floats, last: str = ""
) -> tuple[str, ...]:
    """Conformal set of the tasks that a movement may be, the most probable first.

    It contains the true task while none permits acting, except in the share of interactions that
    `risk` bounds. Without a risk, it contains the tasks that `threshold` does not rule out. Against
    another task than the one that was active `last`, `switch_threshold` counts, too. The labels
    include none; their probabilities are (n_labels,).
    """
    p = _checked(labels, probabilities)
    known = np.array([label != NONE for label in labels])
    threshold = settings.threshold if settings.risk is None else settings.risk.threshold
    if last not in ("", labels[int(np.argmax(np.where(known, p, -1.0)))]):
        threshold = max(threshold, settings.switch_threshold)
    some = np.flatnonzero(known & (p * threshold > (1.0 - threshold) * p[known].max()))
    return tuple(labels[k] for k in some[np.argsort(-p[some], kind="stable")])


class DecisionState(NamedTuple):
    """State of the decision from one observation to the next.

    Attributes:
        active: label of the active task; empty if there is none.
        candidate: label that was probable and evident enough at the last observation; else empty.
        n_for: number of consecutive observations with this candidate.
        n_against: number of consecutive observations at which another task, or none, was more
            probable than 1 - release_below.
        event: effect of the last observation: "activated", "switched", "withdrawn", "over" (the
            interaction ended: the estimator is idle) or empty.
        idle: whether the estimator was idle at the last observation.
        last: label of the task that was active last since the estimator was idle; else empty.
    """

    active: str = ""
    candidate: str = ""
    n_for: int = 0
    n_against: int = 0
    event: str = ""
    idle: bool = True
    last: str = ""

    @property
    def acts(self) -> bool:
        """Whether a task became active with the last observation."""
        return self.event in ("activated", "switched")


def decide(
    settings: DecisionSettings,
    state: DecisionState,
    labels: Sequence[str],
    probabilities: Floats,
    end_std: Mapping[str, float] | None,
    log_evidence: Floats | None = None,
) -> tuple[DecisionState, str]:
    """Update the decision by one observation.

    Args:
        settings: settings of the decision.
        state: state after the last observation; `DecisionState()` at the start.
        labels: labels of the tasks and `none`.
        probabilities: probabilities of the labels, (n_labels,), which sum to 1.
        end_std: largest standard deviation of the most probable task's predicted end among the
            controlled DOFs of each unit, {"rad": ...}. None if it was not predicted: then no task
            activates unless there are no limits, and an active task is not affected.
        log_evidence: log p(observations | label), (n_labels,), up to a common constant; None if it
            is not known, which skips the check of `min_evidence`.

    Returns:
        The new state, and its active task (empty if there is none).

    Raises:
        ShapeError: labels and probabilities differ in number.
        ArgumentError: `none` is missing, or the probabilities do not sum to 1 or leave [0, 1].
    """
    p = _checked(labels, probabilities)
    if p[list(labels).index(NONE)] >= 1.0 - settings.idle_margin:
        event = "over" if state.active else ""
        return DecisionState(event=event, idle=True), ""
    best = int(np.argmax(p))
    sure = labels[best] != NONE and settings.is_sure(labels, p, best)
    sure = sure and is_evident(settings, labels, best, log_evidence)
    if state.last not in ("", labels[best]):
        known = 1.0 - p[list(labels).index(NONE)]
        sure = sure and bool(p[best] >= settings.switch_threshold * known)
    candidate = labels[best] if sure else ""
    n_for = (state.n_for + 1 if candidate == state.candidate else 1) if candidate else 0
    certain = is_certain(settings, end_std, labels[best])
    ready = candidate if n_for >= settings.n_observations and certain else ""
    active, n_against, event = _follow(settings, state, labels, p, ready)
    last = active or state.last
    return DecisionState(active, candidate, n_for, n_against, event, False, last), active


def is_certain(settings: DecisionSettings, end_std: Mapping[str, float] | None, task: str) -> bool:
    """Whether a task's predicted end is certain enough in every unit; see `decide`."""
    if end_std is None:
        return settings.max_end_std_rad == inf and settings.max_end_std_m == inf
    return all(std <= settings.max_end_std(unit, task) for unit, std in end_std.items())


def least_certain_unit(settings: DecisionSettings, end_std: Mapping[str, float], task: str) -> str:
    """Unit in which a task's predicted end is the most uncertain relative to its limit."""
    return max(
        end_std, key=lambda unit: end_std[unit] / max(settings.max_end_std(unit, task), 1e-300)
    )


def is_evident(
    settings: DecisionSettings, labels: Sequence[str], task: int, log_evidence: Floats | None
) -> bool:
    """Whether the evidence of the movement favours a task; true if the evidence is not known.

    The task must have at least `min_evidence` among the tasks, and the evidence of none must not
    exceed the mean evidence of the tasks. The estimator's evidence of none counts beyond a margin
    only, so the early part of a reach, which resembles many tasks, favours neither.

    Args:
        settings: settings of the decision.
        labels: labels of the K tasks and none.
        task: index of the task's label.
        log_evidence: log density of the movement under each label, (K + 1,).
    """
    if log_evidence is None or np.shape(log_evidence) != (len(labels),):
        return True
    e, none = np.asarray(log_evidence, dtype=np.float64), list(labels).index(NONE)
    known = np.delete(e, none)  # not empty, since it includes the task
    total = float(log_sum(known))
    if not np.isfinite(total):
        return False
    even = 1e-6  # tolerance for rounding, and for the small slope of evidence within the margin
    favours_none = total - np.log(known.size) < e[none] - even
    return bool(np.exp(e[task] - total) >= settings.min_evidence and not favours_none)


def uncertain_end(
    settings: DecisionSettings, state: DecisionState, end_std: Mapping[str, float] | None
) -> str:
    """Message that a recognised task is not active because its end is uncertain, or empty.

    `state` is the one that `decide` returned for this `end_std`.
    """
    recognised = state.candidate and state.n_for >= settings.n_observations
    if not recognised or state.active == state.candidate:
        return ""
    if end_std is None:
        return f"recognised {state.candidate}, but its end was not predicted"
    unit = least_certain_unit(settings, end_std, state.candidate)
    limit = settings.max_end_std(unit, state.candidate)
    return (
        f"recognised {state.candidate}, but the predicted end is uncertain: "
        f"{end_std[unit]:.2f} {unit}, limit {limit:.2g}"
    )


def _follow(
    settings: DecisionSettings, state: DecisionState, labels: Sequence[str], p: Floats, ready: str
) -> tuple[str, int, str]:
    """New active task, count of contrary observations, and event."""
    if not state.active:
        return ready, 0, "activated" if ready else ""
    others = np.array([label != state.active for label in labels])
    against = others.all() or p[others].max() > 1.0 - settings.release_below
    n_against = state.n_against + 1 if against else 0
    if n_against < settings.n_observations:
        return state.active, n_against, ""
    return ready, 0, "switched" if ready else "withdrawn"


def _checked(labels: Sequence[str], probabilities: Floats) -> Floats:
    p = np.asarray(probabilities, dtype=np.float64)
    if p.shape != (len(labels),):
        cure = "Give one probability per label."
        raise ShapeError.about("probabilities", f"shape ({len(labels)},)", p.shape, cure)
    if NONE not in labels:
        _refuse("labels", f"'{NONE}' among the labels", list(labels), _SENDER)
    if not np.all((p >= -1e-9) & (p <= 1.0 + 1e-9)) or abs(float(p.sum()) - 1.0) > 1e-6:
        _refuse("probabilities", "numbers in [0, 1] that sum to 1", p, _SENDER)
    return p


def _refuse(
    argument: str, expected: str, got: object, cure: str = "Change it, or leave it out."
) -> None:
    raise ArgumentError.about(argument, expected, repr(got), cure)
