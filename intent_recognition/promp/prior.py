# SPDX-License-Identifier: Apache-2.0
"""Regularised covariance of few weight vectors.

The sample covariance of n demonstrations (Maeda et al. 2014, Eq. 5) has rank n - 1 at most, while
the weights have (P + Q) N = 100 to 250 elements. It is shrunk toward a structured target, which
assumes a correlation between the DOFs of both agents at each phase, and one correlation along the
phase for all DOFs. The target's covariance between weight k of DOF d and weight l of DOF e is

    a_dk a_el C_kl (F_k F_l^T)_de,   F_k F_k^T = R_k,

with a the amplitudes, R_k (D, D) the correlation over DOFs near phase k and C (N, N) the
correlation along the phase. It is positive semidefinite by the Schur product theorem. Unlike in a
Kronecker product, the coupling of the agents at one phase is not diluted by other phases.

If the controlled agent follows the observed one after a lag, R_k couples the observed DOFs at phase
k with the controlled ones at k + lag. A part of each observed weight's variance may be independent
of all others.

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
"""Smallest standard deviation of a weight, relative to its DOF's range over all demonstrations. It
keeps the covariance positive definite when demonstrations are identical or very few."""

OTHERS_SAMPLE_SIZE = 5.0
"""Equivalent sample size of all other tasks together in a task's target, in demonstrations."""
PHASE_WIDTH, OWN_PHASE_WIDTH = 0.15, 0.03
"""Widths in phase over which the correlation over DOFs is averaged, with and without borrowing from
other tasks; held-out validation chooses (docs/decisions/covariance_target.md)."""
LAGS = np.arange(0.0, 0.26, 0.01)
"""Candidate lags of the controlled agent behind the observed one, in phase: up to a quarter of a
movement."""
FEW, SMOOTH_WIDTH, SLOW_WIDTH = 3.5, 0.1, 0.5
"""Equivalent sample size below which the scatter is much inflated, and the widths in phase of the
correlation that is then mixed in: of demonstrations, and between people (`structured_target`)."""

OBSERVED_INDEPENDENT = 0.03
"""Independent part of the observed weights' variance in the covariance that all tasks share
(docs/decisions/covariance_target.md)."""


class TargetSettings(NamedTuple):
    """Assumptions of a target; held-out validation chooses them.

    Attributes:
        borrowed: equivalent sample size of all other tasks together, in demonstrations.
        independent: independent variance of each observed weight, relative to that of its DOF: it
            is random and does not predict the controlled weights.
        lag: lag in phase of the controlled DOFs behind the observed ones, in [0, 1).
        n_observed: number of observed DOFs, which come first; 0 if all DOFs are observed.
        ridge: random variance of an observed weight, relative to its DOF's squared range, in a
            ridge regression on demonstrations alone (`promp.ridge`); 0 takes the slopes of the
            shrunk covariance.
        alike: share, in [0, 1], of a target in which all DOFs vary alike relative to their ranges,
            and independently of each other.
        slow: inflation i of few people, who differ slowly along the phase (`structured_target`).
    """

    borrowed: float = OTHERS_SAMPLE_SIZE
    independent: float = 0.0
    lag: float = 0.0
    n_observed: int = 0
    ridge: float = 0.0
    alike: float = 0.0
    slow: float = 0.0


USUAL = TargetSettings()
"""Default assumptions of a target."""


class Scatter(NamedTuple):
    """Sum of outer products of the weights' deviations from the means of their tasks."""

    matrix: Floats  # (D N, D N), weights grouped by DOF
    freedom: float  # demonstrations less estimated means and other estimated parameters


