# SPDX-License-Identifier: Apache-2.0
"""From the filtered observed weights to trajectories of both agents."""

from typing import NamedTuple

import numpy as np

from intent_recognition.gaussian.linalg import cholesky, symmetrize
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp.bank import FilterBank, Hypotheses
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.library import TaskLibrary


class Trajectory(NamedTuple):
    """Mean and spread of some DOFs over a grid of times.

    Attributes:
        times_s: (T,).
        positions: mean, (T, d).
        velocities: mean, per second, (T, d).
        std: standard deviation of the position, (T, d).
    """

    times_s: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    std: np.ndarray


class StartPosture(NamedTuple):
    """The controlled agent's measured position at onset: (Q,) and its variance (Q,)."""

    position: np.ndarray
    variance: np.ndarray


def observed_weights(bank: FilterBank, scale_weights: np.ndarray, task: int) -> Gaussian:
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


def controlled_weights(
    library: TaskLibrary, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    N(A m_o + b, C + A P_o A^T), exact (`TaskLibrary.recovery`). A start posture is one more
    observation of the controlled weights at phase 0; it moves the trajectory only, never the task.
    """
    matrix, offset, covariance = library.recovery[task]
    mean = matrix @ observed.mean + offset
    covariance = symmetrize(covariance + matrix @ observed.covariance @ matrix.T)
    if start is None:
        return Gaussian(mean, covariance)
    row = library.basis.design_matrix(np.zeros(1))
    design = np.kron(np.eye(library.n_controlled), row)
    cross = covariance @ design.T
    noise = np.diag(start.variance + library.control_noise_variance())
    factor = cholesky(symmetrize(design @ cross) + noise, name="start posture covariance")
    scaled = np.linalg.solve(factor, cross.T)
    innovation = np.linalg.solve(factor, start.position - design @ mean)
    return Gaussian(mean + scaled.T @ innovation, symmetrize(covariance - scaled.T @ scaled))


def rollout(
    basis: NormalizedRBFBasis,
    weights: Gaussian,
    phase: np.ndarray,
    duration_s: float,
    noise_variance: np.ndarray,
) -> Trajectory:
    """Trajectory of d DOFs at phases (T,), lasting `duration_s` from phase 0 to 1.

    Args:
        basis: the basis functions.
        weights: distribution of the weights, (d N,).
        phase: (T,).
        duration_s: time from phase 0 to 1.
        noise_variance: residual variance per DOF added to the spread, (d,).
    """
    design = basis.design_matrix(phase)
    n_dofs = len(weights.mean) // basis.n_basis
    per_dof = weights.mean.reshape(n_dofs, basis.n_basis)
    velocities = basis.derivative_matrix(phase) @ per_dof.T / duration_s
    variance = dof_variance(design, weights.covariance) + noise_variance
    return Trajectory(phase * duration_s, design @ per_dof.T, velocities, np.sqrt(variance))


def dof_variance(design: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Variance of each DOF at each row of the design (T, N), given weights' covariance: (T, d)."""
    n_basis = design.shape[1]
    n_dofs = len(covariance) // n_basis
    blocks = covariance.reshape(n_dofs, n_basis, n_dofs, n_basis)
    own = np.einsum("dkdl->dkl", blocks)
    return np.einsum("tk,dkl,tl->td", design, own, design, optimize=True)


def mixture_at(
    library: TaskLibrary,
    bank: FilterBank,
    hypotheses: Hypotheses,
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
