# SPDX-License-Identifier: Apache-2.0
"""The covariance of few weight vectors, regularised on purpose.

With D demonstrations the sample covariance (Maeda et al. 2014, Eq. 5) has rank D - 1 at most, while
the weights have (P + Q) N = 100 to 250 elements. It is shrunk toward a target whose structure says
what demonstrations of one task have in common: at each phase the DOFs of both agents deviate
together in one way, and deviations last along the phase in one way for all DOFs. Between weight k
of DOF d and weight l of DOF e the target's covariance is

    a_dk a_el C_kl (F_k F_l^T)_de,   F_k F_k^T = R_k,

with a the amplitudes, R_k (D, D) the correlation over DOFs near phase k and C (N, N) the
correlation along the phase. It is positive semidefinite by the Schur product theorem, and the
coupling of the agents at one phase is not diluted by other phases, as it is in a Kronecker product.

`strength` is the target's worth in demonstrations, as in an inverse-Wishart prior. It is chosen by
leave-one-out prediction (`selection.py`), never by hand.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.gaussian import symmetrize

FLOOR_OF_RANGE = 1e-3
"""Smallest standard deviation of a weight, in parts of its DOF's range over all demonstrations.

It keeps the covariance positive definite when demonstrations are identical or very few.
"""

OTHERS_SAMPLE_SIZE = 5.0
"""Demonstrations that all other tasks together are worth in a task's target."""
PHASE_WIDTH = 0.15
"""How far in phase the correlation over DOFs is averaged."""
OWN_COVARIANCE_SHARE = 0.5
"""Share of a task's own covariance in the one it is recognised by (docs/prediction.md)."""
AMPLITUDE_SAMPLE_SIZE = 4.0
"""Demonstrations' worth of the assumption that a DOF varies alike at all phases."""
FEW = 3.5
"""Demonstrations below which their scatter tells little, neither how much varies nor how long."""
DEVIATION_WIDTH = 0.1
"""How long in phase deviations are taken to last then."""


class Scatter(NamedTuple):
    """Sum of outer products of weights' deviations from the mean of their task.

    Attributes:
        matrix: (D N, D N), weights grouped by DOF.
        freedom: demonstrations less means taken from them.
    """

    matrix: np.ndarray
    freedom: int


