# SPDX-License-Identifier: Apache-2.0
"""Episodic search for a cheaper point, as functions of what was tried so far.

CMA-ES (Hansen & Ostermeier 2001; the package `cma`) begins with the primitive's own distribution.
Nothing is remembered between calls: each runs the search again over all points tried and their
costs, which takes milliseconds. So it can be stopped and gone on with at any time, to the same
result to the bit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError, optional
from intent_recognition.improvement.space import SearchSpace

Limits = Callable[[Floats], bool]
"""Whether weights (d,) keep the limits."""


class Search(Protocol):
    """A way to look for a cheaper point (k,), after those tried (n, k) and their costs (n,)."""

    def ask(self, points: Floats, costs: Floats) -> Floats:
        """The next point to try."""

    def favourite(self, points: Floats, costs: Floats) -> Floats:
        """The point to settle for."""


@dataclass(frozen=True)
class CovarianceSearch:
    """CMA-ES in whitened coordinates; the first point tried is the primitive's mean."""

    n_axes: int  # number of coordinates k
    seed: int
    step: float = 1.0  # standard deviation of the first points; 1 is the primitive's own

    def ask(self, points: Floats, costs: Floats) -> Floats:
        """The next point to try (k,), given those tried (n, k) and their costs (n,).

        Raises:
            ShapeError: the arrays do not fit.
        """
        if not len(costs):
            return np.zeros(self.n_axes)
        _, generation, left = self._replayed(points, costs)
        return np.asarray(generation[left], dtype=np.float64)

    def favourite(self, points: Floats, costs: Floats) -> Floats:
        """The mean of the search's distribution after its last whole generation, (k,).

        A mean of many tries is surer than the one luckiest of noisy costs.

        Raises:
            ShapeError: the arrays do not fit.
        """
        if not len(costs):
            return np.zeros(self.n_axes)
        strategy, _, _ = self._replayed(points, costs)
        return np.array(strategy.mean, dtype=np.float64)

    def _replayed(self, points: Floats, costs: Floats) -> tuple[Any, list, int]:
        """The strategy, its present generation, and how many of that have been tried."""
        check_tried(points, costs, self.n_axes)
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
            "seed": np.nan,  # no global random numbers
            "verbose": -9,
        }
        return cma.CMAEvolutionStrategy(np.zeros(self.n_axes), self.step, options)


def next_point(
    search: Search, space: SearchSpace, points: Floats, costs: Floats, limits: Limits
) -> Floats:
    """The next point to try (k,), inside the bound and the limits, after (n, k) that cost (n,)."""
    point = _allowed(search.ask(points, costs), space, limits)
    if not (point.any() or limits(space.mean)):
        cure = "Teach the task inside the limits first."
        raise ArgumentError.about("primitive", "a mean inside the limits", "none", cure)
    return point


def settled_point(
    search: Search, space: SearchSpace, points: Floats, costs: Floats, limits: Limits
) -> Floats:
    """The point to settle for (k,), inside the bound and the limits; arguments as `next_point`."""
    return _allowed(search.favourite(points, costs), space, limits)


def _allowed(point: Floats, space: SearchSpace, limits: Limits) -> Floats:
    """A point (k,), drawn toward the mean as far as bound and limits ask; else the mean itself."""
    point = space.within(point)
    for _ in range(8):
        if limits(space.weights(point)):
            return point
        point = 0.5 * point
    return np.zeros(space.n_axes)


def check_tried(points: Floats, costs: Floats, n_axes: int) -> None:
    """Check that there is a point (k,) for each cost."""
    if np.shape(points) != (len(costs), n_axes):
        expected = f"shapes ({len(costs)}, {n_axes}) and ({len(costs)},)"
        cure = "Give one point for each cost."
        got = (np.shape(points), np.shape(costs))
        raise ShapeError.about("points, costs", expected, got, cure)
