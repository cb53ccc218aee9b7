# SPDX-License-Identifier: Apache-2.0
"""Prediction errors of ProMPs and DMPs under noise, all settings chosen by cross-validation."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from experiments.sketches.curves import N_SAMPLES, sketch_pairs
from experiments.sketches.differentiation import Butterworth, SavitzkyGolay, Smoother
from experiments.sketches.models import (
    SHRINKAGES,
    SMOOTHERS,
    VARIANCES,
    ModelChoice,
    folds,
    squared_errors,
)
from intent_recognition.array_types import Floats

N_TRAIN = 40
N_TEST = 60
N_FOLDS = 5
N_DRAWS = 4
"""Draws of the noise on each demonstration that cross validation leaves out."""
PLAIN = SavitzkyGolay(0.02, 2)
"""A parabola through three samples: central differences and no filter."""
CARRIED = (SavitzkyGolay(0.1), Butterworth(10.0))

PROMP, DMP, PROMP_CLEAN, DMP_CLEAN, DMP_PLAIN, DMP_CARRIED = METHODS = (
    "ProMP, chosen for the noise",
    "DMP, chosen for the noise",
    "ProMP, chosen for a clean signal",
    "DMP, chosen for a clean signal",
    "DMP without a filter",
    "DMP, noise carried through the derivatives",
)


class Plan(NamedTuple):
    """Extent of the computation."""

    levels: tuple[float, ...]
    counts: tuple[int, ...]
    repeats: int
    pools: Mapping[str, tuple[ModelChoice, ...]]


def make_plan(quick: bool) -> Plan:
    """The settings tried and the number of repeats."""
    smoothers = SMOOTHERS[::4] if quick else SMOOTHERS
    variances = VARIANCES[::3] if quick else VARIANCES
    shrinkages = SHRINKAGES[:1] if quick else SHRINKAGES

    def pool(filters: Sequence[Smoother | None], white: bool = True) -> tuple[ModelChoice, ...]:
        return tuple(
            ModelChoice(shrinkage, variance, smoother, white)
            for smoother in filters
            for shrinkage in shrinkages
            for variance in variances
        )

    promp, dmp = pool([None]), pool(smoothers)
    pools = {
        PROMP: promp,
        PROMP_CLEAN: promp,
        DMP: dmp,
        DMP_CLEAN: dmp,
        DMP_PLAIN: pool([PLAIN]),
        DMP_CARRIED: pool(CARRIED, white=False),
    }
    if quick:
        return Plan((0.0, 0.04), (51, N_SAMPLES), 2, pools)
    return Plan((0.0, 0.01, 0.02, 0.03, 0.04), (11, 26, 51, 76, N_SAMPLES), 10, pools)


def one_data_set(rng: np.random.Generator, plan: Plan) -> dict[str, Floats]:
    """Root mean square error of the controlled curve per method, (L, k)."""
    train, test = sketch_pairs(rng, N_TRAIN), sketch_pairs(rng, N_TEST)
    pools = list(dict.fromkeys(plan.pools.values()))
    validated = [_cross_validate(rng, train, pool, plan) for pool in pools]
    seen = _disturbed(rng, test[..., 0], plan.levels)
    result = {}
    for method, pool in plan.pools.items():
        errors = validated[pools.index(pool)]
        best = np.argmin(errors, axis=0)
        if method in (PROMP_CLEAN, DMP_CLEAN):
            best = np.repeat(best[:1], len(plan.levels), axis=0)
        taken, number = np.unique(best, return_inverse=True)
        scored = squared_errors(train, test[..., 1], seen, [pool[i] for i in taken], plan.counts)
        picked = np.take_along_axis(scored, number.reshape(1, *best.shape), axis=0)[0]
        result[method] = np.sqrt(picked)
    return result


def _cross_validate(
    rng: np.random.Generator, train: Floats, pool: Sequence[ModelChoice], plan: Plan
) -> Floats:
    """Mean squared error of demonstrations left out, (c, L, k)."""
    total = np.zeros((len(pool), len(plan.levels), len(plan.counts)))
    for kept, left_out in folds(len(train), N_FOLDS):
        held = np.repeat(train[left_out], N_DRAWS, axis=0)
        seen = _disturbed(rng, held[..., 0], plan.levels)
        total += squared_errors(train[kept], held[..., 1], seen, pool, plan.counts)
    return total / N_FOLDS


def _disturbed(rng: np.random.Generator, curves: Floats, levels: Sequence[float]) -> Floats:
    """Curves (t, T) with white noise of each variance, the same draw scaled, (L, t, T)."""
    noise = rng.normal(size=curves.shape)
    return np.array([curves + np.sqrt(level) * noise for level in levels])
