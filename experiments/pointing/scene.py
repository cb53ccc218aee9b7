# SPDX-License-Identifier: Apache-2.0
"""The table, the spots on it and the arm's finger: pure geometry.

World frame: robot base at the origin, x toward the person, z up; metres, radians. The finger is a
short rod along the z axis of the hand (DH frame 7); where its line meets the table is where it
points.
"""

from types import MappingProxyType

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import forward_kinematics
from intent_recognition.signals import homogeneous
from sim_bridge.scenarios.toolbox import arm_posture

TASK = "pointing"
TABLE_HEIGHT_M = -0.10
"""Height of the table's plane [m], world."""
CIRCLE_CENTRE_M = (0.72, 0.0)
"""Middle of the circle of spots on the table [m], world."""
CIRCLE_DIAMETER_M = 0.30
"""Its diameter [m] (Maeda et al. 2014, Fig. 4)."""
FINGER_LENGTH_M = 0.16
"""From the hand's frame to the tip of the rod [m]."""
TIP_ABOVE_TABLE_M = 0.015
"""How high above the spot the demonstrator stops the tip [m]: near it, without a touch."""

_DOWN_RAD, _STEEPER_RAD_M = 0.75, 2.0
"""Angle of the finger below level at the circle's centre [rad], and by how much it is steeper for
nearer spots [rad/m]."""

_TRAIN = (
    (0.000, 0), (0.080, 45), (0.080, 165), (0.080, 285),
    (0.145, 10), (0.145, 82), (0.145, 154), (0.145, 226), (0.145, 298),
)  # fmt: skip
"""Spots that are taught: radius [m] and direction [deg] in the circle. Sparse, as in the paper's
figure."""
_TEST = (
    (0.140, 45), (0.050, 100), (0.060, 225), (0.105, 120), (0.045, 345),
    (0.110, 190), (0.140, 262), (0.140, 335), (0.100, 5),
)  # fmt: skip
"""Spots of the test, in the same form."""


def _spots(polar: tuple[tuple[float, float], ...]) -> Floats:
    radius, angle = np.array(polar).T
    angle = np.radians(angle)
    spots = np.column_stack((radius * np.cos(angle), radius * np.sin(angle))) + CIRCLE_CENTRE_M
    spots.setflags(write=False)
    return spots


SPOTS_M = MappingProxyType({"train": _spots(_TRAIN), "test": _spots(_TEST)})
"""The nine spots of each set on the table, (9, 2), x and y in the world."""


def spot(purpose: str, index: int) -> Floats:
    """A spot (3,) in the world.

    Raises:
        ArgumentError: there is no such set or spot.
    """
    if purpose not in SPOTS_M or not 0 <= index < len(SPOTS_M[purpose]):
        expected = f"a set of {sorted(SPOTS_M)} and an index below 9"
        raise ArgumentError.about("purpose, index", expected, (purpose, index), "Correct it.")
    return np.append(SPOTS_M[purpose][index], TABLE_HEIGHT_M)


def pointing_rotation(spot_m: Floats) -> Floats:
    """Rotation (3, 3) of the hand that points at a spot (3,): outward and down."""
    yaw = np.arctan2(spot_m[1], spot_m[0])
    distance = np.hypot(spot_m[0], spot_m[1])
    down = _DOWN_RAD + _STEEPER_RAD_M * (CIRCLE_CENTRE_M[0] - distance)
    cy, sy, cd, sd = np.cos(yaw), np.sin(yaw), np.cos(down), np.sin(down)
    turn = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    lower = np.array([[cd, 0.0, sd], [0.0, 1.0, 0.0], [-sd, 0.0, cd]])
    level = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    return turn @ lower @ level


def pointing_pose(spot_m: Floats, rotation: Floats | None = None) -> Floats:
    """Pose (4, 4) of the hand whose finger points at a spot (3,), its tip just above the table."""
    rotation = pointing_rotation(spot_m) if rotation is None else rotation
    direction = rotation[:, 2]
    tip = np.asarray(spot_m) + direction * (TIP_ABOVE_TABLE_M / direction[2])
    return homogeneous(rotation, tip - FINGER_LENGTH_M * direction)


def pointed_at(q: Floats) -> Floats:
    """Where the finger's line meets the table's plane (..., 3) [m] for joint angles (..., 7).

    Raises:
        ArgumentError: the finger does not point down.
    """
    hand = forward_kinematics(q)
    direction = hand[..., :3, 2]
    if np.any(direction[..., 2] > -1e-3):
        raise ArgumentError.about("q", "a finger that points down", direction, "Lower it.")
    share = (TABLE_HEIGHT_M - hand[..., 2, 3]) / direction[..., 2]
    return hand[..., :3, 3] + share[..., None] * direction


def home_pose() -> Floats:
    """The hand's pose (4, 4) at rest: drawn back over the near edge, finger forward and down."""
    rotation = pointing_rotation(np.array([CIRCLE_CENTRE_M[0], 0.0, 0.0]))
    return homogeneous(rotation, [0.52, -0.14, 0.22])


HOME = arm_posture(home_pose())
HOME.setflags(write=False)
