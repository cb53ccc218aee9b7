# SPDX-License-Identifier: Apache-2.0
"""The plain way to what a bank of hypotheses says of a movement, for comparison."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.filtering.observation_model import check_observation
from intent_recognition.gaussian.batch import GaussianBatch, LinearMeasurement
from intent_recognition.gaussian.linalg import symmetrize
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.prediction import StartPosture, controlled_weights
from intent_recognition.promp.trajectory import dof_variance
from intent_recognition.signals.observation import Observation


class Bank(NamedTuple):
    """Filtered observed weights of B hypotheses, and the density of all observations under them."""

    mean: np.ndarray
    covariance: np.ndarray
    log_evidence: np.ndarray


def bank_of(run: MovementFilter) -> Bank:
    """All hypotheses of a filter, none of which lags any more."""
    tasks = [run.task(task).moments() for task in range(run.library.n_tasks + 1)]
    mean, covariance = (np.concatenate(part) for part in zip(*tasks, strict=True))
    return Bank(mean, covariance, run.log_evidence)


def start_bank(library: TaskLibrary, hypotheses: PriorGrid) -> Bank:
    """The bank before any observation."""
    return Bank(
        np.repeat(library.observed_mean, hypotheses.n_scales, axis=0),
        np.repeat(library.observed_covariance, hypotheses.n_scales, axis=0),
        np.zeros(len(hypotheses.duration_s)),
    )


def run_bank(
    library: TaskLibrary, hypotheses: PriorGrid, observations: Iterable[Observation], onset_ns: int
) -> Bank:
    """The bank after a stretch of observations that begins at onset."""
    run = MovementFilter(library, hypotheses, onset_ns)
    for observation in observations:
        run.observe(observation)
    return bank_of(run)


def condition_bank(
    bank: Bank, dofs: np.ndarray, rows: np.ndarray, values: np.ndarray, noise_covariance: np.ndarray
) -> Bank:
    """Every hypothesis conditioned on one observation; the argument is not changed.

    Args:
        bank: B hypotheses.
        dofs: index of the DOF behind each observed value, (m,).
        rows: row of the observation matrix within a DOF's block, shared by the DOFs, (B, 1, N).
        values: (m,).
        noise_covariance: (m, m) or one per hypothesis, (B, m, m).
    """
    check_observation(dofs, values, noise_covariance)
    n, n_basis = len(bank.mean), rows.shape[-1]
    rows = np.broadcast_to(rows, (n, 1, n_basis))
    block = GaussianBatch.of(bank.mean, bank.covariance, n_basis)
    density, _ = block.condition(LinearMeasurement(dofs, rows, values, noise_covariance))
    return Bank(*block.moments(), bank.log_evidence + density)


def observed_weights(bank: Bank, scale_weights: np.ndarray, task: int) -> Gaussian:
    """Observed weights given the task, durations marginalised by matching moments.

    Args:
        bank: the filtered hypotheses.
        scale_weights: p(duration | task), (K + 1, S).
        task: number of the task.
    """
    weights = scale_weights[task]
    block = slice(task * len(weights), (task + 1) * len(weights))
    means = bank.mean[block]
    mean = weights @ means
    deviation = (means - mean) * np.sqrt(weights)[:, None]
    covariance = np.tensordot(weights, bank.covariance[block], axes=1) + deviation.T @ deviation
    return Gaussian(mean, symmetrize(covariance))


def mixture_at(
    library: TaskLibrary,
    bank: Bank,
    hypotheses: PriorGrid,
    weights: np.ndarray,
    times_s: np.ndarray,
    start: StartPosture | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and total standard deviation of the controlled agent at true times after onset.

    Every hypothesis predicts at its own phase of that time; their mixture's moments are returned
    (Ewerton et al. 2015, Eq. 14), noise included.

    Args:
        library: the learned tasks.
        bank: the filtered hypotheses.
        hypotheses: the bank's grid.
        weights: probability of each task and duration, (K, S), summing to one.
        times_s: (T,).
        start: posture of the controlled agent at onset, when known.

    Returns:
        Mean (T, Q) and standard deviation (T, Q).
    """
    n_scales, n_controlled = hypotheses.n_scales, library.n_controlled
    mean = np.zeros((len(times_s), n_controlled))
    second = np.zeros_like(mean)
    for index in np.flatnonzero(weights.ravel() > 1e-9):
        task = index // n_scales
        weight = weights.ravel()[index]
        observed = Gaussian(bank.mean[index], bank.covariance[index])
        controlled = controlled_weights(library, task, observed, start)
        phase = np.clip(times_s / hypotheses.duration_s[index], 0.0, 1.0)
        design = library.basis.design_matrix(phase)
        position = design @ controlled.mean.reshape(n_controlled, -1).T
        variance = dof_variance(design, controlled.covariance) + library.control_noise_variance()
        mean += weight * position
        second += weight * (variance + position**2)
    total = weights.sum()
    mean, second = mean / total, second / total
    return mean, np.sqrt(np.maximum(second - mean**2, 1e-12 * np.maximum(second, 1e-300)))
