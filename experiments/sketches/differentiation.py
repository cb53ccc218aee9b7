# SPDX-License-Identifier: Apache-2.0
"""Velocities and accelerations of sampled positions, by filters without phase lag.

Every filter here is linear, so it is a matrix: what it does to noise is known and need not be
guessed.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, savgol_filter, sosfiltfilt

from intent_recognition.array_types import Floats

HIGHEST_CUTOFF = 0.95
"""Highest cut-off of a digital filter, in parts of half the sampling rate."""


class SavitzkyGolay(NamedTuple):
    """Least squares polynomials in a moving window; at the ends, the last whole window's.

    Attributes:
        width: of the window, in phase.
        order: degree of the polynomials, at least 2.
    """

    width: float
    order: int = 3


class Butterworth(NamedTuple):
    """Low-pass filter run forward and backward, then central differences.

    Attributes:
        cutoff: frequency of -6 dB after both runs, in periods per unit of phase.
        order: of one run.
    """

    cutoff: float
    order: int = 2


Smoother = SavitzkyGolay | Butterworth


@lru_cache(maxsize=256)
def derivative_operators(smoother: Smoother, n_samples: int, step: float) -> Floats:
    """Matrices that take samples to smoothed positions, velocities, accelerations, (3, T, T).

    Args:
        smoother: the filter; a window longer than the samples is cut to them.
        n_samples: T, at least 5.
        step: phase from one sample to the next, positive.
    """
    unit = np.eye(n_samples)
    if isinstance(smoother, SavitzkyGolay):
        operators = _savitzky_golay(smoother, unit, step)
    else:
        operators = _butterworth(smoother, unit, step)
    operators.setflags(write=False)
    return operators


def _savitzky_golay(smoother: SavitzkyGolay, unit: Floats, step: float) -> Floats:
    order, n_samples = min(smoother.order, len(unit) - 2), len(unit)
    longest = n_samples if n_samples % 2 else n_samples - 1
    window = min(max(2 * round(0.5 * smoother.width / step) + 1, order + 1 + order % 2), longest)
    return np.stack(
        [savgol_filter(unit, window, order, deriv=k, delta=step, axis=0) for k in range(3)]
    )


def _butterworth(smoother: Butterworth, unit: Floats, step: float) -> Floats:
    share = min(2.0 * smoother.cutoff * step, HIGHEST_CUTOFF)
    sections = butter(smoother.order, share, output="sos")
    # Enough of the odd extension for the filter to settle, but no more than there are samples.
    padding = min(round(3.0 / share), len(unit) - 1)
    position = sosfiltfilt(sections, unit, axis=0, padlen=padding)
    velocity = np.gradient(position, step, axis=0, edge_order=2)
    return np.stack([position, velocity, np.gradient(velocity, step, axis=0, edge_order=2)])


def spline_operators(phase: Floats, at: Floats, roughness: float) -> Floats:
    """Matrices from irregular samples to a spline's positions and derivatives, (3, K, T).

    The natural cubic smoothing spline: it minimises the squared residuals plus `roughness` times
    the integral of its squared second derivative (Reinsch 1967). At zero it runs through the
    samples.

    Args:
        phase: of the samples, (T,), increasing, at least three.
        at: where it is wanted, (K,); beyond the samples it goes on as a cubic and means little.
        roughness: not negative.
    """
    gap = np.diff(phase)
    rows = np.arange(len(phase) - 2)
    second = np.zeros((len(phase) - 2, len(phase)))
    second[rows, rows], second[rows, rows + 2] = 1.0 / gap[:-1], 1.0 / gap[1:]
    second[rows, rows + 1] = -(1.0 / gap[:-1] + 1.0 / gap[1:])
    gram = np.diag((gap[:-1] + gap[1:]) / 3.0)
    gram += np.diag(gap[1:-1] / 6.0, 1) + np.diag(gap[1:-1] / 6.0, -1)
    penalty = second.T @ np.linalg.solve(gram, second)
    smoothed = np.linalg.inv(np.eye(len(phase)) + roughness * penalty)
    spline = CubicSpline(phase, smoothed, bc_type="natural")
    return np.stack([spline(at), spline(at, 1), spline(at, 2)])
