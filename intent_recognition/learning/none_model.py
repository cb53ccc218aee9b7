# SPDX-License-Identifier: Apache-2.0
"""The hypothesis that a movement is none of the known tasks.

An unknown movement is one more draw from the population of the known tasks. Its mean is distributed
about the average of their means as these are, and it varies about its mean with the average of
their covariances. The scatter of a few tasks is poorly known, so it is shrunk towards how far
movements depart from their starts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.signals import commensurate

DEPARTURE_SAMPLE_SIZE = 0.25
"""Equivalent sample size, in tasks, of the prior that tasks differ as much as movements depart from
their starts (docs/recognition.md)."""


class Departure(NamedTuple):
    """How far movements depart from their starts in some observed DOFs."""

    dofs: Integers  # indices of these DOFs, (p,)
    square: Floats  # mean square distance per basis function, (N,)


def departures(tasks: Sequence[TaskStatistics], units: Sequence[str]) -> list[Departure]:
    """Departures in the observed DOFs, one per kind of commensurate `units` (P,)."""
    return [Departure(dofs, departure(tasks, dofs)) for dofs in commensurate(units)]


def departure(tasks: Sequence[TaskStatistics], dofs: Integers) -> Floats:
    """Mean square distance of movements from where they start, per basis function, (N,).

    The variance of the starts is added, and the mean is taken over the given DOFs (p,).
    """
    n_basis = tasks[0].mean.shape[1]
    count = np.array([task.n for task in tasks], dtype=np.float64)
    means = np.array([task.mean[dofs] for task in tasks])
    centre = np.einsum("k,kp->p", count, means[:, :, 0]) / count.sum()
    total = np.zeros(n_basis)
    for task, mean in zip(tasks, means, strict=True):
        rows = task.scatter.reshape(len(task.mean), n_basis, len(task.mean), n_basis)
        own = np.sum(np.einsum("dkdl->dkl", rows)[dofs], axis=0)
        total += np.diagonal(own) - 2.0 * own[0] + 2.0 * own[0, 0]
        total += task.n * np.sum((mean - mean[:, :1]) ** 2, axis=0)
        total += task.n * np.sum((mean[:, 0] - centre) ** 2)
    return total / (count.sum() * len(dofs))


def none_primitive(means: Floats, covariances: Floats, departed: Sequence[Departure]) -> Gaussian:
    """Distribution of the observed weights of an unknown movement, given K tasks.

    Args:
        means: means of the tasks' observed weights, (K, P, N).
        covariances: covariances of the tasks' observed weights, (K, P N, P N).
        departed: see `departures`; the scatter of the tasks is averaged over the DOFs of each.
    """
    n_tasks, n_dofs, n_basis = means.shape
    centre = means.mean(axis=0)
    phase = np.linspace(0.0, 1.0, n_basis)
    distance = phase[:, None] - phase
    average = np.exp(-0.5 * (distance / 0.1) ** 2)  # widths in phase
    average /= average.sum(axis=1, keepdims=True)
    correlation = np.exp(-0.5 * (distance / 0.25) ** 2)
    between = np.zeros((centre.size, centre.size))
    for dofs, square in departed:
        scatter = np.sum(np.mean((means[:, dofs] - centre[dofs]) ** 2, axis=1), axis=0)
        variance = scatter + DEPARTURE_SAMPLE_SIZE * square
        variance /= n_tasks - 1 + DEPARTURE_SAMPLE_SIZE
        amplitude = np.sqrt(average @ variance * (1.0 + 1.0 / n_tasks))
        these = np.diag(np.isin(np.arange(n_dofs), dofs).astype(np.float64))
        between += np.kron(these, correlation * np.outer(amplitude, amplitude))
    return Gaussian(centre.ravel(), symmetrize(covariances.mean(axis=0) + between))


def none_timing(log_mean: Floats, log_std: Floats) -> Floats:
    """Mean and standard deviation of an unknown movement's log duration, from the tasks' (K,)."""
    return np.array([log_mean.mean(), np.sqrt(np.mean(log_std**2) + log_mean.var())])
