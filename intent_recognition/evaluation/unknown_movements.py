# SPDX-License-Identifier: Apache-2.0
"""Decisions about movements of known tasks and of tasks unknown to a library.

Every task is left out in turn, and a library of the other tasks filters its movements; known
movements are held out of training one by one (or by folds). Durations are always unknown, and the
decision is that of the nodes, with its default settings.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.filtering import MovementFilter, make_prior_grid, task_posterior
from intent_recognition.learning import TrainingSettings, learn_with_report
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    decide,
    decision_settings,
    least_certain_unit,
)
from intent_recognition.signals import Demonstration, merge


class MovementOutcome(NamedTuple):
    """The decision about one movement."""

    task: str  # true task
    # highest log odds that one known task kept against all else during as many consecutive
    # observations as the decision requires; minus infinity with fewer observations
    log_odds: float
    above_threshold: bool  # whether these odds passed the decision's threshold
    activated: str  # first task that became active; empty if none did
    recognised: str = ""  # first task, ignoring the limit on the uncertainty of the end
    # standard deviation of the recognised task's predicted end, after the whole movement: the
    # largest over the controlled DOFs of the least certain unit; NaN where no task was recognised
    end_std: float = np.nan

    @property
    def held_back(self) -> bool:
        """Whether the task was recognised but not acted on, as its end was too uncertain."""
        return bool(self.recognised) and not self.activated


class DecisionMonitor:
    """Follows one movement and decides as the activation node does."""

    def __init__(self, library: TaskLibrary, settings: DecisionSettings | None = None):
        self._settings = settings or decision_settings(library)
        self._labels = (*library.labels, NONE)
        self._state = DecisionState()
        self._recent = deque[tuple[int, float]](maxlen=self._settings.n_observations)
        self._highest, self._activated, self._recognised = -np.inf, "", ""
        self._end_std: Callable[[], dict[str, float]] = dict

    def observe(self, run: MovementFilter, elapsed_s: float) -> None:
        """Decide after one more observation."""
        posterior = task_posterior(run.log_evidence, run.grid, elapsed_s)
        log_joint = run.grid.log_task_prior + posterior.log_evidence
        best = int(np.argmax(log_joint[:-1]))
        rest = np.logaddexp.reduce(np.delete(log_joint, best))
        self._recent.append((best, float(log_joint[best] - rest)))
        tasks, odds = zip(*self._recent, strict=True)
        if len(tasks) == self._settings.n_observations and len({*tasks}) == 1:
            self._highest = max(self._highest, min(odds))
        current = self._labels, posterior.probabilities, posterior.log_evidence
        end_std = partial(run.end_std, best)
        self._state, _ = decide_when_ready(self._settings, self._state, *current, end_std)
        self._recognised = self._recognised or recognised(self._settings, self._state)
        self._activated = self._activated or self._state.active
        if self._recognised:
            self._end_std = partial(run.end_std, self._labels.index(self._recognised))

    def outcome(self, task: str) -> MovementOutcome:
        """The outcome of the movement, whose true task is given."""
        threshold = self._settings.threshold
        limit = np.log(threshold) - np.log1p(-threshold) if threshold < 1.0 else np.inf
        found = self._activated, self._recognised
        worst = np.nan
        if end_std := self._end_std():
            worst = end_std[least_certain_unit(self._settings, end_std, self._recognised)]
        return MovementOutcome(task, self._highest, bool(self._highest >= limit), *found, worst)


def decide_when_ready(
    settings: DecisionSettings,
    state: DecisionState,
    labels: Sequence[str],
    probabilities: Floats,
    log_evidence: Floats | None,
    predicted_end_std: Callable[[], Mapping[str, float] | None],
) -> tuple[DecisionState, Mapping[str, float] | None]:
    """Like `decide`; computes and returns the end's uncertainty only if the decision needs it."""
    current, end_std = (settings, state, labels, probabilities), None
    following, _ = decide(*current, end_std, log_evidence)
    if recognised(settings, following) not in ("", following.active):
        end_std = predicted_end_std()
        following, _ = decide(*current, end_std, log_evidence)
    return following, end_std


def recognised(settings: DecisionSettings, state: DecisionState) -> str:
    """The task that meets all conditions of the decision except a certain end; empty if none."""
    return state.candidate if state.n_for >= settings.n_observations else ""


def in_context(library: TaskLibrary, recorded: Demonstration) -> TaskLibrary:
    """The library in the context in which a recording began; unchanged without one."""
    return library.given(recorded.context_values) if recorded.context else library


