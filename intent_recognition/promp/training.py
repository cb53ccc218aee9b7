# SPDX-License-Identifier: Apache-2.0
"""From demonstrations to a `TaskLibrary`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment.onset import OnsetSettings
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
    FLOOR_OF_RANGE,
    leave_one_out_targets,
    shrunk_covariance,
    structured_target,
    weight_floor,
)
from intent_recognition.promp.selection import Candidate, TaskSamples, select

SEGMENTATIONS = ("movement", "recording")


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

    Raises:
        ArgumentError: a setting is out of range.
    """

    n_basis: int = 20
    width: float = 1.0
    ridge: float = 3e-3
    segmentation: str = "movement"
    none_prior: float = 0.05
    none_spread: float = 2.0

    def __post_init__(self):
        if self.segmentation not in SEGMENTATIONS:
            raise ArgumentError(
                describe(
                    "segmentation", f"one of {SEGMENTATIONS}", self.segmentation, "Choose one."
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
    basis = NormalizedRBFBasis(settings.n_basis, settings.width)
    rejected: list[tuple[str, str]] = []
    labelled = []
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
    onset = onset_settings([recorded.observed for recorded in labelled]) if labelled else ()
    if settings.segmentation == "movement":
        labelled = cut_to_movement(labelled)
    examples = []
    for recorded in labelled:
        try:
            examples.append(make_example(recorded, basis, settings.ridge))
        except TrainingError as error:
            rejected.append((recorded.name, str(error)))
    if not examples:
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two usable, labelled demonstrations of a task",
                f"none of {len(demonstrations)}"
                + "".join(f"; {name}: {reason}" for name, reason in rejected[:3]),
                "Check the labels and the DOF file.",
            )
        )
    library, chosen, tried = _fit(examples, labelled[0], basis, settings, onset, provenance or {})
    used = tuple(example.name for example in examples)
    return library, TrainingReport(used, tuple(rejected), chosen, tried)


def _fit(
    examples: list[Example],
    first: Recorded,
    basis: NormalizedRBFBasis,
    settings: TrainingSettings,
    onset: tuple[OnsetSettings, ...],
    provenance: Mapping[str, object],
) -> tuple[TaskLibrary, Candidate, tuple[Candidate, ...]]:
    labels = tuple(sorted({example.task for example in examples}))
    groups = [[e for e in examples if e.task == label] for label in labels]
    degrees_of_freedom = len(examples) - len(labels)
    if degrees_of_freedom < 1:
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two demonstrations of one of the tasks",
                f"one of each of {len(labels)}",
                "Record more: 5 to 20 of each task are usual.",
            )
        )
    weights = [np.array([e.weights for e in group]) for group in groups]
    everything = np.concatenate(weights)
    floor = weight_floor(everything)
    deviations = np.concatenate([w - w.mean(axis=0) for w in weights])
    tasks = np.repeat(np.arange(len(labels)), [len(group) for group in groups])
    targets = [
        structured_target(deviations, tasks, task, floor).covariance()
        for task in range(len(labels))
    ]
    loo_targets = [
        leave_one_out_targets(deviations, tasks, task, floor) for task in range(len(labels))
    ]
    residual = np.mean([e.residual_variance for e in examples], axis=0)
    noise = np.maximum(residual, floor)
    samples = [
        TaskSamples(
            w,
            np.array([e.observed for e in group]),
            np.repeat(basis.design_matrix(sample_phases())[None], len(group), axis=0),
            np.repeat(sample_phases()[None], len(group), axis=0),
            np.array([e.controlled for e in group]),
        )
        for w, group in zip(weights, groups, strict=True)
    ]
    chosen, tried = select(samples, loo_targets, noise, basis.design_matrix(scored_phases()))
    n = np.array([len(group) for group in groups])
    scatters = [np.einsum("id,ie->de", *(2 * [_flat(w)])) for w in weights]
    covariance = np.array(
        [
            shrunk_covariance(scatter, count, target, chosen.strength)
            for scatter, count, target in zip(scatters, n, targets, strict=True)
        ]
    )
    log_mean, log_std = _timing([[e.duration_s for e in group] for group in groups])
    n_observed = examples[0].observed.shape[1]
    task_means = np.array([w.mean(axis=0)[:n_observed] for w in weights])
    centre = task_means.mean(axis=0)
    observed = everything[:, :n_observed]
    none_mean, none_covariance = pooled_none_model(
        observed - centre,
        centre,
        np.sqrt(floor[:n_observed]) / FLOOR_OF_RANGE,
        settings.none_spread,
    )
    all_logs = np.log([e.duration_s for e in examples])
    library = TaskLibrary(
        labels=labels,
        basis=basis,
        observed_names=tuple(name for s in first.observed for name in s.names),
        controlled_names=tuple(name for s in first.controlled for name in s.names),
        observed_units=tuple(s.unit for s in first.observed for _ in s.names),
        controlled_units=tuple(s.unit for s in first.controlled for _ in s.names),
        weight_mean=np.array([w.mean(axis=0).ravel() for w in weights]),
        weight_covariance=covariance,
        noise_variance=noise,
        noise_scale=chosen.noise_scale,
        correlation_time_s=float(np.exp(all_logs).mean()) / SAMPLES_PER_MOVEMENT,
        log_duration_mean=log_mean,
        log_duration_std=log_std,
        task_prior=np.full(len(labels), 1.0 / len(labels)),
        transition_prior=np.full((len(labels) + 1, len(labels)), 1.0 / len(labels)),
        none_mean=none_mean,
        none_covariance=none_covariance,
        none_log_duration=np.array([all_logs.mean(), max(float(all_logs.std()), 0.2)]),
        none_prior=settings.none_prior,
        n_demonstrations=n,
        observed_groups=tuple(len(s.names) for s in first.observed),
        onset=onset,
        provenance={**provenance, "settings": asdict(settings), "chosen": chosen._asdict()},
    )
    return library, chosen, tried


def _dofs(recorded: Recorded) -> tuple[tuple[tuple[str, ...], str], ...]:
    """Names and unit of each signal, observed then controlled."""
    return tuple((s.names, s.unit) for s in (*recorded.observed, *recorded.controlled))


def _flat(weights: np.ndarray) -> np.ndarray:
    """Deviations from the mean, flattened: (n, D N)."""
    return (weights - weights.mean(axis=0)).reshape(len(weights), -1)


def _timing(durations: list[list[float]]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of log duration per task; the spread leans on all tasks."""
    logs = [np.log(values) for values in durations]
    scatter = np.array([np.sum((x - x.mean()) ** 2) for x in logs])
    n = np.array([len(x) for x in logs])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    worth = 4.0
    variance = (scatter + worth * pooled) / (n - 1 + worth) * (1 + 1 / n)
    return np.array([x.mean() for x in logs]), np.sqrt(np.maximum(variance, 0.05**2))
