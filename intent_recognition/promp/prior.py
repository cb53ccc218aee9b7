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

Where the controlled agent follows the observed one after a lag, R_k couples the observed DOFs at
phase k with the controlled ones at k + lag. A part of each observed weight's variance may be
independent of all others.

`strength` is the equivalent sample size of the target in demonstrations, as in an inverse-Wishart
prior. `learn` chooses it by leave-one-out prediction (`learning.selection`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import symmetrize
from intent_recognition.promp.ridge import ridge_slopes, with_slopes
from intent_recognition.signals import SPATIAL_UNITS

FLOOR_OF_RANGE = 1e-3
"""Smallest standard deviation of a weight, in parts of its DOF's range over all demonstrations.

Convention. It keeps the covariance positive definite when demonstrations are identical or very few.
"""

OTHERS_SAMPLE_SIZE = 5.0
"""Equivalent sample size of all other tasks together in a task's target, in demonstrations.

Convention.
"""
PHASE_WIDTH, OWN_PHASE_WIDTH = 0.15, 0.03
"""Width in phase over which the correlation over DOFs is averaged, and where nothing is borrowed
from other tasks. Convention; validation on held-out demonstrations chooses between the two
(docs/decisions/covariance_target.md)."""
LAGS = np.arange(0.0, 0.26, 0.01)
"""Lags of the controlled agent behind the observed one that are compared, in phase. Convention: up
to a quarter of a movement."""
FEW, SMOOTH_WIDTH = 3.5, 0.1
"""Equivalent sample size below which the scatter is much inflated, and width in phase of the
correlation that it is then mixed with (`structured_target`). Convention."""

OBSERVED_INDEPENDENT = 0.03
"""Independent part of the variance of the observed weights, in the covariance that all tasks share
(docs/decisions/covariance_target.md)."""


class TargetSettings(NamedTuple):
    """What a target assumes; validation on held-out demonstrations chooses it.

    Attributes:
        borrowed: equivalent sample size of all other tasks together, in demonstrations.
        independent: variance of each observed weight that no other shares, in parts of its DOF's:
            chance, which tells nothing of the controlled ones.
        lag: how much later in phase the controlled DOFs follow the observed ones, from 0 to below
            1.
        n_observed: number of observed DOFs, which come first; 0 where there are no others.
        ridge: variance of an observed weight that is chance, in parts of the square of its DOF's
            range, where slopes come from the demonstrations alone (`promp.ridge`); 0 where they
            come from the target, too.
        alike: part in which the DOFs vary alike, in parts of their ranges, and independently.
    """

    borrowed: float = OTHERS_SAMPLE_SIZE
    independent: float = 0.0
    lag: float = 0.0
    n_observed: int = 0
    ridge: float = 0.0
    alike: float = 0.0


USUAL = TargetSettings()
"""What is assumed where nothing was chosen."""


class Scatter(NamedTuple):
    """Sum of outer products of weights' deviations from the mean of their task."""

    matrix: Floats  # (D N, D N), weights grouped by DOF
    freedom: float  # demonstrations less means, and whatever else, taken from them


class StructuredTarget(NamedTuple):
    """The factors of the target covariance and its floor."""

    amplitude: Floats  # standard deviation of each weight, a, (D, N)
    # correlation over DOFs at each basis function, R, (N, D, D), the controlled ones a lag later
    dofs: Floats
    basis: Floats  # correlation along the basis functions, C, (N, N)
    floor: Floats  # variance added to every weight of a DOF, (D,)
    # takes all weights to their phases, those of controlled DOFs a lag back, (D N, D N); None
    # without a lag
    earlier: Floats | None = None

    def covariance(self) -> Floats:
        """The target as one matrix, (D N, D N), weights grouped by DOF."""
        n_basis, size = len(self.basis), self.amplitude.size
        values, vectors = np.linalg.eigh(self.dofs)
        root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        flat = np.swapaxes(root, 0, 1).reshape(size, -1)
        gram = (flat @ flat.T).reshape(-1, n_basis, size // n_basis, n_basis)
        gram *= self.basis[None, :, None, :]
        scale, correlation = self.amplitude.ravel(), gram.reshape(size, size)
        if self.earlier is not None:
            correlation = self.earlier @ correlation @ self.earlier.T
            scale = scale / np.sqrt(np.diag(correlation) + FLOOR_OF_RANGE**2)
        covariance = correlation * np.outer(scale, scale)
        return symmetrize(covariance) + np.diag(np.repeat(self.floor, n_basis))


def weight_extent(weights: Floats, units: Sequence[str] | None = None) -> Floats:
    """Range of the weights of each DOF over all demonstrations, (D,).

    Where there is none it is 1 m or rad; in another unit it is the widest of this unit's DOFs, and
    if none of them moves, the largest value among them.

    Args:
        weights: (n, D, N).
        units: of the DOFs, (D,); None for metres and radians.
    """
    of_dof = np.moveaxis(weights, 1, 0).reshape(weights.shape[1], -1)
    extent, size = np.ptp(of_dof, axis=1), np.abs(of_dof).max(axis=1)
    moves, least = extent > 1e-6 * size, np.ones(len(extent))  # rounding of the regression
    for unit in set(units or ()) - set(SPATIAL_UNITS):
        alike = np.array(units) == unit
        widest = np.max(extent[alike & moves], initial=0.0)
        least[alike] = widest or np.max(size[alike]) or 1.0
    return np.where(moves, extent, least)


def weight_floor(weights: Floats, units: Sequence[str] | None = None) -> Floats:
    """Variance floor per DOF from the range of its weights (`weight_extent`), (D,)."""
    return (FLOOR_OF_RANGE * weight_extent(weights, units)) ** 2


def structured_target(
    own: Scatter, pooled: Scatter, floor: Floats, assumed: TargetSettings = USUAL
) -> StructuredTarget:
    """Fit a task's target to the deviations of all demonstrations from their tasks' means.

    The task's own demonstrations count fully; all others together as many as are borrowed, or
    `OTHERS_SAMPLE_SIZE` if there are fewer than `FEW` of the task's own. With n demonstrations in
    all, amplitudes are inflated by sqrt(1 + i) and the correlation along the phase is mixed with i
    parts of a smooth one, i = (FEW / n)^6: next to nothing from n = 2 `FEW` on. Four
    demonstrations, beside the real ones, say that a DOF varies alike at all phases.

    Args:
        own: scatter of the task the target is for.
        pooled: sum over all tasks, this one included; some task has two demonstrations.
        floor: variance floor per DOF, (D,).
        assumed: what it borrows, and how the weights depend on each other.
    """
    borrowed = _borrowed(own, assumed)
    scatter, demonstrations = _borrow(own, pooled, borrowed)
    inflation = (FEW / max(demonstrations, 2.0)) ** 6
    variance = np.diag(scatter).reshape(len(floor), -1)
    weight = demonstrations / (demonstrations + 4.0)
    level = variance.mean(axis=1, keepdims=True)
    amplitude = np.sqrt(weight * variance + (1 - weight) * level + floor[:, None])
    scaled = scatter / np.outer(amplitude.ravel(), amplitude.ravel())
    width = PHASE_WIDTH if borrowed else OWN_PHASE_WIDTH
    dofs, earlier = _correlation_over_dofs(scaled, amplitude.shape, width, assumed)
    basis = _correlation_along_phase(scaled, amplitude.shape, inflation)
    amplitude = amplitude * np.sqrt(1.0 + inflation)
    alike, of_range = assumed.alike, np.sqrt(floor)[:, None]
    squares = (amplitude / of_range) ** 2
    amplitude = of_range * np.sqrt((1.0 - alike) * squares + alike * squares.mean(axis=0))
    observed = np.arange(len(floor)) < (assumed.n_observed or len(floor))
    floor = floor + assumed.independent * observed * np.mean(amplitude**2, axis=1)
    return StructuredTarget(amplitude, dofs, basis, floor, earlier)


def _correlation_over_dofs(
    scaled: Floats, shape: tuple[int, ...], width: float, assumed: TargetSettings
) -> tuple[Floats, Floats | None]:
    """R and what takes its lag back (`StructuredTarget`), of weights of one variance, (D, N)."""
    (n_dofs, n_basis), earlier = shape, None
    if assumed.lag:
        later = _moved(assumed.lag, assumed.n_observed, n_dofs, n_basis)
        scaled = later @ scaled @ later.T
        earlier = _moved(-assumed.lag, assumed.n_observed, n_dofs, n_basis)
    local = np.einsum("dkek->kde", scaled.reshape(*shape, *shape))
    dofs = np.einsum("kl,lde->kde", _averaging(n_basis, width, assumed.lag), local)
    scale = np.sqrt(np.einsum("kdd->kd", dofs) + FLOOR_OF_RANGE**2)
    dofs /= scale[:, :, None] * scale[:, None, :]
    return symmetrize((1.0 - assumed.alike) * dofs + assumed.alike * np.eye(n_dofs)), earlier


def _correlation_along_phase(scaled: Floats, shape: tuple[int, ...], inflation: float) -> Floats:
    """C of the same weights, mixed with so many parts of a smooth one."""
    n_dofs, n_basis = shape
    basis = np.einsum("dkdl->kl", scaled.reshape(*shape, *shape)) / n_dofs
    scale = np.sqrt(np.diag(basis) + FLOOR_OF_RANGE**2)
    phase = np.linspace(0.0, 1.0, n_basis)
    smooth = np.exp(-0.5 * ((phase[:, None] - phase) / SMOOTH_WIDTH) ** 2)
    return symmetrize((basis / np.outer(scale, scale) + inflation * smooth) / (1.0 + inflation))


def explained_by_lag(pooled: Scatter, n_observed: int, floor: Floats) -> Floats:
    """Share of the controlled DOFs' variance that the observed ones explain, after each of `LAGS`.

    By ridge regression on the observed DOFs a lag before, on average over the phases, (L,): few
    demonstrations explain little.

    Args:
        pooled: scatter of all demonstrations about the means of their tasks.
        n_observed: number of observed DOFs, which come first.
        floor: variance floor per DOF, (D,).
    """
    n_basis, found = len(pooled.matrix) // len(floor), []
    scatter = pooled.matrix.reshape(len(floor), n_basis, -1, n_basis)
    together, across = scatter[:n_observed, :, :n_observed], scatter[:n_observed, :, n_observed:]
    own = np.einsum("ckcl->ckl", scatter[n_observed:, :, n_observed:])
    least, ridge = pooled.freedom * floor, n_observed / pooled.freedom * np.eye(n_observed)
    for lag in LAGS:
        kernel, later = _averaging(n_basis, PHASE_WIDTH, lag), _later(lag, n_basis)
        seen = np.einsum("kl,olpl->kop", kernel, together)
        cross = np.einsum("kl,olcm,lm->koc", kernel, across, later, optimize=True)
        variance = kernel @ np.einsum("lm,cmn,ln->lc", later, own, later, optimize=True)
        scale = np.sqrt(np.einsum("koo->ko", seen) + least[:n_observed])
        cross /= scale[:, :, None] * np.sqrt(variance + least[n_observed:])[:, None]
        seen = seen / (scale[:, :, None] * scale[:, None]) + ridge
        found.append(np.mean(np.sum(cross * np.linalg.solve(seen, cross), axis=1)))
    return np.array(found, dtype=float)


def _averaging(n_basis: int, width: float, lag: float) -> Floats:
    """Averages over phases of a width, without those where a lag leads past the end, (N, N)."""
    phase = np.linspace(0.0, 1.0, n_basis)
    kernel = np.exp(-0.5 * ((phase[:, None] - phase) / width) ** 2) * (phase + lag <= 1.0 + 1e-9)
    return kernel / kernel.sum(axis=1, keepdims=True)


def _later(lag: float, n_basis: int) -> Floats:
    """Takes weights of a DOF a lag later in phase, interpolated linearly, (N, N)."""
    place = np.clip(np.arange(n_basis) + lag * (n_basis - 1), 0.0, n_basis - 1.0)
    apart = np.abs(place[:, None] - np.arange(n_basis))
    return np.asarray(np.maximum(1.0 - apart, 0.0), dtype=np.float64)


def _moved(lag: float, n_observed: int, n_dofs: int, n_basis: int) -> Floats:
    """Takes weights of controlled DOFs a lag later in phase, (D N, D N)."""
    moved: Floats = np.eye(n_dofs * n_basis)
    start = n_observed * n_basis
    moved[start:, start:] = np.kron(np.eye(n_dofs - n_observed), _later(lag, n_basis))
    return moved


def without_demonstration(
    pooled: Scatter, own: Scatter, deviation: Floats
) -> tuple[Scatter, Scatter]:
    """Scatter of a task, and of all tasks, without one demonstration.

    Args:
        pooled: of all tasks; at least two demonstrations beyond their means.
        own: of the n demonstrations of the task, at least two.
        deviation: of the demonstration's weights from the mean of all n, (d,).
    """
    part = np.zeros_like(own.matrix)  # nothing varies about the mean of one, not even rounding
    if own.freedom > 1:
        part = own.matrix - np.outer((own.freedom + 1) / own.freedom * deviation, deviation)
    rest = pooled.matrix - (own.matrix - part)
    return Scatter(part, own.freedom - 1), Scatter(rest, pooled.freedom - 1)


def shared_covariance(
    pooled: Scatter, floor: Floats, strength: float, alike: float = 0.0
) -> Floats:
    """Covariance that all tasks share, (d, d).

    Differences between covariances of few demonstrations are mostly due to chance and would tell
    tasks apart wrongly (linear discriminant analysis; Friedman 1989).

    Args:
        pooled: scatter of all demonstrations about the means of their tasks.
        floor: variance floor per DOF, (D,).
        strength: equivalent sample size of the target, in demonstrations.
        alike: as in `TargetSettings`.
    """
    assumed = TargetSettings(independent=OBSERVED_INDEPENDENT, alike=alike)
    target = structured_target(pooled, pooled, floor, assumed).covariance()
    return (pooled.matrix + strength * target) / (pooled.freedom + strength)


def observed_block(scatter: Scatter, size: int) -> Scatter:
    """The scatter of the first `size` weights."""
    return Scatter(scatter.matrix[:size, :size], scatter.freedom)


def _borrowed(own: Scatter, assumed: TargetSettings) -> float:
    """What a task borrows of the others, if they have as much, in demonstrations."""
    return OTHERS_SAMPLE_SIZE if own.freedom < FEW else assumed.borrowed


def _borrow(own: Scatter, pooled: Scatter, borrowed: float) -> tuple[Floats, float]:
    """A task's covariance from unbiased ones of its own and all, and its equivalent sample size."""
    others = float(pooled.freedom - own.freedom)
    borrowed = min(borrowed, others)
    share = borrowed / others if others else 0.0
    size = own.freedom + borrowed
    return ((1.0 - share) * own.matrix + share * pooled.matrix) / size, size


def predictive_covariance(
    own: Scatter,
    pooled: Scatter,
    n: int,
    floor: Floats,
    strength: float,
    assumed: TargetSettings = USUAL,
) -> Floats:
    """Covariance of one more weight vector of a task, (D N, D N).

    (scatter + strength * target) / (freedom + strength), times 1 + 1/n for the uncertain mean.
    With a ridge the controlled weights follow the observed ones by its slopes instead, and what
    these leave unexplained has a covariance that is estimated like that of all.

    Args:
        own: scatter of the task.
        pooled: sum over all tasks, this one included.
        n: demonstrations behind the mean, at least 1.
        floor: variance floor per DOF, (D,).
        strength: equivalent sample size of the target, in demonstrations, positive.
        assumed: by the target.
    """
    target = structured_target(own, pooled, floor, assumed).covariance()
    covariance = (own.matrix + strength * target) * ((1.0 + 1.0 / n) / (own.freedom + strength))
    if not assumed.ridge:
        return symmetrize(covariance)
    scatter, demonstrations = _borrow(own, pooled, _borrowed(own, assumed))
    n_observed, n_basis = assumed.n_observed, len(scatter) // len(floor)
    chance = np.repeat(assumed.ridge * floor[:n_observed] / FLOOR_OF_RANGE**2, n_basis)
    slopes, spent = ridge_slopes(scatter, chance, demonstrations)
    unexplained = np.hstack([-slopes, np.eye(len(slopes))])

    def left(one: Scatter) -> Scatter:
        return Scatter(unexplained @ one.matrix @ unexplained.T, (1.0 - spent) * one.freedom)

    simple = TargetSettings(assumed.borrowed)
    certain = predictive_covariance(
        left(own), left(pooled), n, floor[n_observed:], strength, simple
    )
    return with_slopes(covariance[: len(chance), : len(chance)], slopes, certain)
