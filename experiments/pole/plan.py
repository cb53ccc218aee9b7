# SPDX-License-Identifier: Apache-2.0
"""Postures that point at a spot around either side of the pole, and the way to them.

Each is the one nearest to the way's own posture that points there and stays clear of the pole, so
that neighbouring spots have neighbouring postures and no joint ever changes its branch. The way on
the right is that on the left, mirrored.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from experiments.pole.geometry import (
    HOME,
    LEFT,
    MIRROR,
    POINTING_HEIGHT_M,
    chain,
    planned_clearance,
)
from intent_recognition.array_types import Floats
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.promp import minimum_jerk

CLEARANCE_M = 0.065
"""Distance from the pole that a person leading the arm keeps where there is room [m]."""
LEAST_CLEARANCE_M = 0.050
"""A way that comes nearer than this is not taken [m]."""
REACHED_M = 0.005
"""A finger this near to its target has reached it [m]."""
LIMIT_MARGIN_RAD = 0.08
"""Least distance of a posture from the joint limits [rad]."""

_POSTURE = np.array([0.576, -1.078, -0.515, 1.556, -0.392, -0.647, -0.5])
_SWING = np.array([0.967, -0.123, 0.225, 1.584, -0.267, -1.236, -0.344])
_FOLLOW = 0.5
"""Share of the end's deviation from `_POSTURE` by which the swing is moved."""
_LOWEST_M = np.array([0.12, 0.15])
"""Least height of elbow and wrist above the table [m]."""


class Way(NamedTuple):
    """A motion around the pole: a Bezier curve of home, a posture it swings by, and its end.

    Attributes:
        start, swing, end: joint angles (7,) [rad].
        clearance_m: least distance of the planned arm from the pole.
    """

    start: Floats
    swing: Floats
    end: Floats
    clearance_m: float

    def at(self, share: Floats) -> Floats:
        """Joint angles (T, 7) at shares of the way (T,) in [0, 1]."""
        return _curve(self.start, self.swing, self.end, share)

    def timed(self, times_s: Floats, start_s: float, end_s: float) -> Floats:
        """Joint angles (T, 7) at times (T,): at rest, on the way with minimum jerk, at rest."""
        return self.at(minimum_jerk((times_s - start_s) / (end_s - start_s)))


def pointing_posture(spot_m: Floats, way: str) -> Floats:
    """Joint angles (7,) that point at a spot (2,) on the table around one side of the pole.

    The finger may miss the spot: `plan_way` checks that.
    """
    mirror = np.ones(7) if way == LEFT else MIRROR
    target = np.array([spot_m[0], spot_m[1] if way == LEFT else -spot_m[1], POINTING_HEIGHT_M])

    def residuals(q: Floats) -> Floats:
        points = chain(q)
        return np.concatenate(
            [
                100.0 * (points[4] - target),
                0.12 * (q - _POSTURE),
                [100.0 * max(0.0, CLEARANCE_M - float(planned_clearance(q)))],
                50.0 * np.maximum(0.0, _LOWEST_M - points[1:3, 2]),
            ]
        )

    bounds = (LWR_LIMITS.lower + LIMIT_MARGIN_RAD, LWR_LIMITS.upper - LIMIT_MARGIN_RAD)
    return mirror * least_squares(residuals, _POSTURE, bounds=bounds).x


def plan_way(
    spot_m: Floats, way: str, *, start: Floats = HOME, swing_error_rad: Floats | None = None
) -> Way:
    """The motion that points at a spot around one side of the pole.

    Args:
        spot_m: where to point on the table (2,), world.
        way: "left" or "right" of the pole, as the robot sees it.
        start: where the arm is (7,) [rad].
        swing_error_rad: how far the demonstrator swings from the usual (7,).

    Raises:
        KinematicsError: the spot cannot be reached on that side, or not without coming too near.
    """
    mirror = np.ones(7) if way == LEFT else MIRROR
    end = pointing_posture(spot_m, way)
    target = np.array([spot_m[0], spot_m[1], POINTING_HEIGHT_M])
    missed = float(np.linalg.norm(chain(end)[4] - target))
    swing = mirror * _SWING + _FOLLOW * (end - mirror * _POSTURE)
    swing = swing + (0.0 if swing_error_rad is None else swing_error_rad)
    clearance = float(planned_clearance(_curve(start, swing, end, np.linspace(0, 1, 80))).min())
    if missed > REACHED_M or clearance < LEAST_CLEARANCE_M:
        raise KinematicsError.about(
            "spot_m",
            f"a spot that can be pointed at by the {way} of the pole",
            f"{np.round(spot_m, 3).tolist()}: {1e3 * missed:.0f} mm off,"
            f" {1e3 * clearance:.0f} mm from the pole",
            "Go by the other side.",
        )
    return Way(start, swing, end, clearance)


def can_reach(spot_m: Floats, way: str) -> bool:
    """Whether a spot (2,) can be pointed at on that side."""
    try:
        plan_way(spot_m, way)
    except KinematicsError:
        return False
    return True


def _curve(start: Floats, swing: Floats, end: Floats, share: Floats) -> Floats:
    u = np.asarray(share, dtype=np.float64)[:, None]
    return start * (1.0 - u) ** 2 + 2.0 * swing * u * (1.0 - u) + end * u**2
