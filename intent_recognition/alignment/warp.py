# SPDX-License-Identifier: Apache-2.0
"""Smooth maps from the phase of a reference to the phase of a recording.

Maeda et al. 2014, Eq. 15, warp time by t_w = v0 + g(v)^T t, with g a linear Gaussian basis model of
the slope and v0 a shift. A slope that is linear in v can turn negative; here its *logarithm* is the
basis model, so the warp increases whatever the weights:

    recorded phase h(z) = v0 + integral from 0 to z of exp(g(x)^T v) dx.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from intent_recognition.array_types import Floats, brief, settle
from intent_recognition.errors import ArgumentError
from intent_recognition.promp import NormalizedRBFBasis

MAX_LOG_RATE = 6.0
"""Largest absolute log rate of a warp; beyond it, phases could coincide in double precision."""


def midpoints(n_grid: int) -> Floats:
    """Middles of the intervals between `n_grid` even phases from 0 to 1, (n_grid - 1,)."""
    return (np.arange(n_grid - 1) + 0.5) / (n_grid - 1)


@lru_cache(maxsize=8)
def slope_basis(n_basis: int, n_grid: int) -> Floats:
    """Basis functions of the log rate between `n_grid` even phases, (n_grid - 1, K), read-only."""
    design = NormalizedRBFBasis(n_basis, 1.0).design_matrix(midpoints(n_grid))
    design.setflags(write=False)
    return design


@brief
@dataclass(frozen=True)
class Warp:
    """Strictly increasing map from reference phase to recorded phase.

    The rate is constant between grid points, so the map is linear there and its inverse exact.
    Outside [0, 1] it is extrapolated at the rate of that end, so that its inverse is defined too.

    Attributes:
        shift: recorded phase at reference phase 0, v0.
        log_rate: log of d recorded phase / d reference phase in G - 1 >= 1 even intervals of the
            reference phase from 0 to 1, (G - 1,).
        recorded: recorded phases at the grid, strictly increasing, (G,), read-only.

    Raises:
        ArgumentError: a value is not finite, or a rate is beyond exp(+-6).
    """

    shift: float
    log_rate: Floats
    recorded: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        log_rate = np.array(self.log_rate, dtype=np.float64)
        if not (np.isfinite(self.shift) and np.all(np.abs(log_rate) <= MAX_LOG_RATE)):
            expected = f"finite numbers, log rates within +-{MAX_LOG_RATE:g}"
            got = f"{self.shift}, {np.min(log_rate)} to {np.max(log_rate)}"
            cure = "Align with a smaller rate_std."
            raise ArgumentError.about("shift, log_rate", expected, got, cure)
        steps = np.cumsum(np.exp(log_rate)) / log_rate.size
        recorded = float(self.shift) + np.concatenate([[0.0], steps])
        settle(self, shift=float(self.shift), log_rate=log_rate, recorded=recorded)

    @classmethod
    def identity(cls, n_grid: int = 2) -> Warp:
        """Warp whose recorded phase equals the reference phase."""
        return cls(0.0, np.zeros(n_grid - 1))

    @property
    def grid(self) -> Floats:
        """Reference phases of the grid, (G,)."""
        return np.linspace(0.0, 1.0, self.log_rate.size + 1)

    def apply(self, phase: Floats) -> Floats:
        """Recorded phases of reference phases, same shape."""
        return _interpolate(np.asarray(phase, dtype=np.float64), self.grid, self.recorded)

    def inverse(self, phase: Floats) -> Floats:
        """Reference phases of recorded phases, same shape; weights are learned at these."""
        return _interpolate(np.asarray(phase, dtype=np.float64), self.recorded, self.grid)


def _interpolate(at: Floats, x: Floats, y: Floats) -> Floats:
    """Piecewise linear interpolation through increasing points, extrapolated at both ends."""
    left = np.minimum(at - x[0], 0.0) * ((y[1] - y[0]) / (x[1] - x[0]))
    right = np.maximum(at - x[-1], 0.0) * ((y[-1] - y[-2]) / (x[-1] - x[-2]))
    return np.interp(at, x, y) + left + right
