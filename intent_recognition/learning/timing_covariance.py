# SPDX-License-Identifier: Apache-2.0
"""What a movement's place owes to being early or late.

A person who is ahead of steady progress by e, a share of the movement's duration, is where the
mean will be: mu(u + e) = mu(u) + e mu'(u), to first order. A hesitation can happen anywhere, but a
few demonstrations show only a few; their covariance takes one at another place for something that
no one does who is at this task. So the covariance that tasks are told apart by gets what the lead
of `progress.py` adds to it, its scale learned from the warps of the demonstrations (`timing.py`).

Half of each lead is added: what the demonstrations showed of it is in their covariance already.
And half of it is the task's own and half is all tasks' alike, as in that covariance (`prior.py`).
"""

from collections.abc import Sequence

import numpy as np

from intent_recognition.promp import OWN_COVARIANCE_SHARE, NormalizedRBFBasis, PhaseDeviation

UNSEEN = 0.5
"""Share of a lead that the demonstrations have not shown (docs/recognition.md)."""


def timing_covariance(
    basis: NormalizedRBFBasis, mean: np.ndarray, phase_deviation: PhaseDeviation
) -> np.ndarray:
    """Covariance of the weights that comes from deviations of timing alone, (P N, P N).

    Positive semidefinite, by the Schur product theorem.

    Args:
        basis: N basis functions.
        mean: mean weights, grouped by DOF, (P N,).
        phase_deviation: prior of the lead.
    """
    at_centers = basis.design_matrix(basis.centers)
    slope = basis.derivative_matrix(basis.centers) @ mean.reshape(-1, basis.n_basis).T
    weights, *_ = np.linalg.lstsq(at_centers, slope, rcond=None)
    even = np.linspace(0.0, 1.0, len(phase_deviation.deviation_std))
    deviation = (weights.T * np.interp(basis.centers, even, phase_deviation.deviation_std)).ravel()
    apart = np.abs(basis.centers[:, None] - basis.centers)
    lasting = np.exp(-apart / phase_deviation.correlation)
    n_dofs = len(mean) // basis.n_basis
    return np.outer(deviation, deviation) * np.tile(lasting, (n_dofs, n_dofs))


def mean_timing(
    basis: NormalizedRBFBasis, means: Sequence[np.ndarray], phase_deviation: PhaseDeviation
) -> np.ndarray:
    """The mean of `timing_covariance` over tasks of these mean weights, (P N, P N)."""
    return sum(timing_covariance(basis, mean, phase_deviation) for mean in means) / len(means)


def unseen_timing(own: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """What a task's covariance lacks, from its own `timing_covariance` and all tasks' mean."""
    return UNSEEN**2 * (OWN_COVARIANCE_SHARE * own + (1.0 - OWN_COVARIANCE_SHARE) * shared)
