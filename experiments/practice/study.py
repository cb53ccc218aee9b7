# SPDX-License-Identifier: Apache-2.0
"""Practice from a deliberately poor start: demonstrations moved away from the second container."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.improvement import (
    CovarianceSearch,
    Practice,
    Search,
    compare,
    load_cost,
    mean_cost,
    next_point,
    settled_point,
)
from sim_bridge.scenarios.pouring import PouringPractice, read_demonstrated, short_skill

COST = "spilled"
N_ROLLOUTS = 40
N_CHECKS = 3
"""Fresh pours by which the start and the result of a search are compared."""
SHORT_RADII = 0.9
"""How much too short the moved demonstrations pour, in radii of the second opening: most of the
balls fall before it."""
METHODS = CMA, RANDOM = "CMA-ES", "random search"


@dataclass(frozen=True)
class RandomSearch:
    """Draws from the primitive itself, and keeps the cheapest."""

    n_axes: int
    seed: int

    def ask(self, points: Floats, costs: Floats) -> Floats:
        """The next point to try (k,); the first is the mean."""
        if not len(costs):
            return np.zeros(self.n_axes)
        return np.random.default_rng([self.seed, len(costs)]).standard_normal(self.n_axes)

    def favourite(self, points: Floats, costs: Floats) -> Floats:
        """The cheapest point (k,) so far."""
        return points[np.argmin(costs)] if len(costs) else np.zeros(self.n_axes)


@dataclass(frozen=True)
class Practised:
    """One practice.

    Attributes:
        seed: of start, balls and search.
        method: one of `METHODS`.
        costs: of the rollouts, in order (n,).
        start: mean cost of fresh pours with the start.
        settled: the same with the result of practice.
        before, after: mean outcomes of these, by name.
        weights: result of practice, (d,).
    """

    seed: int
    method: str
    costs: Floats
    start: float
    settled: float
    before: Mapping[str, float]
    after: Mapping[str, float]
    weights: Floats

    @property
    def spilled(self) -> tuple[float, float]:
        """Balls of 40 spilled in fresh pours, before and after."""
        return self.before["spilled"], self.after["spilled"]

    @property
    def halved(self) -> bool:
        """Whether practice halved the cost."""
        return self.settled <= 0.5 * self.start


def practise(
    practice: Practice, method: str, seed: int, n_rollouts: int, cost_name: str = COST
) -> Practised:
    """Practise once; how the balls lie is the same for every method."""
    space, cost = practice.space, load_cost(cost_name)
    search: Search = CovarianceSearch(space.n_axes, seed, practice.step)
    if method == RANDOM:
        search = RandomSearch(space.n_axes, seed)
    points, costs = np.empty((0, space.n_axes)), np.empty(0)
    for number in range(n_rollouts):
        rng = np.random.default_rng([seed, number])
        point = next_point(search, space, points, costs, practice.keeps_limits)
        rollouts = practice.rollout(space.weights(point), rng)
        points, costs = np.vstack([points, point]), np.append(costs, mean_cost(cost, rollouts))
    settled = space.weights(settled_point(search, space, points, costs, practice.keeps_limits))
    found = compare(practice, cost, settled, N_CHECKS)
    outcomes = found.outcome_before, found.outcome_after
    return Practised(seed, method, costs, found.before, found.after, *outcomes, settled)


def investigate(
    demonstrations: Path,
    seeds: Sequence[int],
    methods: Sequence[str],
    n_rollouts: int,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Practised]:
    """Practise with every seed by every method."""
    done = []
    shown = read_demonstrated(demonstrations)
    for k, seed in enumerate(seeds):
        skill = short_skill(shown, SHORT_RADII, seed)
        with PouringPractice(skill, shown.cup, shown.second) as practice:
            for method in methods:
                done.append(practise(practice, method, seed, n_rollouts))
                progress((k + (len(done) - k * len(methods)) / len(methods)) / len(seeds))
    return done


def of_method(done: Sequence[Practised], method: str) -> list[Practised]:
    """Those by one method, by seed."""
    return sorted((one for one in done if one.method == method), key=lambda one: one.seed)


def best_so_far(done: Sequence[Practised]) -> Floats:
    """Cheapest rollout so far over the first's cost, (practices, rollouts)."""
    costs = np.array([one.costs for one in done])
    return np.minimum.accumulate(costs, axis=1) / np.maximum(costs[:, :1], 1e-9)


def share_left(done: Sequence[Practised]) -> float:
    """Median over practices of the cost left, as a share of the start's."""
    return float(np.median([one.settled / max(one.start, 1e-9) for one in done]))
