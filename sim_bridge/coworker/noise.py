# SPDX-License-Identifier: Apache-2.0
"""Noise of human movement and of the tracker: tremor, sway, measurement noise, occlusions.

All processes are sampled at `RATE_HZ` and drawn from the generator handed in.
"""

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.promp import minimum_jerk

RATE_HZ = 100.0
"""Sampling rate of the tracker [Hz], that of the shipped recordings."""
TREMOR_STD_M, SWAY_STD_M = 0.0004, 0.0012
"""Standard deviations of physiological tremor and of slow postural sway, per axis [m]."""
MARKER_STD_M, MARKER_ANGLE_STD_RAD = 0.001, 0.006
"""Noise of a tracked position [m] and orientation [rad] per axis."""


def smooth_noise(rng: np.random.Generator, count: int, cutoff_hz: float) -> Floats:
    """Gaussian noise (count, 3) of unit variance, filtered by two equal first-order low passes.

    It is stationary from the first sample on, since the filter's warm-up is cut off.
    """
    decay = np.exp(-2.0 * np.pi * cutoff_hz / RATE_HZ)
    warm_up = int(np.ceil(8.0 / (1.0 - decay)))
    white = rng.standard_normal((count + warm_up, 3))
    return _recursive(white, 2.0 * decay, -(decay**2))[warm_up:]


def tremor(rng: np.random.Generator, count: int) -> Floats:
    """Physiological tremor (count, 3) in metres: a narrow band around 10 Hz (8 to 12 are usual)."""
    radius = np.exp(-np.pi * 1.0 / RATE_HZ)  # a band of 1 Hz
    warm_up = int(np.ceil(8.0 / (1.0 - radius)))
    white = rng.standard_normal((count + warm_up, 3))
    feedback = 2.0 * radius * np.cos(2.0 * np.pi * 10.0 / RATE_HZ)
    return TREMOR_STD_M * _recursive(white, feedback, -(radius**2))[warm_up:]


def _recursive(white: Floats, first: float, second: float) -> Floats:
    """y_k = first y_{k-1} + second y_{k-2} + white_k, scaled to unit stationary variance.

    scipy.signal's lfilter does the same, but its import takes half a second.
    """
    variance = (1.0 - second) / ((1.0 + second) * ((1.0 - second) ** 2 - first**2))
    out = np.zeros_like(white)
    previous, before = np.zeros(3), np.zeros(3)
    for k, value in enumerate(white):
        out[k] = first * previous + second * before + value
        before, previous = previous, out[k]
    return out / np.sqrt(variance)


def signal_dependent(rng: np.random.Generator, positions: Floats) -> Floats:
    """Deviation (T, 3) of one movement whose velocity noise grows with speed (Harris and Wolpert).

    The person corrects the accumulated deviation smoothly during the movement, which therefore
    starts and ends where `positions` (T, 3) does.
    """
    count = len(positions)
    velocity = np.gradient(positions, 1.0 / RATE_HZ, axis=0)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    error = 0.06 * speed * smooth_noise(rng, count, 1.5)
    deviation = np.cumsum(error, axis=0) / RATE_HZ
    taken_back = minimum_jerk(np.linspace(0.0, 1.0, count))[:, None]
    return deviation - taken_back * deviation[-1]


def occlusions(rng: np.random.Generator, count: int, gaps_per_s: float, drop_rate: float) -> Flags:
    """Whether the tracker sees each sample, (count,).

    Gaps of 0.05 to 0.35 s begin at random, on average `gaps_per_s` per second. Single samples are
    lost with probability `drop_rate`.
    """
    visible = rng.uniform(size=count) >= drop_rate
    for _ in range(rng.poisson(gaps_per_s * count / RATE_HZ)):
        first = int(rng.uniform(0, count))
        length = round(rng.uniform(0.05, 0.35) * RATE_HZ)
        visible[first : first + length] = False
    return visible
