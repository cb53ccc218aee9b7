# SPDX-License-Identifier: Apache-2.0
"""From demonstrations to a `TaskLibrary`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment.segment import onset_settings
from intent_recognition.errors import ArgumentError, TrainingError, describe
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.examples import (
    SAMPLES_PER_MOVEMENT,
    Example,
    Recorded,
    cut_to_movement,
    make_example,
    sample_phases,
    scored_phases,
)
from intent_recognition.promp.library import NONE, TaskLibrary, pooled_none_model
from intent_recognition.promp.prior import (
    leave_one_out_targets,
    shrunk_covariance,
    structured_target,
    weight_extent,
    weight_floor,
)
from intent_recognition.promp.selection import Candidate, TaskSamples, select

SEGMENTATIONS = ("movement", "recording")
DURATION_WORTH = 4.0
"""Demonstrations' worth of the assumption that all tasks' durations spread alike."""
SMALLEST_DURATION_STD = 0.05
NONE_DURATION_STD = 0.2
"""Smallest spreads of the log duration, of a task and of none."""


@dataclass(frozen=True)
class TrainingSettings:
    """How a library is learned.

    Attributes:
        n_basis: basis functions per DOF.
        width: their width in units of their spacing.
        ridge: relative curvature penalty of the weights' regression.
        segmentation: "movement" cuts each recording to the interaction, as the online detector
            would; "recording" takes it whole.
        none_prior: prior probability that a movement is none of the tasks.
        none_spread: variance of the none model relative to everything seen.
        duration_evidence: exponent of the evidence in the posterior of a movement's duration, in
            (0, 1]; on real recordings 0.1 predicts better than 1 (docs/method.md).

    Raises:
        ArgumentError: a setting is out of range.
    """

    n_basis: int = 20
    width: float = 1.0
    ridge: float = 3e-3
    segmentation: str = "movement"
    none_prior: float = 0.05
    none_spread: float = 2.0
    duration_evidence: float = 0.1

    def __post_init__(self):
        if self.segmentation not in SEGMENTATIONS:
            raise ArgumentError(
                describe(
                    "segmentation", f"one of {SEGMENTATIONS}", self.segmentation, "Choose one."
                )
            )
        if not 0 < self.duration_evidence <= 1:
            raise ArgumentError(
                describe(
                    "duration_evidence", "an exponent in (0, 1]", self.duration_evidence, "Try 0.1."
                )
            )
        if not 0 < self.none_prior < 1 or not self.none_spread > 0:
            raise ArgumentError(
                describe(
                    "none_prior, none_spread",
                    "a probability between 0 and 1 and a positive factor",
                    f"{self.none_prior}, {self.none_spread}",
                    "Try 0.05 and 2.",
                )
            )


class TrainingReport(NamedTuple):
    """What came of the demonstrations.

    Attributes:
        used: names of those learned from.
        rejected: (name, reason) of those left out.
        chosen: the hyperparameters taken.
        tried: all that were scored.
    """

    used: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]
    chosen: Candidate
    tried: tuple[Candidate, ...]


def learn(
    demonstrations: Sequence[Recorded],
    settings: TrainingSettings | None = None,
    provenance: Mapping[str, object] | None = None,
) -> tuple[TaskLibrary, TrainingReport]:
    """Learn one interaction primitive per label.

    Args:
        demonstrations: labelled recordings with the same DOFs.
        settings: how to learn.
        provenance: what to remember about their origin.

    Raises:
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    settings = settings or TrainingSettings()
    labelled, rejected = _usable(demonstrations)
    onset = onset_settings([recorded.observed for recorded in labelled]) if labelled else ()
    if settings.segmentation == "movement":
        labelled = cut_to_movement(labelled)
    basis = NormalizedRBFBasis(settings.n_basis, settings.width)
    examples = []
    for recorded in labelled:
        try:
            examples.append(make_example(recorded, basis, settings.ridge))
        except TrainingError as error:
            rejected.append((recorded.name, str(error)))
    labels = tuple(sorted({example.task for example in examples}))
    _check_enough(len(demonstrations), examples, labels, rejected)
    groups = [[e for e in examples if e.task == label] for label in labels]
    learned, chosen, tried = _primitives(groups, basis)
    library = TaskLibrary(
        labels=labels,
        basis=basis,
        **_names(labelled[0]),
        **learned,
        **_timing([np.log([e.duration_s for e in group]) for group in groups]),
        **_none_model(groups, settings.none_spread),
        task_prior=np.full(len(labels), 1.0 / len(labels)),
        transition_prior=np.full((len(labels) + 1, len(labels)), 1.0 / len(labels)),
        none_prior=settings.none_prior,
        duration_evidence=settings.duration_evidence,
        n_demonstrations=np.array([len(group) for group in groups]),
        onset=onset,
        provenance={
            **(provenance or {}),
            "settings": asdict(settings),
            "chosen": chosen._asdict(),
        },
    )
    used = tuple(example.name for example in examples)
    return library, TrainingReport(used, tuple(rejected), chosen, tried)


