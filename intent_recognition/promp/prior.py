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

OTHERS_WORTH = 5.0
"""Demonstrations that all other tasks together are worth in a task's target."""
AMPLITUDE_WORTH = 4.0
"""Demonstrations' worth of the assumption that a DOF varies alike at all phases."""


class StructuredTarget(NamedTuple):
    """The factors of the target covariance and its floor.

    Attributes:
        amplitude: standard deviation of each weight, (D, N).
        offset: correlation of whole-trajectory displacements over DOFs, A, (D, D).
        shape: correlation of deformations over DOFs, B, (D, D).
        basis: correlation of deformations over basis functions, C, (N, N).
        floor: variance added to every weight of a DOF, (D,).
    """

    amplitude: np.ndarray
    offset: np.ndarray
    shape: np.ndarray
    basis: np.ndarray
    floor: np.ndarray

    def covariance(self) -> np.ndarray:
        """The target as one matrix, (D N, D N), weights grouped by DOF."""
        n_basis = len(self.basis)
        scale = self.amplitude.ravel()
        correlation = np.kron(self.offset, np.ones((n_basis, n_basis)))
        correlation += np.kron(self.shape, self.basis)
        return correlation * np.outer(scale, scale) + np.diag(np.repeat(self.floor, n_basis))


def weight_floor(weights: np.ndarray) -> np.ndarray:
    """Variance floor per DOF from the range of its weights over all demonstrations, (D,).

    Args:
        weights: (n, D, N).
    """
    extent = np.ptp(np.moveaxis(weights, 1, 0).reshape(weights.shape[1], -1), axis=1)
    return (FLOOR_OF_RANGE * np.where(extent > 0, extent, 1.0)) ** 2


def structured_target(
    deviations: np.ndarray, tasks: np.ndarray, task: int, floor: np.ndarray
) -> StructuredTarget:
    """Fit a task's target to the deviations of all demonstrations from their tasks' means.

    The task's own demonstrations count fully; all others together count `OTHERS_WORTH`.

    Args:
        deviations: (n, D, N) weights less the mean of their task.
        tasks: number of each demonstration's task, (n,).
        task: which task the target is for.
        floor: variance floor per DOF, (D,).
    """
    n_dofs, n_basis = deviations.shape[1:]
    worth = _worth(tasks, task)
    scaled = deviations * np.sqrt(worth)[:, None, None]
    variance = np.sum(scaled**2, axis=0)
    typical = variance.mean(axis=1, keepdims=True)
    demonstrations = 1.0 / np.max(worth)
    weight = demonstrations / (demonstrations + AMPLITUDE_WORTH)
    amplitude = np.sqrt(weight * variance + (1 - weight) * typical + floor[:, None])
    scaled = scaled / amplitude
    displacement = scaled.mean(axis=2)
    rest = scaled - displacement[:, :, None]
    shape = np.einsum("idk,iek->de", rest, rest) / n_basis
    unit = rest / np.sqrt(np.diag(shape) + FLOOR_OF_RANGE**2)[None, :, None]
    basis = np.einsum("idk,idl->kl", unit, unit) / n_dofs
    return StructuredTarget(
        amplitude, displacement.T @ displacement, symmetrize(shape), symmetrize(basis), floor
    )


def _worth(tasks: np.ndarray, task: int) -> np.ndarray:
    """Weight of each demonstration's outer product in a task's covariance, (n,).

    Each task's outer products are divided by its degrees of freedom, so that they estimate a
    covariance without bias; these estimates are averaged by the demonstrations they are worth.
    """
    count = np.bincount(tasks)
    own = float(count[task] - 1)
    others = float(np.sum(count - 1)) - own
    borrowed = min(OTHERS_WORTH, others)
    per_task = np.where(np.arange(len(count)) == task, 1.0, borrowed / others if others else 0.0)
    return per_task[tasks] / (own + borrowed)


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
