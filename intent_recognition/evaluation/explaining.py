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

from intent_recognition.array_types import Floats
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
    """What would have been decided without a signal."""

    task: str  # the first that would have become active during the movement; empty for none
    after_s: float | None  # when, after the onset that was found with all signals; None for never


class Explanation(NamedTuple):
    """A decision, or a movement during which none was taken."""

    task: str  # what became active; empty where nothing did
    onset_ns: int
    after_s: float  # of the decision, after onset; without one, when a task was the most probable
    labels: tuple[str, ...]  # of the K tasks, and none
    times_s: Floats  # of the n estimates of the movement, after onset, (n,)
    probabilities: Floats  # theirs, (n, K + 1)
    evidence: Evidence  # for the task (or the most probable one) against a rival, at that moment
    without: Mapping[str, Without]  # what would have been decided, by the name of what was missing

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


def explain(
    reader: BagReader, model: Model, rejected: Counter[str] | None = None
) -> list[Explanation]:
    """Explain each decision during a recording, and each movement without one.

    Args:
        reader: the recording.
        model: the trained model.
        rejected: filled with the number of dropped observations, by reason.
    """
    rejected = Counter() if rejected is None else rejected
    settings = decision_settings(model.library)
    samples = list(samples_of(reader, model, rejected))
    run = list(_run(model, settings, samples, rejected))
    instead = {
        name: list(_run(model, settings, _drop(samples, model.library, dofs)))
        for name, dofs in missing(model).items()
    }
    movements: dict[int, list[int]] = {}
    for k, one in enumerate(run):
        if one.estimate.moving:
            movements.setdefault(one.estimate.onset_ns, []).append(k)
    moments = dict[int, list[int]]()
    for some in movements.values():  # its decisions, or without any its best moment
        acted = [k for k in some if run[k].state.acts]
        best = max(some, key=lambda k: run[k].estimate.probabilities[:-1].max())
        moments |= dict.fromkeys(acted or [best], some)
    estimator, found = IntentEstimator(model.library), []
    for k, estimate in enumerate(follow(estimator, samples, Counter())):
        if k not in moments:
            continue
        task = run[k].state.active if run[k].state.acts else ""
        explained = task or estimate.labels[int(np.argmax(estimate.probabilities[:-1]))]
        evidence = estimator.explain(explained)
        assert evidence is not None  # a movement is under way
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


def _first(run: Sequence[Decided], movement: Sequence[Decided]) -> Without:
    """The first decision during a movement of another run."""
    first_ns, last_ns = movement[0].estimate.onset_ns, movement[-1].estimate.stamp_ns
    for one in run:
        if one.state.acts and first_ns <= one.estimate.stamp_ns <= last_ns:
            return Without(one.state.active, (one.estimate.stamp_ns - first_ns) * 1e-9)
    return Without("", None)
