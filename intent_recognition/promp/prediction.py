# SPDX-License-Identifier: Apache-2.0
"""From the filtered observed weights to trajectories of both agents."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, condition, symmetrize
from intent_recognition.promp.aligned import AlignedPrimitives
from intent_recognition.promp.basis import NormalizedRBFBasis


class Trajectory(NamedTuple):
    """Mean and standard deviation of some DOFs over a grid of times.

    Attributes:
        times_s: (T,).
        positions: mean, (T, d).
        velocities: mean, per second, (T, d).
        std: standard deviation of the position, (T, d).
    """

    times_s: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    std: NDArray[np.float64]


class StartPosture(NamedTuple):
    """The controlled agent's measured position at onset: (Q,) and its variance (Q,)."""

    position: NDArray[np.float64]
    variance: NDArray[np.float64]


def controlled_weights(
    primitives: AlignedPrimitives, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    N(A m_o + b, C + A P_o A^T), exact (`AlignedPrimitives.regressions`). A start posture is one
    more observation of the controlled weights at phase 0; it does not bear on the task.
    """
    matrix, offset, covariance = primitives.regressions[task]
    mean = matrix @ observed.mean + offset
    covariance = symmetrize(covariance + matrix @ observed.covariance @ matrix.T)
    if start is None:
        return Gaussian(mean, covariance)
    row = primitives.basis.design_matrix(np.zeros(1))
    design = np.kron(np.eye(primitives.n_controlled), row).astype(np.float64, copy=False)
    noise = np.diag(start.variance + primitives.control_noise_variance())
    return condition(Gaussian(mean, covariance), design, start.position, noise)[0]


def rollout(
    basis: NormalizedRBFBasis,
    weights: Gaussian,
    phase: NDArray[np.float64],
    duration_s: float,
    noise_variance: NDArray[np.float64],
) -> Trajectory:
    """Trajectory of d DOFs at phases (T,), lasting `duration_s` from phase 0 to 1.

    Args:
        basis: the basis functions.
        weights: distribution of the weights, (d N,).
        phase: (T,).
        duration_s: time from phase 0 to 1.
        noise_variance: residual variance per DOF, added to the variance of the mean, (d,).
    """
    design = basis.design_matrix(phase)
    n_dofs = len(weights.mean) // basis.n_basis
    per_dof = weights.mean.reshape(n_dofs, basis.n_basis)
    velocities = basis.derivative_matrix(phase) @ per_dof.T / duration_s
    variance = dof_variance(design, weights.covariance) + noise_variance
    return Trajectory(phase * duration_s, design @ per_dof.T, velocities, np.sqrt(variance))


def dof_variance(
    design: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
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
    """Least uncertainty of a task's predicted end, however much is observed.

    Largest standard deviation over the controlled DOFs, which have one unit, when the observed
    weights and the controlled agent's start are known exactly.
    """
    n, size = primitives.n_controlled, primitives.n_observed_weights
    known = Gaussian(np.zeros(size), np.zeros((size, size)))
    covariance = controlled_weights(
        primitives, task, known, StartPosture(np.zeros(n), np.zeros(n))
    ).covariance
    variance = dof_variance(primitives.basis.design_matrix(np.ones(1)), covariance)
    return float(np.sqrt(np.max(variance + primitives.control_noise_variance())))