def weight_extent(weights: Floats, units: Sequence[str] | None = None) -> Floats:
    """Range of the weights of each DOF over all demonstrations, (D,).

    A DOF that does not move has a range of 1 m or 1 rad. In other units it has the widest range of
    the DOFs of its unit or, if none of these moves, their largest absolute value.

    Args:
        weights: weights of n demonstrations, (n, D, N).
        units: units of the DOFs, (D,); None for metres and radians.
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
) -> Floats:
    """Target covariance of a task, fitted to the deviations of all demonstrations, (D N, D N).

    The task's own demonstrations count fully. All others together count as `assumed.borrowed`
    demonstrations, or as `OTHERS_SAMPLE_SIZE` if the task has fewer than `FEW` degrees of freedom.
    With n in total, amplitudes are inflated by sqrt(1 + i), i = (FEW / n)^6, and the correlation
    along the phase is mixed with i parts of a smooth one: negligible from n = 2 `FEW` on. Variances
    are shrunk toward the mean over their DOF's weights, with the strength of four demonstrations.

    Args:
        own: scatter of the task.
        pooled: scatter of all tasks, this one included; some task has two demonstrations.
        floor: variance floor per DOF, (D,).
        assumed: assumptions of the target.
    """
    borrowed = _borrowed(own, assumed)
    scatter, demonstrations = _borrow(own, pooled, borrowed)
    inflation = assumed.slow or (FEW / max(demonstrations, 2.0)) ** 6
    variance = np.diag(scatter).reshape(len(floor), -1)
    weight = demonstrations / (demonstrations + 4.0)
    level = variance.mean(axis=1, keepdims=True)
    amplitude = np.sqrt(weight * variance + (1 - weight) * level + floor[:, None])
    scaled = scatter / np.outer(amplitude.ravel(), amplitude.ravel())
    width = PHASE_WIDTH if borrowed else OWN_PHASE_WIDTH
    dofs, earlier = _correlation_over_dofs(scaled, amplitude.shape, width, assumed)
    smooth = SLOW_WIDTH if assumed.slow else SMOOTH_WIDTH
    basis = _correlation_along_phase(scaled, amplitude.shape, inflation, smooth)
    amplitude = amplitude * np.sqrt(1.0 + inflation)
    alike, of_range = assumed.alike, np.sqrt(floor)[:, None]
    squares = (amplitude / of_range) ** 2
    amplitude = of_range * np.sqrt((1.0 - alike) * squares + alike * squares.mean(axis=0))
    observed = np.arange(len(floor)) < (assumed.n_observed or len(floor))
    floor = floor + assumed.independent * observed * np.mean(amplitude**2, axis=1)
    correlation, scale = _joined(dofs, basis), amplitude.ravel()
    if earlier is not None:
        correlation = earlier @ correlation @ earlier.T
        scale = scale / np.sqrt(np.diag(correlation) + FLOOR_OF_RANGE**2)
    covariance = correlation * np.outer(scale, scale)
    return symmetrize(covariance) + np.diag(np.repeat(floor, len(basis)))


def _joined(dofs: Floats, basis: Floats) -> Floats:
    """C_kl (F_k F_l^T)_de from R (N, D, D) and C (N, N), (D N, D N)."""
    n_basis, n_dofs, _ = dofs.shape
    values, vectors = np.linalg.eigh(dofs)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    flat = np.swapaxes(root, 0, 1).reshape(n_dofs * n_basis, -1)
    gram = (flat @ flat.T).reshape(n_dofs, n_basis, n_dofs, n_basis)
    gram *= basis[None, :, None, :]
    return gram.reshape(len(flat), -1)


def _correlation_over_dofs(
    scaled: Floats, shape: tuple[int, ...], width: float, assumed: TargetSettings
) -> tuple[Floats, Floats | None]:
    """R, of controlled DOFs a lag later, and the matrix that undoes this lag; None without one."""
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


def _correlation_along_phase(
    scaled: Floats, shape: tuple[int, ...], inflation: float, width: float
) -> Floats:
    """C from a scaled scatter, with `inflation` parts of a correlation of that width mixed in."""
    n_dofs, n_basis = shape
    basis = np.einsum("dkdl->kl", scaled.reshape(*shape, *shape)) / n_dofs
    scale = np.sqrt(np.diag(basis) + FLOOR_OF_RANGE**2)
    phase = np.linspace(0.0, 1.0, n_basis)
    smooth = np.exp(-0.5 * ((phase[:, None] - phase) / width) ** 2)
    return symmetrize((basis / np.outer(scale, scale) + inflation * smooth) / (1.0 + inflation))


def explained_by_lag(pooled: Scatter, n_observed: int, floor: Floats) -> Floats:
    """Share of the controlled DOFs' variance that the observed ones explain, by lag, (len(LAGS),).

    It is the mean over the phases of ridge regressions on the observed DOFs a lag before. The
    penalty grows as demonstrations become fewer.

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
    """Weights of Gaussian averages over phases, except phases that the lag takes past 1, (N, N)."""
    phase = np.linspace(0.0, 1.0, n_basis)
    kernel = np.exp(-0.5 * ((phase[:, None] - phase) / width) ** 2) * (phase + lag <= 1.0 + 1e-9)
    return kernel / kernel.sum(axis=1, keepdims=True)


