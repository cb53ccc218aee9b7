# SPDX-License-Identifier: Apache-2.0
"""Gaussian mixtures by expectation maximisation: many fits to few points in one batch.

The covariance of a component with responsibilities r_i that sum to m is

    (sum_i r_i (y_i - mu)(y_i - mu)^T + strength * T) / (m + strength) + floor * I,

where T is diagonal: the component's variance along each axis, shrunk toward that of all components.
With strength 0 this is textbook EM (Ewerton et al. 2015, Eq. 7-10) with a floor. The result is then
the same in orthonormal coordinates of the points' affine span as in the full space, because all
components have the floor in all other directions. With strength > 0 it is maximum a posteriori.

A covariance is a diagonal plus one rank-one term per member. Determinants and inverses therefore
need matrices whose size is the number of members or the number of axes, whichever is smaller.
"""

from collections.abc import Iterator
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian.linalg import (
    cholesky,
    half_log_det,
    solve_lower,
    student_log_density,
)

NUMBERS_AT_ONCE = 250_000
"""Largest size of one array, in numbers (2 MB); more fits are computed in several batches."""
EMPTY = 1e-8
"""Sum of responsibilities below which a component is dropped: its weight is then zero."""


class CovariancePrior(NamedTuple):
    """Prior of a component's covariance."""

    floor: float  # variance added along every axis, positive
    strength: float = 0.0  # equivalent sample size of T, in points
    # equivalent sample size, within T, of the pooled variance of all components, in points
    shared: float = 0.0


class Components(NamedTuple):
    """B mixtures of K components over points (n, r).

    Covariances are diag(diagonal) + Z^T diag(row_weight) Z with Z = points[rows] - mean.
    """

    log_weight: Floats  # log mixture weights, (B, K), minus infinity for a dropped component
    # sums of responsibilities, (B, K)
    count: Floats  # type: ignore[assignment]  # hides tuple.count
    mean: Floats  # (B, K, r)
    diagonal: Floats  # (B, K, r)
    rows: Integers  # indices of the members, (B, K, M)
    row_weight: Floats  # weights of their outer products, (B, K, M); zero for padding

    def select(self, which: slice | Integers) -> "Components":
        """Selected ones of the B mixtures."""
        return Components(*map(itemgetter(which), self))

    def covariance(self, points: Floats) -> Floats:
        """The covariances as matrices, (B, K, r, r)."""
        root = np.sqrt(self.row_weight)[..., None] * (points[self.rows] - self.mean[:, :, None, :])
        low_rank = np.swapaxes(root, -1, -2) @ root
        return low_rank + self.diagonal[..., None] * np.eye(points.shape[1])


class MixtureFit(NamedTuple):
    """Result of EM from B starts."""

    responsibilities: Floats  # (B, n, K); zero for points left out
    log_likelihood: Floats  # mean over the points that were not left out, (B,)
    components: Components  # the mixtures that follow from the responsibilities

    @property
    def labels(self) -> Integers:
        """Most responsible component of each point, (B, n)."""
        return np.argmax(self.responsibilities, axis=2)


def one_hot(labels: Integers, n_components: int) -> Floats:
    """Responsibilities of 0 and 1, (..., n, K), from labels (..., n)."""
    return (labels[..., None] == np.arange(n_components)).astype(float)


def maximisation(points: Floats, responsibilities: Floats, prior: CovariancePrior) -> Components:
    """M step (Ewerton et al. 2015, Eq. 8-10) of B mixtures at once.

    Args:
        points: (n, r).
        responsibilities: (B, n, K), zero for a point that is left out.
        prior: prior of the covariances.
    """
    share = np.ascontiguousarray(np.swapaxes(responsibilities, 1, 2))
    count = share.sum(axis=2)
    total = np.maximum(count.sum(axis=1, keepdims=True), EMPTY)
    present = count > EMPTY
    divisor = np.where(present, count, 1.0)
    mean = np.where(present[..., None], (share @ points) / divisor[..., None], 0.0)
    diagonal = np.full(mean.shape, prior.floor)
    if prior.strength > 0:
        scatter = np.maximum(share @ points**2 - count[..., None] * mean**2, 0.0)
        scatter = np.where(present[..., None], scatter, 0.0)
        pooled = scatter.sum(axis=1) / total
        target = scatter + prior.shared * pooled[:, None]
        target /= np.maximum(count + prior.shared, EMPTY)[..., None]
        diagonal += target * (prior.strength / (count + prior.strength))[..., None]
    weight = np.where(share > 1e-13, share, 0.0) / (divisor + prior.strength)[..., None]
    n_members = max(int(np.count_nonzero(weight, axis=2).max()), 1)
    rows = np.argpartition(-weight, n_members - 1, axis=2)[..., :n_members]
    share_of_all = np.where(present, count, 0.0) / total
    share_of_all[~present.any(axis=1)] = 1.0  # without any points, no component is ruled out
    with np.errstate(divide="ignore"):
        log_weight = np.log(share_of_all)
    return Components(
        log_weight, count, mean, diagonal, rows, np.take_along_axis(weight, rows, axis=2)
    )


