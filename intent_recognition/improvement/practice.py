# SPDX-License-Identifier: Apache-2.0
"""What can be practised, and one try at it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.improvement.cost import Cost, Rollout
from intent_recognition.improvement.search import Search, SearchSpace, next_point


class Practice(Protocol):
    """What can be practised."""

    @property
    def costs(self) -> Sequence[str]:
        """Names of the costs that fit, the usual one first."""

    @property
    def step(self) -> float:
        """How far the search begins to look, in standard deviations."""

    @property
    def space(self) -> SearchSpace:
        """Where to look."""

    def keeps_limits(self, weights: Floats) -> bool:
        """Whether a path of these weights (d,) can be executed."""

    def rollout(self, weights: Floats, rng: np.random.Generator) -> Sequence[Rollout]:
        """Execute it, once or once with each of several people."""

    def check(self, weights: Floats, count: int) -> Sequence[Rollout]:
        """Execute it as often, in ways that `rollout` never does where there are others."""

    def write(self, folder: Path, rollouts: Sequence[Rollout], labels: Mapping[str, str]) -> None:
        """Write a rollout as a bag, or as several below the folder."""


class Attempt(NamedTuple):
    """One try: the point (k,), what was executed, and the mean cost of that."""

    point: Floats
    rollouts: Sequence[Rollout]
    cost: float


class PracticeComparison(NamedTuple):
    """Mean cost and mean outcome of the start and of some weights, in the same fresh executions."""

    before: float
    after: float
    outcome_before: Mapping[str, float]
    outcome_after: Mapping[str, float]


def attempt(
    practice: Practice,
    search: Search,
    cost: Cost,
    points: Floats,
    costs: Floats,
    rng: np.random.Generator,
) -> Attempt:
    """Try the next point after those tried (n, k) and their costs (n,).

    Raises:
        ArgumentError: the cost function failed, or the primitive's mean breaks the limits.
    """
    point = next_point(search, practice.space, points, costs, practice.keeps_limits)
    rollouts = practice.rollout(practice.space.weights(point), rng)
    return Attempt(point, rollouts, mean_cost(cost, rollouts))


def compare(practice: Practice, cost: Cost, weights: Floats, count: int) -> PracticeComparison:
    """The start and weights (d,), in `count` fresh executions each."""
    before, after = (practice.check(w, count) for w in (practice.space.mean, weights))
    return PracticeComparison(
        mean_cost(cost, before), mean_cost(cost, after), mean_outcome(before), mean_outcome(after)
    )


def mean_cost(cost: Cost, rollouts: Sequence[Rollout]) -> float:
    """Mean cost of some executions."""
    return float(np.mean([cost(one) for one in rollouts]))


def mean_outcome(rollouts: Sequence[Rollout]) -> dict[str, float]:
    """Mean of each outcome of some executions."""
    return {
        name: float(np.mean([one.outcome[name] for one in rollouts]))
        for name in rollouts[0].outcome
    }
