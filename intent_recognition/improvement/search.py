# SPDX-License-Identifier: Apache-2.0
"""Episodic search for a cheaper point among a primitive's weights, given the points tried so far.

CMA-ES (Hansen & Ostermeier 2001; the package `cma`) starts from the primitive's own distribution.
No state is kept between calls: each call replays the search over all points tried and their costs,
which takes milliseconds. The search can therefore stop and continue at any time, with bitwise equal
results.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, optional

HELD = 0.95
"""Share of the paths' variance that the search space covers, with all DOFs weighted equally."""
NEGLIGIBLE = 1e-10
"""Singular values below this share of the largest one are numerical zeros."""


@dataclass(frozen=True)
class SearchSpace:
    """Weights that practice may try: mean + axes z with |z| at most `bound`.

    The primitive's weights are N(mean, S S'). The axes are the leading principal axes of its paths,
    so z ~ N(0, I) is the primitive itself. As |f'A z| <= |f'A| |z|, no linear function of the
    weights, such as a DOF at some phase, deviates by more than `bound` of its standard deviations.
    If the axes hold all of the covariance, |z| is the Mahalanobis distance.
    """

    mean: Floats  # mean weights of the demonstrated primitive, (d,)
    axes: Floats  # principal axes scaled by their standard deviations, (d, k)
    bound: float = 2.0

    @property
    def n_axes(self) -> int:
        """Number of coordinates k."""
        return self.axes.shape[1]

    def weights(self, point: ArrayLike) -> Floats:
        """Weights (d,) of a point (k,)."""
        return self.mean + self.axes @ np.asarray(point, dtype=np.float64)

    def within(self, point: ArrayLike) -> Floats:
        """The point (k,), drawn toward the mean if it is outside the bound."""
        inside = np.asarray(point, dtype=np.float64)
        length = float(np.linalg.norm(inside))
        return inside * (self.bound / length) if length > self.bound else inside


def search_space(mean: ArrayLike, spread: ArrayLike, design: ArrayLike) -> SearchSpace:
    """The search space of a primitive.

    It depends only on the paths: another basis of the weights (w -> M w, design -> design M^-1) or
    another unit of a DOF gives the same paths for the same points, except for the signs of axes.

    `mean` (d,) and `spread` S (d, r) describe the weights, with covariance S S'; `design` (Q, m, d)
    maps weights to Q DOFs at m phases.

    Raises:
        ArgumentError: the primitive has no spread.
    """
    mean, spread, design = (np.asarray(a, dtype=np.float64) for a in (mean, spread, design))
    paths = design @ spread
    scale = np.sqrt(np.mean(np.sum(paths**2, axis=2), axis=1))
    moving = scale > NEGLIGIBLE * np.max(np.abs(design), initial=0.0) * np.max(
        np.abs(mean), initial=0.0
    )
    if not moving.any():
        cure = "Demonstrate more than once, and not always alike."
        raise ArgumentError.about("spread", "a primitive that varies", "none at all", cure)
    stacked = (paths[moving] / scale[moving, None, None]).reshape(-1, spread.shape[1])
    _, lengths, turned = np.linalg.svd(stacked, full_matrices=False)
    held = np.cumsum(lengths**2) / np.sum(lengths**2)
    real = int(np.sum(lengths > NEGLIGIBLE * lengths[0]))
    n_axes = min(int(np.searchsorted(held, HELD - NEGLIGIBLE)) + 1, real)
    return SearchSpace(mean, spread @ turned[:n_axes].T)


Limits = Callable[[Floats], bool]
"""Whether the path of weights (d,) keeps the limits."""


class Search(Protocol):
    """A search for a cheaper point (k,), given those tried (n, k) and their costs (n,)."""

    def ask(self, points: Floats, costs: Floats) -> Floats:
        """The next point to try."""

    def favourite(self, points: Floats, costs: Floats) -> Floats:
        """The point to settle for."""


@dataclass(frozen=True)
class CovarianceSearch:
    """CMA-ES in whitened coordinates, starting from the primitive's mean."""

    n_axes: int  # number of coordinates k
    seed: int
    step: float = 1.0  # standard deviation of the first points; 1 is the primitive's

    def ask(self, points: Floats, costs: Floats) -> Floats:
        """The next point to try (k,), given those tried (n, k) and their costs (n,)."""
        if not len(costs):
            return np.zeros(self.n_axes)
        _, generation, left = self._replayed(points, costs)
        return np.asarray(generation[left], dtype=np.float64)

    def favourite(self, points: Floats, costs: Floats) -> Floats:
        """Mean of the search's distribution after its last complete generation, (k,).

        This mean of many tries is more reliable than the lowest of noisy costs.
        """
        if not len(costs):
            return np.zeros(self.n_axes)
        strategy, _, _ = self._replayed(points, costs)
        return np.array(strategy.mean, dtype=np.float64)

    def _replayed(self, points: Floats, costs: Floats) -> tuple[Any, list, int]:
        """The strategy, its present generation, and the number of its points tried already."""
        strategy = self._strategy()
        done, size = 1, strategy.popsize
        generation = strategy.ask()
        while done + size <= len(costs):
            strategy.tell(list(points[done : done + size]), costs[done : done + size].tolist())
            generation = strategy.ask()
            done += size
        return strategy, generation, len(costs) - done

    def _strategy(self) -> Any:
        cma = optional("cma")

        rng = np.random.default_rng(self.seed)
        options = {
            "randn": lambda *shape: rng.standard_normal(shape),
            "seed": np.nan,  # uses no global random numbers
            "verbose": -9,
        }
        return cma.CMAEvolutionStrategy(np.zeros(self.n_axes), self.step, options)


def next_point(
    search: Search, space: SearchSpace, points: Floats, costs: Floats, limits: Limits
) -> Floats:
    """Next point to try (k,), inside bound and limits, given points (n, k) and costs (n,)."""
    point = _allowed(search.ask(points, costs), space, limits)
    if not (point.any() or limits(space.mean)):
        cure = "Teach the task inside the limits first."
        raise ArgumentError.about("primitive", "a mean inside the limits", "none", cure)
    return point


def settled_point(
    search: Search, space: SearchSpace, points: Floats, costs: Floats, limits: Limits
) -> Floats:
    """Point to settle for (k,), inside the bound and the limits; arguments as in `next_point`."""
    return _allowed(search.favourite(points, costs), space, limits)


def _allowed(point: Floats, space: SearchSpace, limits: Limits) -> Floats:
    """A point (k,), drawn toward the mean until it keeps bound and limits, or the mean itself."""
    point = space.within(point)
    for _ in range(8):
        if limits(space.weights(point)):
            return point
        point = 0.5 * point
    return np.zeros(space.n_axes)