def _later(lag: float, n_basis: int) -> Floats:
    """Matrix that takes a DOF's weights a lag later in phase, by linear interpolation, (N, N)."""
    place = np.clip(np.arange(n_basis) + lag * (n_basis - 1), 0.0, n_basis - 1.0)
    apart = np.abs(place[:, None] - np.arange(n_basis))
    return np.asarray(np.maximum(1.0 - apart, 0.0), dtype=np.float64)


def _moved(lag: float, n_observed: int, n_dofs: int, n_basis: int) -> Floats:
    """Matrix that takes the weights of controlled DOFs a lag later in phase, (D N, D N)."""
    moved: Floats = np.eye(n_dofs * n_basis)
    start = n_observed * n_basis
    moved[start:, start:] = np.kron(np.eye(n_dofs - n_observed), _later(lag, n_basis))
    return moved


def without_demonstration(
    pooled: Scatter, own: Scatter, deviation: Floats
) -> tuple[Scatter, Scatter]:
    """Scatter of a task, and of all tasks, without one demonstration.

    Args:
        pooled: scatter of all tasks, with at least two degrees of freedom.
        own: scatter of the n demonstrations of the task, at least two.
        deviation: deviation of the demonstration's weights from the mean of all n, (d,).
    """
    part = np.zeros_like(own.matrix)  # exactly zero for one demonstration, without rounding
    if own.freedom > 1:
        part = own.matrix - np.outer((own.freedom + 1) / own.freedom * deviation, deviation)
    rest = pooled.matrix - (own.matrix - part)
    return Scatter(part, own.freedom - 1), Scatter(rest, pooled.freedom - 1)


def shared_covariance(
    pooled: Scatter, floor: Floats, strength: float, alike: float = 0.0, slow: float = 0.0
) -> Floats:
    """Covariance that all tasks share, (d, d).

    Differences between covariances of few demonstrations are mostly random and would distort the
    evidence between tasks (linear discriminant analysis; Friedman 1989).

    Args:
        pooled: scatter of all demonstrations about the means of their tasks.
        floor: variance floor per DOF, (D,).
        strength: equivalent sample size of the target, in demonstrations.
        alike: as in `TargetSettings`.
        slow: as in `TargetSettings`.
    """
    assumed = TargetSettings(independent=OBSERVED_INDEPENDENT, alike=alike, slow=slow)
    target = structured_target(pooled, pooled, floor, assumed)
    return (pooled.matrix + strength * target) / (pooled.freedom + strength)


def observed_block(scatter: Scatter, size: int) -> Scatter:
    """Scatter of the first `size` weights."""
    return Scatter(scatter.matrix[:size, :size], scatter.freedom)


def _borrowed(own: Scatter, assumed: TargetSettings) -> float:
    """Largest equivalent sample size that a task borrows from the others, in demonstrations."""
    return OTHERS_SAMPLE_SIZE if own.freedom < FEW else assumed.borrowed


def _borrow(own: Scatter, pooled: Scatter, borrowed: float) -> tuple[Floats, float]:
    """Covariance of a task from its own scatter and a share of all; its equivalent sample size."""
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

    It is (scatter + strength * target) / (freedom + strength), times 1 + 1/n for the uncertain
    mean. With a ridge, the slopes of the controlled on the observed weights are those of the ridge
    regression, and the covariance of its residuals is estimated in the same way.

    Args:
        own: scatter of the task.
        pooled: scatter of all tasks, this one included.
        n: number of demonstrations behind the mean, at least 1.
        floor: variance floor per DOF, (D,).
        strength: equivalent sample size of the target, in demonstrations, positive.
        assumed: assumptions of the target.
    """
    target = structured_target(own, pooled, floor, assumed)
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
