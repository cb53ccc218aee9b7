# SPDX-License-Identifier: Apache-2.0
"""The hypothesis that a movement is none of the known tasks.

A movement nobody taught is one more draw from the population the known tasks were drawn from: its
mean lies about their mean as they lie about it themselves, and it varies as they vary. With few
tasks their scatter is hardly known, so it leans on how far movements depart from their starts.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.learning.statistics import TaskStatistics

DEPARTURE_SAMPLE_SIZE = 0.25
"""Tasks' worth of the guess that tasks differ as much as movements depart from their starts."""
DEVIATION_WIDTH = 0.25
AMPLITUDE_WIDTH = 0.1
"""How long in phase an unknown movement's deviation lasts, and its size is averaged."""


def none_model(
    tasks: Sequence[TaskStatistics], covariances: np.ndarray, timing: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The attributes of a library that describe none.

    Args:
        tasks: statistics of its K tasks.
        covariances: of their observed weights, (K, P N, P N).
        timing: the library's `log_duration_mean` and `log_duration_std`.
    """
    n_observed = covariances.shape[1] // tasks[0].mean.shape[1]
    means = np.array([task.mean[:n_observed] for task in tasks])
    mean, covariance = none_primitive(means, covariances, departure(tasks, n_observed))
    return {
        "none_mean": mean,
        "none_covariance": covariance,
        "none_log_duration": none_timing(timing["log_duration_mean"], timing["log_duration_std"]),
    }


def departure(tasks: Sequence[TaskStatistics], n_observed: int) -> np.ndarray:
    """Mean square distance of movements from where they start, per basis function, (N,).

    To it comes how much the starts vary among themselves; mean over the P observed DOFs.
    """
    n_basis = tasks[0].mean.shape[1]
    count = np.array([task.n for task in tasks], dtype=np.float64)
    means = np.array([task.mean[:n_observed] for task in tasks])
    centre = np.einsum("k,kp->p", count, means[:, :, 0]) / count.sum()
    total = np.zeros(n_basis)
    for task, mean in zip(tasks, means, strict=True):
        rows = task.scatter.reshape(len(task.mean), n_basis, len(task.mean), n_basis)
        own = np.einsum("dkdl->dkl", rows)[:n_observed]
        spread = np.einsum("pkk->k", own) + np.sum(own[:, 0, 0]) - 2.0 * np.sum(own[:, 0], axis=0)
        total += spread + task.n * np.sum((mean - mean[:, :1]) ** 2, axis=0)
        total += np.sum(own[:, 0, 0]) + task.n * np.sum((mean[:, 0] - centre) ** 2)
    return total / (count.sum() * n_observed)


def none_primitive(means: np.ndarray, covariances: np.ndarray, departed: np.ndarray) -> Gaussian:
    """Observed weights of a movement that is none of K tasks but of their kind.

    Args:
        means: of the tasks' observed weights, (K, P, N).
        covariances: theirs, (K, P N, P N).
        departed: see `departure`, (N,).
    """
    n_tasks, n_dofs, n_basis = means.shape
    centre = means.mean(axis=0)
    scatter = np.sum(np.mean((means - centre) ** 2, axis=1), axis=0)
    phase = np.linspace(0.0, 1.0, n_basis)
    distance = phase[:, None] - phase
    average = np.exp(-0.5 * (distance / AMPLITUDE_WIDTH) ** 2)
    average /= average.sum(axis=1, keepdims=True)
    variance = (scatter + DEPARTURE_SAMPLE_SIZE * departed) / (n_tasks - 1 + DEPARTURE_SAMPLE_SIZE)
    amplitude = np.sqrt(average @ variance * (1.0 + 1.0 / n_tasks))
    lasting = np.exp(-0.5 * (distance / DEVIATION_WIDTH) ** 2)
    between = np.kron(np.eye(n_dofs), lasting * np.outer(amplitude, amplitude))
    return Gaussian(centre.ravel(), symmetrize(covariances.mean(axis=0) + between))


def none_timing(log_mean: np.ndarray, log_std: np.ndarray) -> np.ndarray:
    """Mean and standard deviation of its log duration, (2,), from the tasks' (K,) and (K,)."""
    return np.array([log_mean.mean(), np.sqrt(np.mean(log_std**2) + log_mean.var())])
