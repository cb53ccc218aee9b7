# SPDX-License-Identifier: Apache-2.0
"""Trajectories (mean and standard deviation over time) from a distribution of the weights."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, brief
from intent_recognition.errors import check_whole
from intent_recognition.gaussian import Gaussian
from intent_recognition.promp.basis import NormalizedRBFBasis


@brief
class Trajectory(NamedTuple):
    """Mean and standard deviation of some DOFs over a grid of times.

    Attributes:
        times_s: times, (T,) [s].
        positions: mean positions, (T, d).
        velocities: mean velocities, per second, (T, d).
        std: standard deviations of the positions, (T, d).
    """

    times_s: Floats
    positions: Floats
    velocities: Floats
    std: Floats


def check_points(n_points: int) -> None:
    """Check a number of points.

    Raises:
        ArgumentError: `n_points` is not a whole number of at least 1.
    """
    check_whole("n_points", n_points, 1, "Pass 50, or leave it out.")


def rollout(
    basis: NormalizedRBFBasis,
    weights: Gaussian,
    phase: Floats,
    duration_s: float,
    noise_variance: Floats,
) -> Trajectory:
    """Trajectory of d DOFs at some phases of steady progress.

    Args:
        basis: the basis functions.
        weights: distribution of the weights, (d N,).
        phase: phases, (T,).
        duration_s: time from phase 0 to 1.
        noise_variance: residual variance per DOF, added to that from the weights, (d,).
    """
    design = basis.design_matrix(phase)
    n_dofs = len(weights.mean) // basis.n_basis
    per_dof = weights.mean.reshape(n_dofs, basis.n_basis)
    velocities = basis.derivative_matrix(phase) @ per_dof.T / duration_s
    variance = dof_variance(design, weights.covariance) + noise_variance
    return Trajectory(phase * duration_s, design @ per_dof.T, velocities, np.sqrt(variance))


def dof_variance(design: Floats, covariance: Floats) -> Floats:
    """Variance (..., T, d) of DOFs at a design (..., T, N) for a covariance (..., d N, d N)."""
    n_dofs = covariance.shape[-1] // design.shape[-1]
    blocks = covariance.reshape(*covariance.shape[:-2], *2 * (n_dofs, design.shape[-1]))
    own = np.einsum("...dkdl->...dkl", blocks)
    return np.einsum("...dtk,...tk->...td", design[..., None, :, :] @ own, design)
