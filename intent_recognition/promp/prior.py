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

from typing import NamedTuple

import numpy as np

from intent_recognition.gaussian.linalg import symmetrize

FLOOR_OF_RANGE = 1e-3
"""Smallest standard deviation of a weight, in parts of its DOF's range over all demonstrations.

It keeps the covariance positive definite when demonstrations are identical or very few.
"""

OTHERS_WORTH = 5.0
"""Demonstrations that all other tasks together are worth in a task's target."""
PHASE_WIDTH = 0.15
"""How far in phase the correlation over DOFs is averaged."""
AMPLITUDE_WORTH = 4.0
"""Demonstrations' worth of the assumption that a DOF varies alike at all phases."""


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
        n_basis = len(self.basis)
        values, vectors = np.linalg.eigh(self.dofs)
        root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        gram = np.einsum("kdr,ler->dkel", root, root)
        gram *= self.basis[None, :, None, :]
        size = self.amplitude.size
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
    phase = np.linspace(0.0, 1.0, n_basis)
    kernel = np.exp(-0.5 * ((phase[:, None] - phase) / PHASE_WIDTH) ** 2)
    kernel /= kernel.sum(axis=1, keepdims=True)
    local = np.einsum("idk,iek->kde", scaled, scaled)
    dofs = np.einsum("kl,lde->kde", kernel, local)
    own = np.sqrt(np.einsum("kdd->kd", dofs) + FLOOR_OF_RANGE**2)
    dofs /= own[:, :, None] * own[:, None, :]
    basis = np.einsum("idk,idl->kl", scaled, scaled) / n_dofs
    spread = np.sqrt(np.diag(basis) + FLOOR_OF_RANGE**2)
    basis /= np.outer(spread, spread)
    return StructuredTarget(amplitude, symmetrize(dofs), symmetrize(basis), floor)


def leave_one_out_targets(
    deviations: np.ndarray, tasks: np.ndarray, task: int, floor: np.ndarray
) -> np.ndarray:
    """The task's target covariance without each of its demonstrations in turn, (n_task, d, d).

    Where nothing would be left to estimate it from (two demonstrations in all), it is the same
    target for each; a task of one demonstration has none. Arguments as of `structured_target`.
    """
    own = np.flatnonzero(tasks == task)
    size = deviations.shape[1] * deviations.shape[2]
    if len(own) < 2:
        return np.zeros((0, size, size))
    count = np.bincount(tasks)
    count[task] -= 1
    if np.max(count) < 2:
        target = structured_target(deviations, tasks, task, floor).covariance()
        return np.repeat(target[None], len(own), axis=0)
    targets = []
    for left_out in own:
        rest = np.delete(deviations, left_out, axis=0)
        rest_tasks = np.delete(tasks, left_out)
        mine = rest_tasks == task
        rest[mine] -= rest[mine].mean(axis=0)
        targets.append(structured_target(rest, rest_tasks, task, floor).covariance())
    return np.array(targets)


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
