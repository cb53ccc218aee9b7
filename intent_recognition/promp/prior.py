# SPDX-License-Identifier: Apache-2.0
"""The covariance of few weight vectors, regularised on purpose.

With D demonstrations the sample covariance (Maeda et al. 2014, Eq. 5) has rank D - 1 at most, while
the weights have (P + Q) N = 100 to 250 elements. It is shrunk toward a target whose structure says
what demonstrations of one task have in common: each DOF is displaced as a whole (the person stands
elsewhere), and deforms smoothly along the phase. Both are pooled over all tasks:

    target = A (x) 1 1^T + B (x) C,   A, B: (P+Q, P+Q) over DOFs,  C: (N, N) over basis functions.

`strength` is the target's worth in demonstrations, as in an inverse-Wishart prior. It is chosen by
leave-one-out prediction (`selection.py`), never by hand.
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.gaussian.linalg import symmetrize

FLOOR_OF_RANGE = 1e-3
"""Smallest standard deviation of a weight, in parts of its DOF's range over all demonstrations.

It keeps the covariance positive definite when demonstrations are identical or very few.
"""


class StructuredTarget(NamedTuple):
    """The three factors of the target covariance and its floor.

    Attributes:
        offset: covariance of whole-trajectory displacements, A, (D, D).
        shape: covariance of deformations over DOFs, B, (D, D).
        basis: correlation of deformations over basis functions, C, (N, N).
        floor: variance added to every weight of a DOF, (D,).
    """

    offset: np.ndarray
    shape: np.ndarray
    basis: np.ndarray
    floor: np.ndarray

    def covariance(self) -> np.ndarray:
        """The target as one matrix, (D N, D N), weights grouped by DOF."""
        n_basis = len(self.basis)
        return (
            np.kron(self.offset, np.ones((n_basis, n_basis)))
            + np.kron(self.shape, self.basis)
            + np.diag(np.repeat(self.floor, n_basis))
        )


def weight_floor(weights: np.ndarray) -> np.ndarray:
    """Variance floor per DOF from the range of its weights over all demonstrations, (D,).

    Args:
        weights: (n, D, N).
    """
    extent = np.ptp(np.moveaxis(weights, 1, 0).reshape(weights.shape[1], -1), axis=1)
    return (FLOOR_OF_RANGE * np.where(extent > 0, extent, 1.0)) ** 2


def structured_target(
    deviations: np.ndarray, degrees_of_freedom: int, floor: np.ndarray
) -> StructuredTarget:
    """Fit the target's factors to deviations from the tasks' means.

    Args:
        deviations: (n, D, N) weights less the mean of their task.
        degrees_of_freedom: n less the number of means that were subtracted, at least 1.
        floor: variance floor per DOF, (D,).
    """
    n_dofs, n_basis = deviations.shape[1:]
    displacement = deviations.mean(axis=2)
    offset = displacement.T @ displacement / degrees_of_freedom
    rest = deviations - displacement[:, :, None]
    shape = np.einsum("idk,iek->de", rest, rest) / (degrees_of_freedom * n_basis)
    scaled = rest / np.sqrt(np.diag(shape) + floor)[None, :, None]
    basis = np.einsum("idk,idl->kl", scaled, scaled) / (degrees_of_freedom * n_dofs)
    return StructuredTarget(symmetrize(offset), symmetrize(shape), symmetrize(basis), floor)


def shrunk_covariance(scatter: np.ndarray, n: int, target: np.ndarray, strength: float) -> np.ndarray:
    """Predictive covariance of one more weight vector of a task, (..., d, d).

    (scatter + strength * target) / (n - 1 + strength), times 1 + 1/n for the uncertain mean.

    Args:
        scatter: sum of outer products of the deviations from the mean, (..., d, d).
        n: number of demonstrations behind it, at least 1.
        target: (d, d).
        strength: the target's worth in demonstrations, positive.
    """
    return (scatter + strength * target) * ((1.0 + 1.0 / n) / (n - 1.0 + strength))