def follow(library: TaskLibrary, recorded: Demonstration) -> MovementOutcome:
    """The decision about a whole recording of unknown duration."""
    monitor, library = DecisionMonitor(library), in_context(library, recorded)
    run = MovementFilter(library, make_prior_grid(library), recorded.start_ns)
    for observation in merge(recorded.observed):
        if recorded.start_ns <= observation.stamp_ns <= recorded.end_ns:
            run.observe(observation)
            monitor.observe(run, (observation.stamp_ns - recorded.start_ns) * 1e-9)
    return monitor.outcome(str(recorded.task))


def follow_unknown(
    demonstrations: Sequence[Demonstration],
    settings: TrainingSettings,
    progress: Callable[[int], None] = lambda done: None,
) -> list[MovementOutcome]:
    """Decisions about the movements of each task by a library of all other tasks.

    Tasks without which nothing can be learned are skipped.
    """
    outcomes: list[MovementOutcome] = []
    for task in sorted({str(d.task) for d in demonstrations}):
        rest = [d for d in demonstrations if d.task != task]
        if len(rest) < 2 or len(rest) == len({d.task for d in rest}):
            continue
        library = learn_with_report(rest, replace(settings, switching=False)).library
        for recorded in (d for d in demonstrations if d.task == task):
            outcomes.append(follow(library, recorded))
            progress(len(outcomes))
    return outcomes


def compare(
    known: Sequence[MovementOutcome], unknown: Sequence[MovementOutcome]
) -> dict[str, object]:
    """Compare known and unknown movements, as JSON; values without movements are None.

    `area` is the area under `roc`, which has one point per threshold: the probability that a known
    movement reaches higher odds than an unknown one. `recognised` counts movements that pass the
    decision without its limit on the uncertainty of the end, `held_back` those of them that never
    pass this limit, `activated` the others.
    """
    scores = [np.array([one.log_odds for one in outcomes]) for outcomes in (known, unknown)]
    content: dict[str, object] = {
        "n_known": len(known),
        "n_unknown": len(unknown),
        "area": area(*scores),
        "recognised_wrong_task": _share([o.recognised not in ("", o.task) for o in known]),
        "activated_wrong_task": _share([o.activated not in ("", o.task) for o in known]),
        "end_std_known": end_std([o for o in known if o.recognised]),
    }
    for kind, outcomes in (("known", known), ("unknown", unknown)):
        content |= {f"{name}_{kind}": share for name, share in _shares(outcomes).items()}
        content[f"held_back_{kind}"] = _share([one.held_back for one in outcomes])
    left_out: dict[str, object] = {}
    for task in sorted({o.task for o in unknown}):
        own = [o for o in unknown if o.task == task]
        above = area(scores[0], np.array([o.log_odds for o in own]))
        left_out[task] = {"n": len(own), "area": above, **_shares(own)}
    content["left_out"] = left_out
    content["roc"] = roc(*scores) if known and unknown else None
    return content


def _shares(outcomes: Sequence[MovementOutcome]) -> dict[str, float | None]:
    return {
        "recognised": _share([bool(one.recognised) for one in outcomes]),
        "activated": _share([bool(one.activated) for one in outcomes]),
        "above_threshold": _share([one.above_threshold for one in outcomes]),
    }


def end_std(recognised: Sequence[MovementOutcome]) -> dict[str, float] | None:
    """Quantiles of the ends' uncertainty after the whole movement; None without a movement."""
    if not recognised:
        return None
    values = [o.end_std for o in recognised]
    return {f"{q:g}": float(np.quantile(values, q)) for q in (0.1, 0.5, 0.9)}


def area(known: Floats, unknown: Floats) -> float | None:
    """Share of pairs in which the known value is higher, counting ties half; None without pairs."""
    if not len(known) or not len(unknown):
        return None
    above = known[:, None] > unknown[None]
    equal = known[:, None] == unknown[None]
    return float(np.mean(above + 0.5 * equal))


def roc(known: Floats, unknown: Floats) -> dict[str, list[float]]:
    """Shares of known and unknown values at or above each threshold, from (0, 0) to (1, 1)."""
    thresholds = np.unique(np.r_[known, unknown])[::-1]
    return {
        name: [0.0, *(float(np.mean(values >= t)) for t in thresholds)]
        for name, values in (("unknown", unknown), ("known", known))
    }


def _share(values: Sequence[bool]) -> float | None:
    return float(np.mean(values)) if values else None
