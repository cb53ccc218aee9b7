# SPDX-License-Identifier: Apache-2.0
"""Why the decisions during a recording were taken, and what they would have been with less seen.

Each decision is explained by the evidence for its task against a rival (`recognition.explaining`).
What a signal was worth is found by running estimator and decision over the recording again, as if
it had not been there: onset and all.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import Sample, Source
from intent_recognition.evaluation.replaying import Decided, decisions, follow, samples_of
from intent_recognition.model import Model
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import (
    DecisionSettings,
    Evidence,
    IntentEstimator,
    decision_settings,
    without_dofs,
)


class Without(NamedTuple):
    """What would have been decided without a signal.

    Attributes:
        task: the first that would have become active during the movement; empty for none.
        after_s: when, after the onset that was found with all signals; None for never.
    """

    task: str
    after_s: float | None


class Explanation(NamedTuple):
    """A decision, or a movement during which none was taken.

    Attributes:
        task: what became active; empty where nothing did.
        onset_ns: when the movement began.
        after_s: of the decision, after onset; without one, when a task was the most probable.
        labels: of the K tasks, and none.
        times_s: of the n estimates of the movement, after onset, (n,).
        probabilities: theirs, (n, K + 1).
        evidence: for the task (or the most probable one) against a rival, at that moment.
        without: what would have been decided, by the name of what was missing.
    """

    task: str
    onset_ns: int
    after_s: float
    labels: tuple[str, ...]
    times_s: NDArray[np.float64]
    probabilities: NDArray[np.float64]
    evidence: Evidence
    without: Mapping[str, Without]

    def to_json(self) -> dict[str, object]:
        """As plain values; stamps in nanoseconds, evidence in nats."""
        found = self.evidence
        return {
            "task": self.task,
            "onset": self.onset_ns,
            "after_s": self.after_s,
            "for": found.task,
            "against": found.rival,
            "log_odds": found.log_odds,
            "expected": found.expected,
            "times_s": found.times_s.tolist(),
            "evidence": dict(zip(found.names, found.by_dof.T.tolist(), strict=True)),
            "without": {name: one._asdict() for name, one in self.without.items()},
        }


class _Moment(NamedTuple):
    """What is explained: a decision, or the best moment of a movement without one."""

    task: str
    stamp_ns: int
    movement: list[Decided]


def explain(
    reader: BagReader,
    model: Model,
    rejected: Counter[str] | None = None,
    settings: DecisionSettings | None = None,
    against: str | None = None,
) -> list[Explanation]:
    """Explain each decision during a recording, and each movement without one.

    Args:
        reader: the recording.
        model: the trained model.
        rejected: filled with the number of dropped observations, by reason.
        settings: of the decision; the node's defaults when None.
        against: label of the rival; None for the most probable other one.

    Raises:
        ArgumentError: there is no such rival.
    """
    rejected = Counter() if rejected is None else rejected
    settings = settings or decision_settings(model.library)
    samples = list(samples_of(reader, model, rejected))
    moments = _moments(list(_run(model, settings, samples, rejected)))
    evidence = _evidence(model, samples, moments, against)
    instead = {
        name: list(_run(model, settings, _drop(samples, model.library, dofs)))
        for name, dofs in missing(model).items()
    }
    return [
        Explanation(
            moment.task,
            moment.movement[0].estimate.onset_ns,
            (moment.stamp_ns - moment.movement[0].estimate.onset_ns) * 1e-9,
            moment.movement[0].estimate.labels,
            np.array([_since_onset(one) for one in moment.movement]),
            np.array([one.estimate.probabilities for one in moment.movement]),
            found,
            {name: _first(run, moment.movement) for name, run in instead.items()},
        )
        for moment, found in zip(moments, evidence, strict=True)
    ]


def missing(model: Model) -> dict[str, frozenset[int]]:
    """What may be missing, by name: each observed DOF, and of several signals each."""
    library = model.library
    found = {}
    if library.n_observed > 1:
        found = {name: frozenset([k]) for k, name in enumerate(library.observed_names)}
    if len(library.observed_groups) > 1:
        for group, entry in enumerate(model.dofs.observed):
            found[entry.topic] = frozenset(library.observed_dofs(group).tolist())
    return found


def _run(
    model: Model,
    settings: DecisionSettings,
    samples: Sequence[Sample],
    rejected: Counter[str] | None = None,
) -> Iterator[Decided]:
    estimator = IntentEstimator(model.library)
    followed = follow(estimator, samples, Counter() if rejected is None else rejected)
    return decisions(estimator, settings, followed)


def _drop(samples: Sequence[Sample], library: TaskLibrary, dropped: frozenset[int]) -> list[Sample]:
    """The samples without some observed DOFs."""
    kept = []
    for sample in samples:
        if sample.source is not Source.OBSERVED:
            kept.append(sample)
        elif seen := without_dofs(sample.observation, library, dropped):
            kept.append(sample._replace(observation=seen))
    return kept


def _moments(run: Sequence[Decided]) -> list[_Moment]:
    """What to explain, in order of time."""
    movements: dict[int, list[Decided]] = {}
    for one in run:
        if one.estimate.moving:
            movements.setdefault(one.estimate.onset_ns, []).append(one)
    found = []
    for movement in movements.values():
        acted = [one for one in movement if one.state.event in ("activated", "switched")]
        if not acted:
            best = max(movement, key=lambda one: one.estimate.probabilities[:-1].max())
            found.append(_Moment("", best.estimate.stamp_ns, movement))
        for one in acted:
            found.append(_Moment(one.state.active, one.estimate.stamp_ns, movement))
    return found


def _evidence(
    model: Model, samples: Sequence[Sample], moments: Sequence[_Moment], against: str | None
) -> list[Evidence]:
    """Of each moment."""
    wanted = {moment.stamp_ns: moment for moment in moments}
    estimator, found = IntentEstimator(model.library), []
    for estimate in follow(estimator, samples, Counter()):
        moment = wanted.get(estimate.stamp_ns)
        if moment is not None and (one := estimator.explain(moment.task or None, against)):
            found.append(one)
            del wanted[estimate.stamp_ns]
    return found


def _first(run: Sequence[Decided], movement: Sequence[Decided]) -> Without:
    """The first decision during a movement of another run."""
    first_ns, last_ns = movement[0].estimate.onset_ns, movement[-1].estimate.stamp_ns
    for one in run:
        acted = one.state.event in ("activated", "switched")
        if acted and first_ns <= one.estimate.stamp_ns <= last_ns:
            return Without(one.state.active, (one.estimate.stamp_ns - first_ns) * 1e-9)
    return Without("", None)


def _since_onset(one: Decided) -> float:
    return (one.estimate.stamp_ns - one.estimate.onset_ns) * 1e-9
