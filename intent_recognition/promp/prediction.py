# SPDX-License-Identifier: Apache-2.0
"""From the filtered observed weights to trajectories of both agents."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, cholesky, symmetrize
from intent_recognition.promp.aligned import AlignedPrimitives
from intent_recognition.promp.basis import NormalizedRBFBasis


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


def controlled_weights(
    primitives: AlignedPrimitives, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    N(A m_o + b, C + A P_o A^T), exact (`AlignedPrimitives.recovery`). A start posture is one more
    observation of the controlled weights at phase 0; it moves the trajectory only, never the task.
    """
    matrix, offset, covariance = primitives.recovery[task]
    mean = matrix @ observed.mean + offset
    covariance = symmetrize(covariance + matrix @ observed.covariance @ matrix.T)
    if start is None:
        return Gaussian(mean, covariance)
    row = primitives.basis.design_matrix(np.zeros(1))
    design = np.kron(np.eye(primitives.n_controlled), row)
    cross = covariance @ design.T
    noise = np.diag(start.variance + primitives.control_noise_variance())
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


def largest_by_unit(std: NDArray[np.float64], units: Sequence[str]) -> dict[str, float]:
    """The largest of some standard deviations (d,) over the DOFs of each unit."""
    largest: dict[str, float] = {}
    for value, unit in zip(std.tolist(), units, strict=True):
        largest[unit] = max(value, largest.get(unit, value))
    return largest


def least_end_std(primitives: AlignedPrimitives, task: int) -> float:
    """How uncertain the end of a task stays, however much is seen.

    Standard deviation of the controlled DOF where it is largest, the observed weights and the
    controlled agent's start being known exactly: what demonstrations differ in that neither tells.
    """
    n, size = primitives.n_controlled, primitives.n_observed_weights
    known = Gaussian(np.zeros(size), np.zeros((size, size)))
    covariance = controlled_weights(
        primitives, task, known, StartPosture(np.zeros(n), np.zeros(n))
    ).covariance
    variance = dof_variance(primitives.basis.design_matrix(np.ones(1)), covariance)
    return float(np.sqrt(np.max(variance + primitives.control_noise_variance())))
