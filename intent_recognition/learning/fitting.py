# SPDX-License-Identifier: Apache-2.0
"""The library that follows from statistics and hyperparameters: no recording is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np

from intent_recognition.learning.accumulation import Reference
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT
from intent_recognition.learning.selection import Candidate
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments
from intent_recognition.learning.timing_covariance import (
    mean_timing,
    timing_covariance,
    unseen_timing,
)
from intent_recognition.learning.unknown_task import none_model
from intent_recognition.promp import (
    IDENTITY_CALIBRATION,
    AlignedPrimitives,
    TaskLibrary,
    observed_block,
    recognition_covariances,
    shrunk_covariance,
    structured_target,
    weight_floor,
)

DURATION_SAMPLE_SIZE = 4.0
"""Demonstrations' worth of the assumption that all tasks' durations spread alike."""
SMALLEST_DURATION_STD = 0.05
"""Smallest spread of the log duration of a task."""


def library_from_statistics(
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    chosen: Candidate,
    provenance: Mapping[str, object] | None = None,
    none_calibration: Sequence[float] = IDENTITY_CALIBRATION,
) -> TaskLibrary:
    """The library of given statistics.

    Args:
        tasks: statistics of each label, sorted; at least one of two demonstrations.
        reference: how their examples were made.
        chosen: the hyperparameters.
        provenance: what to remember about the origin.
        none_calibration: a hyperparameter too, but it takes a library to choose it.
    """
    settings, n_tasks = reference.settings, len(tasks)
    return TaskLibrary(
        labels=tuple(tasks),
        basis=reference.basis,
        **_names(reference),
        **learned_from(tasks, reference, chosen),
        task_prior=np.full(n_tasks, 1.0 / n_tasks),
        transition_prior=np.full((n_tasks + 1, n_tasks), 1.0 / n_tasks),
        none_prior=settings.none_prior,
        duration_evidence=settings.duration_evidence,
        none_calibration=np.array(none_calibration),
        onset=reference.onset,
        provenance={
            **(provenance or {}),
            "settings": asdict(settings),
            "chosen": chosen._asdict(),
        },
    )


def learned_from(
    tasks: Mapping[str, TaskStatistics], reference: Reference, chosen: Candidate
) -> dict[str, object]:
    """Those attributes of the library that change with every demonstration."""
    statistics = list(tasks.values())
    _, noise = scales(tasks)
    covariances = predictive_covariances(tasks, chosen.strength)
    timing = _timing(statistics)
    covariance = recognition(tasks, reference, chosen.recognition_strength)
    return {
        "weight_mean": np.array([task.mean.ravel() for task in statistics]),
        "weight_covariance": covariances,
        "noise_variance": noise,
        "noise_scale": chosen.noise_scale,
        "n_demonstrations": np.array([task.n for task in statistics]),
        **timing,
        "recognition_covariance": covariance,
        "recognition_noise_scale": chosen.recognition_noise_scale,
        **none_model(statistics, covariance, timing),
        "aligned": aligned_primitives(tasks, reference, chosen) if chosen.aligned else None,
    }


def aligned_statistics(tasks: Mapping[str, TaskStatistics]) -> dict[str, TaskStatistics] | None:
    """Statistics of the aligned examples of each label; None where there are none."""
    if any(task.aligned is None for task in tasks.values()):
        return None
    return {label: task.aligned for label, task in tasks.items()}


def aligned_primitives(
    tasks: Mapping[str, TaskStatistics], reference: Reference, chosen: Candidate
) -> AlignedPrimitives:
    """Primitives over reference phase, of tasks whose examples were aligned."""
    over_reference = aligned_statistics(tasks)
    _, noise = scales(over_reference)
    return AlignedPrimitives(
        basis=reference.forecast_basis,
        n_observed=sum(len(signal.names) for signal in reference.observed),
        weight_mean=np.array([task.mean.ravel() for task in over_reference.values()]),
        weight_covariance=predictive_covariances(over_reference, chosen.aligned_strength),
        noise_variance=noise,
        noise_scale=chosen.aligned_noise_scale,
        phase_deviation=reference.timing.phase_deviation,
    )


def recognition(
    tasks: Mapping[str, TaskStatistics], reference: Reference, strength: float
) -> np.ndarray:
    """Covariances of the observed weights that tasks are told apart by, (K, P N, P N)."""
    floor, _ = scales(tasks)
    basis = reference.basis
    n_dofs = sum(len(signal.names) for signal in reference.observed)
    size = n_dofs * basis.n_basis
    pooled = observed_block(pooled_moments(tasks.values()), size)
    own = [observed_block(task.moments, size) for task in tasks.values()]
    means = [task.mean[:n_dofs].ravel() for task in tasks.values()]
    covariances = recognition_covariances(own, pooled, floor[:n_dofs], strength)
    phase_deviation = reference.timing.phase_deviation
    shared = mean_timing(basis, means, phase_deviation)
    for covariance, mean in zip(covariances, means, strict=True):
        covariance += unseen_timing(timing_covariance(basis, mean, phase_deviation), shared)
    return covariances


def predictive_covariances(tasks: Mapping[str, TaskStatistics], strength: float) -> np.ndarray:
    """Predictive covariance of each task's next demonstration, (K, D N, D N)."""
    floor, _ = scales(tasks)
    pooled = pooled_moments(tasks.values())
    covariances = []
    for task in tasks.values():
        target = structured_target(task.moments, pooled, floor).covariance()
        covariances.append(shrunk_covariance(task.scatter, task.n, target, strength))
    return np.array(covariances)


def scales(tasks: Mapping[str, TaskStatistics]) -> tuple[np.ndarray, np.ndarray]:
    """Variance floor and noise variance of each DOF over all demonstrations, (D,)."""
    statistics = tasks.values()
    lowest = np.min([task.lowest for task in statistics], axis=0)
    highest = np.max([task.highest for task in statistics], axis=0)
    extremes = np.stack([lowest, highest], axis=1)[None]
    floor = weight_floor(extremes)
    residual = np.sum([task.residual_sum for task in statistics], axis=0)
    noise = np.maximum(residual / sum(task.n for task in statistics), floor)
    return floor, noise


def _timing(tasks: Sequence[TaskStatistics]) -> dict[str, object]:
    """Timing prior per task from log durations; the spread leans on all tasks."""
    scatter = np.array([task.log_duration_scatter for task in tasks])
    n = np.array([task.n for task in tasks])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    variance = (
        (scatter + DURATION_SAMPLE_SIZE * pooled) / (n - 1 + DURATION_SAMPLE_SIZE) * (1 + 1 / n)
    )
    duration_sum_s = sum(task.duration_sum_s for task in tasks)
    return {
        "log_duration_mean": np.array([task.log_duration_mean for task in tasks]),
        "log_duration_std": np.sqrt(np.maximum(variance, SMALLEST_DURATION_STD**2)),
        "correlation_time_s": float(duration_sum_s / n.sum()) / SAMPLES_PER_MOVEMENT,
    }


def _names(reference: Reference) -> dict[str, tuple]:
    """Names, units and groups of the DOFs."""
    return {
        "observed_names": tuple(name for s in reference.observed for name in s.names),
        "controlled_names": tuple(name for s in reference.controlled for name in s.names),
        "observed_units": tuple(s.unit for s in reference.observed for _ in s.names),
        "controlled_units": tuple(s.unit for s in reference.controlled for _ in s.names),
        "observed_groups": tuple(len(s.names) for s in reference.observed),
    }