def log_joint(points: Floats, components: Components) -> Floats:
    """log p(k) + log density of each point under component k, (B, n, K)."""
    n_axes = points.shape[1]
    small = components.rows.shape[2] <= n_axes
    squares, log_scale = (_by_members if small else _by_axes)(points, components)
    density = student_log_density(squares, log_scale[..., None], n_axes)
    return np.swapaxes(components.log_weight[..., None] + density, 1, 2)


def _by_axes(points: Floats, components: Components) -> tuple[Floats, Floats]:
    """Squared Mahalanobis distances (B, K, n) and half the log determinants (B, K)."""
    factor = cholesky(components.covariance(points), name="covariance of a component")
    errors = np.swapaxes(points - components.mean[:, :, None, :], 2, 3)
    whitened = solve_lower(factor, errors)
    return np.einsum("bkrn,bkrn->bkn", whitened, whitened), half_log_det(factor)


def _by_members(points: Floats, components: Components) -> tuple[Floats, Floats]:
    """As `_by_axes`, but by the matrix inversion lemma: faster with fewer members than axes."""
    scale = 1.0 / np.sqrt(components.diagonal)[:, :, None, :]
    scaled = (points - components.mean[:, :, None, :]) * scale
    members = (points[components.rows] - components.mean[:, :, None, :]) * scale
    cross, squared = members @ np.swapaxes(scaled, 2, 3), np.sum(scaled**2, axis=3)
    n_members = components.rows.shape[2]
    root = np.sqrt(components.row_weight)
    cross *= root[..., None]
    gram = np.take_along_axis(cross, components.rows[:, :, None, :], axis=3) * root[:, :, None, :]
    gram[..., np.arange(n_members), np.arange(n_members)] += 1.0
    factor = cholesky(gram, name="covariance of a component")
    whitened = solve_lower(factor, cross)
    squared -= np.einsum("bkmn,bkmn->bkn", whitened, whitened)
    return squared, 0.5 * np.log(components.diagonal).sum(axis=2) + half_log_det(factor)


def fit_mixture(
    points: Floats,
    responsibilities: Floats,
    prior: CovariancePrior,
    *,
    n_iterations: int = 100,
    tolerance: float = 1e-6,
) -> MixtureFit:
    """Run EM (Ewerton et al. 2015, Algorithm 1) from B starts, each until it converges.

    A component that becomes empty is dropped; one with a single member keeps the covariance of the
    prior. With negligible floor and strength, the likelihood never falls.

    Args:
        points: (n, r).
        responsibilities: the starts, (B, n, K); a point whose row is zero is left out.
        prior: prior of the covariances.
        n_iterations: largest number of iterations.
        tolerance: a fit has converged when its mean log likelihood changes by no more than this.
    """
    n_fits, n, n_components = responsibilities.shape
    found = np.array(responsibilities, dtype=np.float64)
    likelihood = np.empty(n_fits)
    for part in batches(n_fits, n_components * n * max(n, points.shape[1])):
        found[part], likelihood[part] = _iterate(
            points, found[part], prior, n_iterations, tolerance
        )
    return MixtureFit(found, likelihood, maximisation(points, found, prior))


def batches(n_items: int, numbers_each: int) -> Iterator[slice]:
    """Slices of items, so short that arrays of `numbers_each` numbers per item stay small."""
    size = max(1, NUMBERS_AT_ONCE // max(numbers_each, 1))
    for first in range(0, n_items, size):
        yield slice(first, first + size)


def _iterate(
    points: Floats,
    responsibilities: Floats,
    prior: CovariancePrior,
    n_iterations: int,
    tolerance: float,
) -> tuple[Floats, Floats]:
    """Responsibilities and mean log likelihoods after EM of one batch."""
    found = responsibilities.copy()
    included = found.sum(axis=2) > 0
    n_included = np.maximum(included.sum(axis=1), 1)
    likelihood = np.full(len(found), -np.inf)
    active = np.arange(len(found))
    for _ in range(n_iterations):
        joint = log_joint(points, maximisation(points, found[active], prior))
        total = np.logaddexp.reduce(joint, axis=2)
        share = np.exp(joint - total[..., None]) * included[active][..., None]
        new = np.sum(total * included[active], axis=1) / n_included[active]
        change = np.abs(new - likelihood[active])
        found[active], likelihood[active] = share, new
        active = active[change > tolerance]
        if not active.size:
            break
    return found, likelihood