def _usable(demonstrations: Sequence[Recorded]) -> tuple[list[Recorded], list[tuple[str, str]]]:
    """The labelled recordings with the DOFs of the first one, and why others are left out."""
    labelled: list[Recorded] = []
    rejected = []
    for recorded in demonstrations:
        if recorded.task is None:
            rejected.append((recorded.name, "it has no label `task`"))
        elif recorded.task == NONE:
            rejected.append((recorded.name, f"the label {NONE!r} is reserved"))
        elif labelled and _dofs(recorded) != _dofs(labelled[0]):
            reason = describe(
                "DOFs",
                f"those of {labelled[0].name}, {_dofs(labelled[0])}",
                _dofs(recorded),
                "Read all recordings with one DOF file.",
            )
            rejected.append((recorded.name, reason))
        else:
            labelled.append(recorded)
    return labelled, rejected


def _check_enough(
    n_given: int,
    examples: Sequence[Example],
    labels: Sequence[str],
    rejected: Sequence[tuple[str, str]],
) -> None:
    """Refuse what no covariance can be learned from."""
    if not examples:
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two usable, labelled demonstrations of a task",
                f"none of {n_given}"
                + "".join(f"; {name}: {reason}" for name, reason in rejected[:3]),
                "Check the labels and the DOF file.",
            )
        )
    if len(examples) == len(labels):
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two demonstrations of one of the tasks",
                f"one of each of {len(labels)}",
                "Record more: 5 to 20 of each task are usual.",
            )
        )


def _primitives(
    groups: Sequence[Sequence[Example]], basis: NormalizedRBFBasis
) -> tuple[dict[str, object], Candidate, tuple[Candidate, ...]]:
    """Weights' means and covariances per task and the noise, regularised by leave-one-out."""
    weights = [np.array([e.weights for e in group]) for group in groups]
    counts = [len(w) for w in weights]
    floor = weight_floor(np.concatenate(weights))
    deviations = np.concatenate([w - w.mean(axis=0) for w in weights])
    tasks = np.repeat(np.arange(len(groups)), counts)
    residual = np.mean([e.residual_variance for group in groups for e in group], axis=0)
    noise = np.maximum(residual, floor)
    chosen, tried = select(
        [_samples(group, basis) for group in groups],
        [leave_one_out_targets(deviations, tasks, task, floor) for task in range(len(groups))],
        noise,
        basis.design_matrix(scored_phases()),
    )
    covariances = []
    for task, count in enumerate(counts):
        flat = deviations[tasks == task].reshape(count, -1)
        target = structured_target(deviations, tasks, task, floor).covariance()
        covariances.append(shrunk_covariance(flat.T @ flat, count, target, chosen.strength))
    learned = {
        "weight_mean": np.array([w.mean(axis=0).ravel() for w in weights]),
        "weight_covariance": np.array(covariances),
        "noise_variance": noise,
        "noise_scale": chosen.noise_scale,
    }
    return learned, chosen, tried


def _samples(group: Sequence[Example], basis: NormalizedRBFBasis) -> TaskSamples:
    """What the hyperparameters are scored on, of one task."""
    phase = np.repeat(sample_phases()[None], len(group), axis=0)
    return TaskSamples(
        np.array([e.weights for e in group]),
        np.array([e.observed for e in group]),
        basis.design_matrix(phase),
        phase,
        np.array([e.controlled for e in group]),
    )


def _none_model(groups: Sequence[Sequence[Example]], spread: float) -> dict[str, np.ndarray]:
    """Observed weights and timing of any human movement, from all demonstrations together."""
    n_observed = groups[0][0].observed.shape[1]
    weights = [np.array([e.weights[:n_observed] for e in group]) for group in groups]
    everything = np.concatenate(weights)
    centre = np.mean([w.mean(axis=0) for w in weights], axis=0)
    mean, covariance = pooled_none_model(
        everything - centre, centre, weight_extent(everything), spread
    )
    logs = np.log([e.duration_s for group in groups for e in group])
    return {
        "none_mean": mean,
        "none_covariance": covariance,
        "none_log_duration": np.array([logs.mean(), max(float(logs.std()), NONE_DURATION_STD)]),
    }


def _timing(logs: Sequence[np.ndarray]) -> dict[str, object]:
    """Timing prior per task from log durations; the spread leans on all tasks."""
    scatter = np.array([np.sum((x - x.mean()) ** 2) for x in logs])
    n = np.array([len(x) for x in logs])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    variance = (scatter + DURATION_WORTH * pooled) / (n - 1 + DURATION_WORTH) * (1 + 1 / n)
    return {
        "log_duration_mean": np.array([x.mean() for x in logs]),
        "log_duration_std": np.sqrt(np.maximum(variance, SMALLEST_DURATION_STD**2)),
        "correlation_time_s": float(np.exp(np.concatenate(logs)).mean()) / SAMPLES_PER_MOVEMENT,
    }


def _names(recorded: Recorded) -> dict[str, tuple]:
    """Names, units and groups of the DOFs."""
    return {
        "observed_names": tuple(name for s in recorded.observed for name in s.names),
        "controlled_names": tuple(name for s in recorded.controlled for name in s.names),
        "observed_units": tuple(s.unit for s in recorded.observed for _ in s.names),
        "controlled_units": tuple(s.unit for s in recorded.controlled for _ in s.names),
        "observed_groups": tuple(len(s.names) for s in recorded.observed),
    }


def _dofs(recorded: Recorded) -> tuple[tuple[tuple[str, ...], str], ...]:
    """Names and unit of each signal, observed then controlled."""
    return tuple((s.names, s.unit) for s in (*recorded.observed, *recorded.controlled))