class StructuredTarget(NamedTuple):
    """The factors of the target covariance and its floor.

    Attributes:
        amplitude: standard deviation of each weight, a, (D, N).
        dofs: correlation over DOFs at each basis function, R, (N, D, D).
        basis: correlation along the basis functions, C, (N, N).
        floor: variance added to every weight of a DOF, (D,).
    """

    amplitude: np.ndarray
    dofs: np.ndarray
    basis: np.ndarray
    floor: np.ndarray

    def covariance(self) -> np.ndarray:
        """The target as one matrix, (D N, D N), weights grouped by DOF."""
        n_basis, size = len(self.basis), self.amplitude.size
        values, vectors = np.linalg.eigh(self.dofs)
        root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        flat = np.swapaxes(root, 0, 1).reshape(size, -1)
        gram = (flat @ flat.T).reshape(-1, n_basis, size // n_basis, n_basis)
        gram *= self.basis[None, :, None, :]
        scale = self.amplitude.ravel()
        covariance = gram.reshape(size, size) * np.outer(scale, scale)
        return symmetrize(covariance) + np.diag(np.repeat(self.floor, n_basis))


def weight_extent(weights: np.ndarray) -> np.ndarray:
    """Range of the weights of each DOF over all demonstrations, 1 where there is none, (D,).

    Args:
        weights: (n, D, N).
    """
    extent = np.ptp(np.moveaxis(weights, 1, 0).reshape(weights.shape[1], -1), axis=1)
    return np.where(extent > 0, extent, 1.0)


def weight_floor(weights: np.ndarray) -> np.ndarray:
    """Variance floor per DOF from the range of its weights (n, D, N), (D,)."""
    return (FLOOR_OF_RANGE * weight_extent(weights)) ** 2


def structured_target(own: Scatter, pooled: Scatter, floor: np.ndarray) -> StructuredTarget:
    """Fit a task's target to the deviations of all demonstrations from their tasks' means.

    The task's own demonstrations count fully; all others together count `OTHERS_SAMPLE_SIZE`.
    Where they are fewer than `FEW` in all, deviations are taken to be larger than was seen, and
    smooth.

    Args:
        own: scatter of the task the target is for.
        pooled: sum over all tasks, this one included; some task has two demonstrations.
        floor: variance floor per DOF, (D,).
    """
    scatter, demonstrations = _borrow(own, pooled)
    n_dofs = len(floor)
    variance = np.diag(scatter).reshape(n_dofs, -1)
    typical = variance.mean(axis=1, keepdims=True)
    weight = demonstrations / (demonstrations + AMPLITUDE_SAMPLE_SIZE)
    doubt = (FEW / max(demonstrations, 2.0)) ** 6
    amplitude = np.sqrt(weight * variance + (1 - weight) * typical + floor[:, None])
    n_basis = amplitude.shape[1]
    scale = amplitude.ravel()
    scaled = (scatter / np.outer(scale, scale)).reshape(n_dofs, n_basis, n_dofs, n_basis)
    phase = np.linspace(0.0, 1.0, n_basis)
    distance = phase[:, None] - phase
    kernel = np.exp(-0.5 * (distance / PHASE_WIDTH) ** 2)
    kernel /= kernel.sum(axis=1, keepdims=True)
    local = np.einsum("dkek->kde", scaled)
    dofs = np.einsum("kl,lde->kde", kernel, local)
    spread = np.sqrt(np.einsum("kdd->kd", dofs) + FLOOR_OF_RANGE**2)
    dofs /= spread[:, :, None] * spread[:, None, :]
    basis = np.einsum("dkdl->kl", scaled) / n_dofs
    spread = np.sqrt(np.diag(basis) + FLOOR_OF_RANGE**2)
    basis /= np.outer(spread, spread)
    smooth = np.exp(-0.5 * (distance / DEVIATION_WIDTH) ** 2)
    basis = (basis + doubt * smooth) / (1.0 + doubt)
    amplitude = amplitude * np.sqrt(1.0 + doubt)
    return StructuredTarget(amplitude, symmetrize(dofs), symmetrize(basis), floor)


def leave_one_out_targets(
    own: Scatter, pooled: Scatter, deviations: np.ndarray, floor: np.ndarray
) -> np.ndarray:
    """The task's target covariance without each of some demonstrations in turn, (m, d, d).

    Where nothing would be left to estimate it from (two demonstrations in all), it is the same
    target for each; a task of one demonstration has none.

    Args:
        own: scatter of the task.
        pooled: sum over all tasks, this one included.
        deviations: of those left out from the mean of the task, them included, (m, D, N).
        floor: variance floor per DOF, (D,).
    """
    size = own.matrix.shape[0]
    if own.freedom < 1:
        return np.zeros((0, size, size))
    if pooled.freedom < 2:
        target = structured_target(own, pooled, floor).covariance()
        return np.repeat(target[None], len(deviations), axis=0)
    targets = []
    for deviation in deviations:
        part = leave_one_out_scatter(own, deviation.ravel())
        rest = Scatter(pooled.matrix - (own.matrix - part), pooled.freedom - 1)
        target = structured_target(Scatter(part, own.freedom - 1), rest, floor)
        targets.append(target.covariance())
    return np.array(targets)


def leave_one_out_scatter(own: Scatter, deviations: np.ndarray) -> np.ndarray:
    """Scatter without one demonstration, for each of those given, (..., d, d).

    Args:
        own: of all n demonstrations of the task, at least two.
        deviations: of those left out from the mean of all n, (..., d).
    """
    if own.freedom == 1:  # nothing varies about the mean of one; no rounding is left either
        return np.zeros((*deviations.shape[:-1], *own.matrix.shape))
    factor = (own.freedom + 1) / own.freedom
    return own.matrix - factor * deviations[..., :, None] * deviations[..., None, :]


def recognition_covariances(
    own: Sequence[Scatter], pooled: Scatter, floor: np.ndarray, strength: float
) -> np.ndarray:
    """Covariances that tasks are told apart by, (K, d, d): half their own, half all tasks' alike.

    Differences between covariances of few demonstrations are chance for the most part, and what is
    chance tells tasks apart wrongly (regularised discriminant analysis, Friedman 1989).

    Args:
        own: scatter of each task.
        pooled: their sum, some of two demonstrations.
        floor: variance floor per DOF, (D,).
        strength: the targets' worth in demonstrations.
    """
    target = structured_target(pooled, pooled, floor).covariance()
    shared = (pooled.matrix + strength * target) / (pooled.freedom + strength)
    covariances = []
    for scatter in own:
        n = scatter.freedom + 1
        target = structured_target(scatter, pooled, floor).covariance()
        mine = shrunk_covariance(scatter.matrix, n, target, strength)
        covariances.append(
            OWN_COVARIANCE_SHARE * mine + (1.0 - OWN_COVARIANCE_SHARE) * (1.0 + 1.0 / n) * shared
        )
    return np.array(covariances)


def observed_block(scatter: Scatter, size: int) -> Scatter:
    """The scatter of the first `size` weights."""
    return Scatter(scatter.matrix[:size, :size], scatter.freedom)


def _borrow(own: Scatter, pooled: Scatter) -> tuple[np.ndarray, float]:
    """Covariance of a task from its own and all demonstrations, and how many it is worth.

    Each task's outer products are divided by its degrees of freedom, so that they estimate a
    covariance without bias; these estimates are averaged by the demonstrations they are worth.
    """
    others = float(pooled.freedom - own.freedom)
    borrowed = min(OTHERS_SAMPLE_SIZE, others)
    share = borrowed / others if others else 0.0
    worth = own.freedom + borrowed
    return ((1.0 - share) * own.matrix + share * pooled.matrix) / worth, worth


def shrunk_covariance(
    scatter: np.ndarray, n: int, target: np.ndarray, strength: float
) -> np.ndarray:
    """Predictive covariance of one more weight vector of a task, (..., d, d).

    (scatter + strength * target) / (n - 1 + strength), times 1 + 1/n for the uncertain mean.

    Args:
        scatter: sum of outer products of the deviations from the mean, (..., d, d).
        n: number of demonstrations behind it, at least 1.
        target: (d, d).
        strength: the target's worth in demonstrations, positive.
    """
    return (scatter + strength * target) * ((1.0 + 1.0 / n) / (n - 1.0 + strength))
