# SPDX-License-Identifier: Apache-2.0
"""The space in which a pour is described, and the arm's hand in it (Brandl et al. II-D, III-B).

A pour is the path of the held container's lip relative to the centre of the second container's
opening, and the tilt about the lip; the other two rotations are zero. The axes point along the
direction of pouring, across it (to the left), and up.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import follow_poses
from intent_recognition.signals import homogeneous

_POUR_AXES = np.column_stack([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Axes along the pour (the arm's left), across it and up, as columns in the world."""

_HAND_IN_CUP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""The hand's axes as columns in the held cup's axes; the third points at the cup from the side."""

OPENING_M = np.array([0.70, 0.15, 0.26])
"""Default centre of the second container's opening [m], world."""


SEED_POSTURE = np.array([0.76, -1.24, 2.02, -1.72, 0.11, -0.92, 0.96])
"""Joint angles [rad] with the cup held from the side, near which the arm's paths begin."""


@dataclass(frozen=True)
class PourPath:
    """A pour over time."""

    times_s: Floats  # times, ascending from 0 (T,)
    offset_m: Floats  # lip from the centre of the second opening (T, 3): along, across, up
    tilt_rad: Floats  # tilt of the held container about its lip (T,)


@dataclass(frozen=True)
class SideGrasp:
    """How the arm holds a container: from the side, upright, its lip (3,) toward its own +x."""

    lip_m: Floats
    height_m: float

    @property
    def cup_in_hand(self) -> Floats:
        """Pose of the container in the hand's frame (4, 4)."""
        held = np.array([0.0, 0.0, 0.5 * self.height_m])  # by its middle
        return homogeneous(_HAND_IN_CUP.T, np.array([0.0, 0.0, 0.11]) - _HAND_IN_CUP.T @ held)

    def cup_poses(self, path: PourPath, opening_m: Floats) -> Floats:
        """Poses of the container along a path (T, 4, 4), world; the opening's centre is (3,)."""
        c, s = np.cos(path.tilt_rad), np.sin(path.tilt_rad)
        tilted = np.tile(np.eye(3), (len(c), 1, 1))
        tilted[:, 0, 0], tilted[:, 0, 2], tilted[:, 2, 0], tilted[:, 2, 2] = c, s, -s, c
        turns, lip = _POUR_AXES @ tilted, opening_m + path.offset_m @ _POUR_AXES.T
        return homogeneous(turns, lip - turns @ self.lip_m)

    def hand_poses(self, path: PourPath, opening_m: Floats) -> Floats:
        """Poses of the arm's hand along a path (T, 4, 4), world."""
        return self.cup_poses(path, opening_m) @ np.linalg.inv(self.cup_in_hand)


def seen_path(times_s: Floats, cup_poses: Floats, lip_m: Floats, opening_m: Floats) -> PourPath:
    """The pour of a held container with poses (T, 4, 4), world; the inverse of `cup_poses`."""
    up = cup_poses[:, :3, 2] @ _POUR_AXES
    lip = cup_poses[:, :3, :3] @ lip_m + cup_poses[:, :3, 3]
    return PourPath(times_s, (lip - opening_m) @ _POUR_AXES, np.arctan2(up[:, 0], up[:, 2]))


def plan_joints(path: PourPath, grasp: SideGrasp, opening_m: Floats = OPENING_M) -> CubicSpline:
    """Joint angles over time for a path of the lip relative to an opening's centre (3,), world.

    Raises:
        KinematicsError: a pose is out of reach.
    """
    count = max(int(np.ceil(path.times_s[-1] / 0.1)), 4) + 1
    knots = np.linspace(0.0, path.times_s[-1], count)
    offset = CubicSpline(path.times_s, path.offset_m)(knots)
    tilt = CubicSpline(path.times_s, path.tilt_rad)(knots)
    poses = grasp.hand_poses(PourPath(knots, offset, tilt), opening_m)
    joints = follow_poses(poses, SEED_POSTURE)
    return CubicSpline(knots, joints, bc_type="clamped")
