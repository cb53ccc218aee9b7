# SPDX-License-Identifier: Apache-2.0
"""Geometry of the toolbox assembly: places, and the demonstrator's rule.

World frame: robot base at the origin, x toward the worker, z up; metres, radians. The hand is DH
frame 7 of the arm, with its z axis pointing out of the hand. In every posture used here, the hand
points at the worker, roughly level, and the arm is on one branch of its inverse kinematics.
"""

from types import MappingProxyType

import numpy as np

from intent_recognition.array_types import Floats, frozen
from intent_recognition.kinematics import Branch, solve
from intent_recognition.signals import homogeneous
from sim_bridge.coworker import HOLD, PLATE, SCREW

ARM_BRANCH = Branch(shoulder=-1, elbow=1, wrist=1)

# Offset from the worker's wrist to the robot's hand at the handover: a plate is held at opposite
# edges, a screwdriver by its end. The screw is given at one place, wherever the human reaches.
_OFFSETS_M = {PLATE: np.array([-0.17, 0.0, 0.01]), HOLD: np.array([-0.15, -0.01, -0.01])}
SCREW_HANDOVER_M = np.array([0.62, -0.03, 0.38])

# Orientation of the hand at the handover: yaw about the world's z and roll about its own z.
_YAW_ROLL_RAD = {PLATE: (0.10, 0.20), SCREW: (-0.05, -0.25), HOLD: (0.0, -0.45)}

HOME_HAND_M = np.array([0.50, -0.21, 0.37])
"""Position at which the hand waits [m], world."""
_HOME_YAW_ROLL_RAD = (-0.15, 0.0)
"""Yaw about the world's z and roll about its own z of the hand at home [rad]."""

GRASP_RADIUS_M, GRASP_SPEED_M_S = 0.03, 0.12
"""Distance of the hand from a stand, and its speed, below which it takes the object [m], [m/s]."""
LIFT_M = np.array([0.0, 0.0, 0.08])
"""Displacement by which the object is lifted off its stand [m]."""


STANDS_M = MappingProxyType(
    {PLATE: frozen((0.52, -0.31, 0.33)), SCREW: frozen((0.56, -0.26, 0.31))}
)
"""Position of the hand when it takes an object from its stand; the screwdriver has no stand."""


def hand_rotation(yaw_rad: float, roll_rad: float) -> Floats:
    """Rotation (3, 3) of a level hand that points along x turned by yaw, rolled about its axis."""
    cy, sy, cr, sr = np.cos(yaw_rad), np.sin(yaw_rad), np.cos(roll_rad), np.sin(roll_rad)
    level = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    roll = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    return yaw @ level @ roll


def arm_posture(hand_pose: Floats) -> Floats:
    """Joint angles (7,) that put the hand at a pose (4, 4), on the scene's branch and swivel.

    Raises:
        KinematicsError: the pose is out of reach.
    """
    return solve(hand_pose, -0.25, ARM_BRANCH)  # swivel of the elbow


def handover_point(task: str, goal_m: Floats) -> Floats:
    """Final position (3,) of the robot's hand by the demonstrator's rule, for a wrist goal (3,).

    For plate and screwdriver it is the goal plus the task's offset; for the screw it is fixed.
    """
    if task == SCREW:
        return SCREW_HANDOVER_M.copy()
    return np.asarray(goal_m, dtype=np.float64) + _OFFSETS_M[task]


def handover_rotation(task: str) -> Floats:
    """Rotation (3, 3) of the robot's hand at the handover."""
    return hand_rotation(*_YAW_ROLL_RAD[task])


def home_pose() -> Floats:
    """The hand's pose (4, 4) from which every interaction starts."""
    return homogeneous(hand_rotation(*_HOME_YAW_ROLL_RAD), HOME_HAND_M)


def stand_pose(task: str) -> Floats:
    """The hand's pose (4, 4) at a task's stand, one of `STANDS_M`, turned as at home."""
    return homogeneous(hand_rotation(*_HOME_YAW_ROLL_RAD), STANDS_M[task])


def takes(task: str, hand_m: Floats, speed_m_s: float) -> bool:
    """Whether a hand (3,) [m] passes a task's stand so near and slowly that it takes the object."""
    near = np.linalg.norm(hand_m - STANDS_M[task]) < GRASP_RADIUS_M
    return bool(near and speed_m_s < GRASP_SPEED_M_S)


HOME = frozen(arm_posture(home_pose()))
