# SPDX-License-Identifier: Apache-2.0
"""Explains decisions during a recording, and what they would have been without some signals.

The evidence for the task of a decision against a rival explains it (`recognition.explaining`). The
value of a signal is found by running estimator and decision over the recording again without this
signal, from the onset on.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import Sample, Source
from intent_recognition.evaluation.replaying import (
    Decided,
    decisions,
    follow,
    no_observation,
    samples_of,
)
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
    """The decision that would have been taken without a signal."""

    task: str  # first task active during the movement; empty for none
    after_s: float | None  # time since the onset that all signals gave; None for never


class Explanation(NamedTuple):
    """A decision, or a movement without a decision."""

    task: str  # task that became active; empty for none
    onset_ns: int
    after_s: float  # time of the decision since onset, or of the most probable task
    labels: tuple[str, ...]  # the K tasks, and none
    times_s: Floats  # times of the n estimates of the movement since onset, (n,)
    probabilities: Floats  # posteriors at these times, (n, K + 1)
    evidence: Evidence  # for the task (or the most probable one) against a rival, then
    without: Mapping[str, Without]  # decisions without a signal, by its name

    def to_json(self) -> dict[str, object]:
        """The explanation as plain values; stamps in nanoseconds, evidence in nats."""
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


def explain(
    reader: BagReader, model: Model, rejected: Counter[str] | None = None
) -> list[Explanation]:
    """Explain each decision during a recording, and each movement without one.

    Args:
        reader: recording to explain.
        model: trained model.
        rejected: filled with the number of dropped observations, by reason.

    Raises:
        BagError: nothing that the model observes was recorded.
    """
    rejected = Counter() if rejected is None else rejected
    settings = decision_settings(model.library)
    samples = list(samples_of(reader, model, rejected))
    run = list(_run(model, settings, samples, rejected))
    if not run:
        raise no_observation(reader, model, rejected)
    instead = {
        name: list(_run(model, settings, _drop(samples, model.library, dofs)))
        for name, dofs in missing(model).items()
    }
    movements: dict[int, list[int]] = {}
    for k, one in enumerate(run):
        if one.estimate.moving:
            movements.setdefault(one.estimate.onset_ns, []).append(k)
    moments = dict[int, list[int]]()
    for some in movements.values():  # all decisions, or else the best moment
        acted = [k for k in some if run[k].state.acts]
        best = max(some, key=lambda k: run[k].estimate.probabilities[:-1].max())
        moments |= dict.fromkeys(acted or [best], some)
    estimator, found = IntentEstimator(model.library), []
    for k, estimate in enumerate(follow(estimator, samples, Counter())):
        if k not in moments:
            continue
        task = run[k].state.active if run[k].state.acts else ""
        explained = task or estimate.labels[int(np.argmax(estimate.probabilities[:-1]))]
        order = [estimate.labels[one] for one in np.argsort(-estimate.probabilities)]
        rival = None if task else next(one for one in order if one != explained)  # also none
        evidence = estimator.explain(explained, rival)
        assert evidence is not None  # always so during a movement
        movement = [run[one] for one in moments[k]]
        times_s = [(one.estimate.stamp_ns - estimate.onset_ns) * 1e-9 for one in movement]
        found.append(
            Explanation(
                task,
                estimate.onset_ns,
                (estimate.stamp_ns - estimate.onset_ns) * 1e-9,
                estimate.labels,
                np.array(times_s),
                np.array([one.estimate.probabilities for one in movement]),
                evidence,
                {name: _first(other, movement) for name, other in instead.items()},
            )
        )
    return found


def missing(model: Model) -> dict[str, frozenset[int]]:
    """Signals to leave out, by name: each observed DOF, and all DOFs of each of several signals."""
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
    """The samples without the dropped observed DOFs."""
    kept = []
    for sample in samples:
        if sample.source is not Source.OBSERVED:
            kept.append(sample)
        elif seen := without_dofs(sample.observation, library, dropped):
            kept.append(sample._replace(observation=seen))
    return kept


def _first(run: Sequence[Decided], movement: Sequence[Decided]) -> Without:
    """The first decision of a run during a movement that another run found."""
    first_ns, last_ns = movement[0].estimate.onset_ns, movement[-1].estimate.stamp_ns
    for one in run:
        if one.state.acts and first_ns <= one.estimate.stamp_ns <= last_ns:
            return Without(one.state.active, (one.estimate.stamp_ns - first_ns) * 1e-9)
    return Without("", None)
