# SPDX-License-Identifier: Apache-2.0
"""How far a person is ahead of, or behind, steady progress.

Nobody moves through a task at one speed. At a recorded phase u, the share of the movement's
duration that has passed, a person has progressed to the reference phase u + s(u) e. The lead e is
a stationary Ornstein-Uhlenbeck process of unit variance along u, so that hesitations and hurries
pass again; its scale s(u) is learned from how demonstrations had to be warped onto one another
(`timing.py`). The lead is followed on a grid, beside the Gaussian over the weights.
"""

from typing import NamedTuple

import numpy as np

N_LEADS = 15
LEAD_SPAN = 2.5
"""Grid of the lead: how many values, and how many standard deviations it reaches to either side."""


class Progress(NamedTuple):
    """Prior of a person's lead.

    Attributes:
        lead_std: standard deviation of the lead at even recorded phases from 0 to 1, (U,); with
            zeros, progress is steady and there is a single lead.
        correlation: recorded phase after which the lead's autocorrelation has fallen to 1/e.
        evidence: exponent of an observation's likelihood in the posterior of the lead; deviations
            from the mean last along a movement, so that its samples are not independent.
    """

    lead_std: np.ndarray
    correlation: float
    evidence: float


STEADY = Progress(np.zeros(2), 1.0, 1.0)
"""Progress without leads."""


def leads(progress: Progress) -> np.ndarray:
    """Values of the lead in its standard deviations, (E,)."""
    if not np.any(progress.lead_std):
        return np.zeros(1)
    return np.linspace(-LEAD_SPAN, LEAD_SPAN, N_LEADS)


def lead_prior(progress: Progress) -> np.ndarray:
    """Probability of each of them before anything is seen, (E,)."""
    weight = np.exp(-0.5 * leads(progress) ** 2)
    return weight / weight.sum()


def drift(progress: Progress, passed: np.ndarray) -> np.ndarray:
    """Transition of the lead while so much recorded phase passes, (..., E, E), rows sum to one.

    Args:
        progress: prior of the lead.
        passed: recorded phase, (...).
    """
    grid = leads(progress)
    if len(grid) == 1:
        return np.ones((*np.shape(passed), 1, 1))
    kept = np.exp(-np.asarray(passed, dtype=np.float64) / progress.correlation)[..., None, None]
    narrowest = 0.5 * (grid[1] - grid[0])
    spread = np.sqrt(np.maximum(1.0 - kept**2, narrowest**2))
    kernel = np.exp(-0.5 * ((grid - kept * grid[:, None]) / spread) ** 2)
    return kernel / kernel.sum(axis=-1, keepdims=True)


def reference_phase(progress: Progress, recorded: np.ndarray) -> np.ndarray:
    """Reference phases of all leads at recorded phases (...), clipped to [0, 1]: (..., E)."""
    recorded = np.clip(recorded, 0.0, 1.0)
    at = np.linspace(0.0, 1.0, len(progress.lead_std))
    scale = np.interp(recorded, at, progress.lead_std)
    return np.clip(recorded[..., None] + scale[..., None] * leads(progress), 0.0, 1.0)
