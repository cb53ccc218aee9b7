# SPDX-License-Identifier: Apache-2.0
"""The library that follows from statistics and hyperparameters: no recording is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np

from intent_recognition.promp.examples import SAMPLES_PER_MOVEMENT
from intent_recognition.promp.gathering import Reference
from intent_recognition.promp.library import TaskLibrary, pooled_none_model
from intent_recognition.promp.prior import (
    shrunk_covariance,
    structured_target,
    weight_extent,
    weight_floor,
)
from intent_recognition.promp.selection import Candidate
from intent_recognition.promp.statistics import TaskStatistics, pooled_moments
from intent_recognition.promp.training_settings import TrainingSettings

DURATION_WORTH = 4.0
"""Demonstrations' worth of the assumption that all tasks' durations spread alike."""
SMALLEST_DURATION_STD = 0.05
NONE_DURATION_STD = 0.2
"""Smallest spreads of the log duration, of a task and of none."""


def library_from_statistics(
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    chosen: Candidate,
    provenance: Mapping[str, object] | None = None,
) -> TaskLibrary:
    """The library of given statistics.

    Args:
        tasks: statistics of each label, sorted; at least one of two demonstrations.
        reference: how their examples were made.
        chosen: the hyperparameters.
        provenance: what to remember about the origin.
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
    extent, floor, noise = scales(tasks)
    pooled = pooled_moments(statistics)
    covariances = []
    for task in statistics:
        target = structured_target(task.moments, pooled, floor).covariance()
        covariances.append(shrunk_covariance(task.scatter, task.n, target, chosen.strength))
    n_observed = sum(len(signal.names) for signal in reference.observed)
    return {
        "weight_mean": np.array([task.mean.ravel() for task in statistics]),
        "weight_covariance": np.array(covariances),
        "noise_variance": noise,
        "noise_scale": chosen.noise_scale,
        "n_demonstrations": np.array([task.n for task in statistics]),
        **_timing(statistics),
        **_none_model(statistics, pooled.matrix, extent[:n_observed], reference.settings),
    }


def scales(tasks: Mapping[str, TaskStatistics]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Range, variance floor and noise variance of each DOF over all demonstrations, (D,)."""
    statistics = tasks.values()
    lowest = np.min([task.lowest for task in statistics], axis=0)
    highest = np.max([task.highest for task in statistics], axis=0)
    extremes = np.stack([lowest, highest], axis=1)[None]
    floor = weight_floor(extremes)
    residual = np.sum([task.residual_sum for task in statistics], axis=0)
    noise = np.maximum(residual / sum(task.n for task in statistics), floor)
    return weight_extent(extremes), floor, noise


def _none_model(
    tasks: Sequence[TaskStatistics],
    scatter: np.ndarray,
    extent: np.ndarray,
    settings: TrainingSettings,
) -> dict[str, np.ndarray]:
    """Observed weights and timing of any human movement, from all demonstrations together."""
    n_observed = len(extent)
    means = np.array([task.mean[:n_observed] for task in tasks])
    count = np.array([task.n for task in tasks], dtype=np.float64)
    centre = means.mean(axis=0)
    offset = (means - centre).reshape(len(tasks), -1)
    size = offset.shape[1]
    about_centre = scatter[:size, :size] + (offset.T * count) @ offset
    n = int(count.sum())
    mean, covariance = pooled_none_model(about_centre, n, centre, extent, settings.none_spread)
    logs = np.array([task.log_duration_mean for task in tasks])
    log_mean = count @ logs / n
    within = sum(task.log_duration_scatter for task in tasks)
    log_std = float(np.sqrt((within + count @ (logs - log_mean) ** 2) / n))
    return {
        "none_mean": mean,
        "none_covariance": covariance,
        "none_log_duration": np.array([log_mean, max(log_std, NONE_DURATION_STD)]),
    }


def _timing(tasks: Sequence[TaskStatistics]) -> dict[str, object]:
    """Timing prior per task from log durations; the spread leans on all tasks."""
    scatter = np.array([task.log_duration_scatter for task in tasks])
    n = np.array([task.n for task in tasks])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    variance = (scatter + DURATION_WORTH * pooled) / (n - 1 + DURATION_WORTH) * (1 + 1 / n)
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
