# SPDX-License-Identifier: Apache-2.0
"""The library that follows from statistics and hyperparameters: no recording is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT
from intent_recognition.learning.held_out_recognition import recognition_covariance
from intent_recognition.learning.preprocessing import Preprocessing
from intent_recognition.learning.selection import Hyperparameters
from intent_recognition.learning.statistics import (
    TaskStatistics,
    aligned_statistics,
    pooled_moments,
    variance_scales,
)
from intent_recognition.learning.unknown_task import departure, none_primitive, none_timing
from intent_recognition.promp import (
    IDENTITY_CALIBRATION,
    AlignedPrimitives,
    TaskLibrary,
    shrunk_covariance,
    structured_target,
)

DURATION_SAMPLE_SIZE = 4.0
"""Equivalent sample size, in demonstrations, of the prior that the log durations of all tasks have
the same variance. Convention."""
SMALLEST_DURATION_STD = 0.05
"""Smallest standard deviation of the log duration of a task: 5 % of the duration. Convention."""


class LearnedFields(TypedDict):
    """The fields of a `TaskLibrary` that change with every demonstration."""

    weight_mean: NDArray[np.float64]
    weight_covariance: NDArray[np.float64]
    noise_variance: NDArray[np.float64]
    noise_scale: float
    n_demonstrations: NDArray[np.int64]
    log_duration_mean: NDArray[np.float64]
    log_duration_std: NDArray[np.float64]
    correlation_time_s: float
    recognition_covariance: NDArray[np.float64]
    recognition_noise_scale: float
    none_mean: NDArray[np.float64]
    none_covariance: NDArray[np.float64]
    none_log_duration: NDArray[np.float64]
    aligned: AlignedPrimitives | None


def library_from_statistics(
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    chosen: Hyperparameters,
    provenance: Mapping[str, object] | None = None,
    none_calibration: Sequence[float] = IDENTITY_CALIBRATION,
) -> TaskLibrary:
    """The library of given statistics.

    Args:
        tasks: statistics of each label, sorted; at least one of two demonstrations.
        preprocessing: how their examples were made.
        chosen: the hyperparameters.
        provenance: stored in the library, beside settings and hyperparameters.
        none_calibration: see `calibrate_none`, which needs a library to choose it.
    """
    settings, n_tasks = preprocessing.settings, len(tasks)
    observed, controlled = preprocessing.observed, preprocessing.controlled
    return TaskLibrary(
        labels=tuple(tasks),
        basis=preprocessing.basis,
        observed_names=tuple(name for signal in observed for name in signal.names),
        controlled_names=tuple(name for signal in controlled for name in signal.names),
        observed_units=tuple(signal.unit for signal in observed for _ in signal.names),
        controlled_units=tuple(signal.unit for signal in controlled for _ in signal.names),
        observed_groups=tuple(len(signal.names) for signal in observed),
        **learned_from(tasks, preprocessing, chosen),
        task_prior=np.full(n_tasks, 1.0 / n_tasks),
        transition_prior=np.full((n_tasks + 1, n_tasks), 1.0 / n_tasks),
        none_prior=settings.none_prior,
        duration_evidence=settings.duration_evidence,
        none_calibration=np.array(none_calibration),
        onset=preprocessing.onset,
        provenance={
            **(provenance or {}),
            "settings": asdict(settings),
            "chosen": chosen._asdict(),
        },
    )


def learned_from(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing, chosen: Hyperparameters
) -> LearnedFields:
    """The fields of the library that change with every demonstration."""
    statistics, n_observed = list(tasks.values()), preprocessing.n_observed
    _, noise = variance_scales(tasks)
    log_mean, log_std = _durations(statistics)
    covariance = recognition_covariance(tasks, preprocessing, chosen.recognition_strength)
    means = np.array([task.mean[:n_observed] for task in statistics])
    none = none_primitive(means, covariance, departure(statistics, n_observed))
    n = np.array([task.n for task in statistics])
    mean_duration_s = float(sum(task.duration_sum_s for task in statistics) / n.sum())
    return {
        "weight_mean": np.array([task.mean.ravel() for task in statistics]),
        "weight_covariance": predictive_covariances(tasks, chosen.strength),
        "noise_variance": noise,
        "noise_scale": chosen.noise_scale,
        "n_demonstrations": n,
        "log_duration_mean": log_mean,
        "log_duration_std": log_std,
        "correlation_time_s": mean_duration_s / SAMPLES_PER_MOVEMENT,
        "recognition_covariance": covariance,
        "recognition_noise_scale": chosen.recognition_noise_scale,
        "none_mean": none.mean,
        "none_covariance": none.covariance,
        "none_log_duration": none_timing(log_mean, log_std),
        "aligned": aligned_primitives(tasks, preprocessing, chosen) if chosen.aligned else None,
    }


def aligned_primitives(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing, chosen: Hyperparameters
) -> AlignedPrimitives:
    """Primitives over reference phase.

    Raises:
        ValueError: the examples of a task were not aligned.
    """
    aligned = aligned_statistics(tasks)
    if aligned is None:
        raise ValueError("aligned_primitives needs tasks whose examples are all aligned")
    _, noise = variance_scales(aligned)
    return AlignedPrimitives(
        basis=preprocessing.aligned_basis,
        n_observed=preprocessing.n_observed,
        weight_mean=np.array([task.mean.ravel() for task in aligned.values()]),
        weight_covariance=predictive_covariances(aligned, chosen.aligned_strength),
        noise_variance=noise,
        noise_scale=chosen.aligned_noise_scale,
        phase_deviation=preprocessing.timing.phase_deviation,
    )


def predictive_covariances(
    tasks: Mapping[str, TaskStatistics], strength: float
) -> NDArray[np.float64]:
    """Predictive covariance of each task's next demonstration, (K, D N, D N)."""
    floor, _ = variance_scales(tasks)
    pooled = pooled_moments(tasks.values())
    covariances = []
    for task in tasks.values():
        target = structured_target(task.moments, pooled, floor).covariance()
        covariances.append(shrunk_covariance(task.scatter, task.n, target, strength))
    return np.array(covariances)


def _durations(tasks: Sequence[TaskStatistics]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and predictive standard deviation of each task's log duration, (K,) each.

    The variance is shrunk towards the one pooled over all tasks.
    """
    scatter = np.array([task.log_duration_scatter for task in tasks])
    n = np.array([task.n for task in tasks])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    variance = (
        (scatter + DURATION_SAMPLE_SIZE * pooled) / (n - 1 + DURATION_SAMPLE_SIZE) * (1 + 1 / n)
    )
    mean = np.array([task.log_duration_mean for task in tasks])
    return mean, np.sqrt(np.maximum(variance, SMALLEST_DURATION_STD**2))
