# SPDX-License-Identifier: Apache-2.0
"""Demonstrations of one movement whose timing is known."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import NormalizedRBFBasis

FINE = np.linspace(0.0, 1.0, 1001)


class TimedRecording(NamedTuple):
    """Demonstrations (n, T, D) and the recorded phases of `FINE` phases of the movement."""

    trajectories: Floats
    recorded: Floats

    def between(self, first: int, second: int, phase: Floats) -> Floats:
        """Recorded phases of `second` where `first` is at recorded phases `phase`."""
        movement = np.interp(phase, self.recorded[first], FINE)
        return np.interp(movement, FINE, self.recorded[second])


def smooth_timing(rng: np.random.Generator, rate_std: float, shift_std: float) -> Floats:
    """Recorded phases of `FINE`; log rates are sums of sines, which no basis here spans."""
    waves = [
        rng.normal() / k * np.sin(np.pi * k * FINE + rng.uniform(0.0, 2.0 * np.pi))
        for k in range(1, 5)
    ]
    rate = np.exp(rate_std * np.sum(waves, axis=0))
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
    first, last = shift_std * rng.normal(size=2)
    return first + (1.0 + last - first) * passed / passed[-1]


def demonstrations(
    rng: np.random.Generator,
    n: int = 10,
    n_samples: int = 200,
    n_dofs: int = 3,
    *,
    rate_std: float = 0.35,
    shift_std: float = 0.0,
    noise: float = 0.0,
    variety: float = 0.0,
) -> TimedRecording:
    """Demonstrations of a random smooth movement of range one; variety and noise are shares of it.

    Deviations are smooth (constants and up to three half waves); noise is white.
    """
    basis = NormalizedRBFBasis(8, 1.0)
    weights = rng.normal(size=(8, n_dofs))
    weights /= np.ptp(basis.design_matrix(FINE) @ weights, axis=0)
    trajectories, recorded = [], []
    for _ in range(n):
        timing = smooth_timing(rng, rate_std, shift_std)
        movement = np.interp(np.linspace(0.0, 1.0, n_samples), timing, FINE)
        values = basis.design_matrix(movement) @ weights
        for k in range(4):
            wave = np.cos(np.pi * k * movement)[:, None]
            values += variety * wave * rng.normal(size=n_dofs) / (k + 1)
        trajectories.append(values + noise * rng.normal(size=values.shape))
        recorded.append(timing)
    return TimedRecording(np.array(trajectories), np.array(recorded))
