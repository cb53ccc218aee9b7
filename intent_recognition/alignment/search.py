# SPDX-License-Identifier: Apache-2.0
"""Start of the descent: the best coarse warp, by dynamic programming.

A local method (Maeda et al. 2014, Eq. 15-16) ends in the nearest minimum: an oscillation one period
off stays one period off. The search compares all monotone paths on a coarse lattice by a similar
cost of deviations and rates, for all demonstrations at once.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.alignment.fit import WarpProblem
from intent_recognition.alignment.warp import midpoints
from intent_recognition.array_types import Floats

STEPS, FINENESS = 32, 4
"""Number of reference intervals of the lattice, and of recorded intervals per reference interval:
they bound the time of the search."""
MOVES = np.array([1, 2, 3, 4, 5, 6, 8, 11])
"""Numbers of recorded intervals that a reference interval may span: rates from 1/4 to 11/4."""


def search(problem: WarpProblem, rate_std: float, rate_correlation: float) -> Floats:
    """Parameters (n, K + 1) of smooth warps near the best coarse paths.

    `rate_std` and `rate_correlation` are the log rate's prior std and correlation length in phase.
    """
    at = np.linspace(0, len(problem.reference) - 1, STEPS + 1).round().astype(int)
    reference = (problem.reference[at] - problem.reference.mean(axis=0)).astype(np.float32)
    n = problem.curves.coefficients.shape[1]
    recorded = np.linspace(0.0, 1.0, STEPS * FINENESS + 1)
    values, _ = problem.curves.at(np.broadcast_to(recorded, (n, recorded.size)))
    values = (values - values.mean(axis=1, keepdims=True)).astype(np.float32)
    squares = np.sum(reference**2, axis=-1)[..., None] + np.sum(values**2, axis=-1)[:, None]
    squares -= 2.0 * (reference @ np.swapaxes(values, 1, 2))
    distance = np.sqrt(np.maximum(squares, 0.0, out=squares), out=squares)
    n_moving = np.count_nonzero(np.any(problem.reference != 0.0, axis=0))
    share = problem.n_independent / (STEPS + 1)
    # sqrt(2 / pi) = 0.8 converts the L2 norm of Gaussian deviations to their expected L1 norm
    distance *= np.float32(0.8 * np.sqrt(n_moving) * share)
    paths = _best_paths(distance, rate_std, rate_correlation, problem.end_std)
    return _smoothed(problem, recorded[paths])


def _best_paths(
    distance: Floats, rate_std: float, rate_correlation: float, end_std: float
) -> NDArray[np.intp]:
    """Recorded index at each reference step on the path of least cost, (n, STEPS + 1).

    `distance` is the cost of each pair of reference step and recorded phase, (n, STEPS + 1, J).
    """
    n, _, size = distance.shape
    # steps within twice the correlation length share one log rate
    each = min(1.0, 1.0 / (2.0 * rate_correlation * STEPS))
    penalty = (0.5 * each * (np.log(MOVES / FINENESS) / rate_std) ** 2).astype(np.float32)
    recorded = np.linspace(0.0, 1.0, size)
    widest = MOVES[-1]
    padded = np.full((n, widest + size), np.inf, dtype=np.float32)
    padded[:, widest:] = distance[:, 0] + 0.5 * (recorded / end_std) ** 2
    choice = np.empty((STEPS, n, size), dtype=np.int8)
    for step in range(STEPS):
        best = padded[:, widest - MOVES[0] : widest - MOVES[0] + size] + penalty[0]
        taken = choice[step]
        taken[:] = 0
        for k in range(1, len(MOVES)):
            tried = padded[:, widest - MOVES[k] : widest - MOVES[k] + size] + penalty[k]
            np.copyto(taken, k, where=tried < best)
            np.minimum(best, tried, out=best)
        padded[:, widest:] = best + distance[:, step + 1]
    final = padded[:, widest:] + 0.5 * ((1.0 - recorded) / end_std) ** 2
    path = np.empty((n, STEPS + 1), dtype=np.intp)
    path[:, -1] = np.argmin(final, axis=1)
    rows = np.arange(n)
    for step in reversed(range(STEPS)):
        path[:, step] = path[:, step + 1] - MOVES[choice[step, rows, path[:, step + 1]]]
    return path


def _smoothed(problem: WarpProblem, paths: Floats) -> Floats:
    """Parameters of smooth warps with log rates nearest to those of paths (n, STEPS + 1)."""
    phase = midpoints(len(problem.basis) + 1)
    middle = midpoints(STEPS + 1)
    design = np.stack([np.interp(middle, phase, column) for column in problem.basis.T], axis=1)
    precision = problem.prior_precision
    rates = np.diff(paths, axis=1) * STEPS
    ridge = precision * (np.trace(design.T @ design) / np.trace(precision))
    # Rates of single steps are quantised, so use their running mean over three steps.
    mean = rates.copy()
    mean[:, 1:-1] = (rates[:, :-2] + rates[:, 1:-1] + rates[:, 2:]) / 3.0
    regression = np.linalg.solve(design.T @ design + 0.3 * ridge, design.T)
    weights = (regression @ np.log(mean)[..., None])[..., 0]
    return np.concatenate([paths[:, :1], weights], axis=1)
