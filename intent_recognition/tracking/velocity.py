# SPDX-License-Identifier: Apache-2.0
"""Velocity of a tracked point from a few recent positions."""

from typing import NamedTuple

import numpy as np

IDENTITY = np.eye(3)


class Velocity(NamedTuple):
    """A velocity (3,) [m/s] and its covariance (3, 3) [m^2/s^2]."""

    mean: np.ndarray
    covariance: np.ndarray


def fit_velocity(
    stamps_ns: np.ndarray, positions: np.ndarray, position_variance: float
) -> Velocity:
    """Slope of the least-squares line through recent positions.

    It is the velocity in the middle of the samples, so it lags by half their span. It uses the
    same evidence as the positions: good for onset detection and display, not for conditioning.

    Args:
        stamps_ns: times of measurement (T,), strictly increasing, T >= 2.
        positions: (T, 3) [m].
        position_variance: of each coordinate of each sample [m^2].

    Returns:
        The slope and its covariance, variance / sum of squared centred times on the diagonal.
    """
    times_s = (stamps_ns - stamps_ns[0]) * 1e-9
    centred_s = times_s - times_s.sum() / times_s.size
    spread = float(centred_s @ centred_s)
    return Velocity(centred_s @ positions / spread, IDENTITY * (position_variance / spread))
