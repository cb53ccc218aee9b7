# SPDX-License-Identifier: Apache-2.0
"""How people's timing varies, read from the warps of aligned demonstrations.

It is what a hypothesis that changes its rate online must expect. The log rate is described as a
stationary process that forgets itself exponentially along the phase (Ornstein-Uhlenbeck): over
spans much shorter than its correlation a demonstration is simply faster or slower, over longer
ones its lead or lag grows like a random walk.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment.warp import Warp
from intent_recognition.errors import ArgumentError, describe

SPAN = 0.4
"""Phase over which the growth of lead and lag tells the correlation."""
SHORTEST, LONGEST = 1e-3, 10.0
"""Correlations told apart, in phase."""


class RateSpread(NamedTuple):
    """Deviations of demonstrations from the mean timing of their task.

    Attributes:
        log_rate_std: standard deviation of the log of d recorded phase / d reference phase.
        correlation: phase after which the log rate's autocorrelation has fallen to 1/e.
        start_std: standard deviation of the recorded phase at the reference's start.
        end_std: the same at its end.
    """

    log_rate_std: float
    correlation: float
    start_std: float
    end_std: float


def rate_spread(tasks: Sequence[Sequence[Warp]]) -> RateSpread:
    """Spread of the warps about their mean, pooled over tasks.

    Args:
        tasks: warps of each task's demonstrations, all on one grid; tasks with a single one tell
            nothing and are passed over.

    Raises:
        ArgumentError: no task has two warps, or grids differ.
    """
    groups = [warps for warps in tasks if len(warps) > 1]
    sizes = {warp.log_rate.size for warps in groups for warp in warps}
    if len(sizes) != 1:
        raise ArgumentError(
            describe(
                "tasks",
                "at least two warps of one task, all on one grid",
                f"{len(groups)} such tasks, grids of {sorted(sizes)}",
                "Align two or more demonstrations of each task with the same settings.",
            )
        )
    rates = _deviations([[warp.log_rate for warp in warps] for warps in groups])
    recorded = _deviations([[warp.recorded for warp in warps] for warps in groups])
    freedom = sum(len(warps) - 1 for warps in groups)
    variance = np.sum(rates**2) / (freedom * rates.shape[1])
    lag = max(round(SPAN * rates.shape[1]), 1)
    lead = np.cumsum(rates, axis=1) / rates.shape[1]
    gained = lead[:, lag:] - lead[:, :-lag]
    growth = np.sum(gained**2) / (freedom * gained.shape[1])
    ends = np.sqrt(np.sum(recorded[:, [0, -1]] ** 2, axis=0) / freedom)
    correlation = _correlation(growth / variance, lag / rates.shape[1]) if variance > 0 else SPAN
    return RateSpread(float(np.sqrt(variance)), correlation, float(ends[0]), float(ends[1]))


def _deviations(groups: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Rows less the mean of their group, stacked."""
    return np.concatenate([np.array(rows) - np.mean(rows, axis=0) for rows in groups])


def _correlation(ratio: float, span: float) -> float:
    """Correlation c of a process of unit variance whose integral over `span` has variance `ratio`.

    Solves 2 c^2 (span / c - 1 + exp(-span / c)) = ratio, whose left side grows with c.
    """
    low, high = SHORTEST, LONGEST
    for _ in range(60):
        middle = np.sqrt(low * high)
        passed = span / middle
        if 2.0 * middle**2 * (passed - 1.0 + np.exp(-passed)) < ratio:
            low = middle
        else:
            high = middle
    return float(np.sqrt(low * high))
