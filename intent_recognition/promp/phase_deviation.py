# SPDX-License-Identifier: Apache-2.0
"""How far a person is ahead of, or behind, steady progress.

Nobody moves through a task at one speed. At a recorded phase u, the share of the movement's
duration that has passed, a person has progressed to the reference phase u + s(u) e. The lead e is
a stationary Ornstein-Uhlenbeck process of unit variance along u, so that hesitations and hurries
pass again; its scale s(u) is learned from how demonstrations had to be warped onto one another
(`timing.py`). The lead is followed on a grid, beside the Gaussian over the weights.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

N_DEVIATIONS = 15
DEVIATION_SPAN = 2.5
"""Grid of the lead: how many values, and how many standard deviations it reaches to either side."""
JUMP = 1e-12
"""Probability that the lead is drawn anew between two observations: no lead is ever ruled out."""


class PhaseDeviation(NamedTuple):
    """Prior of a person's lead.

    Attributes:
        deviation_std: standard deviation at even recorded phases from 0 to 1, (U,); with
            zeros, progress is steady and there is a single deviation.
        correlation: recorded phase after which the lead's autocorrelation has fallen to 1/e.
        evidence: exponent of an observation's likelihood in the posterior of the lead; deviations
            from the mean last along a movement, so that its samples are not independent.
    """

    deviation_std: np.ndarray
    correlation: float
    evidence: float


STEADY = PhaseDeviation(np.zeros(2), 1.0, 1.0)
"""Progress without leads."""


def deviation_grid(phase_deviation: PhaseDeviation) -> np.ndarray:
    """Values of the lead in its standard deviations, (E,)."""
    if not np.any(phase_deviation.deviation_std):
        return np.zeros(1)
    return np.linspace(-DEVIATION_SPAN, DEVIATION_SPAN, N_DEVIATIONS)


def deviation_prior(phase_deviation: PhaseDeviation) -> np.ndarray:
    """Probability of each of them before anything is seen, (E,)."""
    return _normal(deviation_grid(phase_deviation))


def deviation_transition(phase_deviation: PhaseDeviation, passed: np.ndarray) -> np.ndarray:
    """Transition of the lead while so much recorded phase passes, (..., E, E), rows sum to one.

    It keeps the prior, and two transitions one after the other equal that of their sum, however
    short they are: with signals of several stamps, leads must not spread for being looked at often.

    Args:
        phase_deviation: prior of the lead.
        passed: recorded phase, (...); less than zero counts as zero.
    """
    grid = deviation_grid(phase_deviation)
    if len(grid) == 1:
        return np.ones((*np.shape(passed), 1, 1))
    decay, left, right = _modes(len(grid))
    share = np.maximum(passed, 0.0) / phase_deviation.correlation
    kernel = (left * np.exp(-share[..., None, None] * decay)) @ right
    kernel = np.maximum(kernel, 0.0) + JUMP * _normal(grid)
    return kernel / kernel.sum(axis=-1, keepdims=True)


def reference_phase(phase_deviation: PhaseDeviation, recorded: np.ndarray) -> np.ndarray:
    """Reference phases of all leads at recorded phases (...), clipped to [0, 1]: (..., E)."""
    recorded = np.clip(recorded, 0.0, 1.0)
    at = np.linspace(0.0, 1.0, len(phase_deviation.deviation_std))
    scale = np.interp(recorded, at, phase_deviation.deviation_std)
    return np.clip(
        recorded[..., None] + scale[..., None] * deviation_grid(phase_deviation), 0.0, 1.0
    )


def _normal(grid: np.ndarray) -> np.ndarray:
    """Probabilities of leads under their prior, (E,)."""
    weight = np.exp(-0.5 * grid**2)
    return weight / weight.sum()


@lru_cache(maxsize=4)
def _modes(n_leads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Modes of an Ornstein-Uhlenbeck process on a grid: decay (E,), left and right, (E, E) each.

    Neighbours i and j change places at a rate of sqrt(p_j / p_i), which keeps the prior p by
    detailed balance; rates are in parts of that of the slowest mode, the lead's own.
    """
    root = np.sqrt(_normal(np.linspace(-DEVIATION_SPAN, DEVIATION_SPAN, n_leads)))
    generator = np.eye(n_leads, k=1) + np.eye(n_leads, k=-1)
    generator -= np.diag(generator @ root / root)
    rate, vectors = np.linalg.eigh(generator)
    rate = np.maximum(-rate[::-1], 0.0)
    vectors = vectors[:, ::-1]
    return rate / rate[1], vectors / root[:, None], vectors.T * root
