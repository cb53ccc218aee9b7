# SPDX-License-Identifier: Apache-2.0
"""Geometry of the pole: on which side a path passes it, and the clearance of a posture.

World frame as everywhere: the arm's base at the origin on the table, x toward the person, y to the
robot's left, z up; metres, radians. The arm points with a finger along the hand's z axis.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses

POLE_M = np.array([0.40, 0.0])
"""Where the pole stands on the table, x and y [m]."""
POLE_M.setflags(write=False)
POLE_RADIUS_M = 0.02
"""Its radius [m]."""
POLE_HEIGHT_M = 1.0
"""Higher than the arm's elbow ever is [m]: there is no way over it."""
FINGER_M = 0.12
"""From the hand's frame to the finger's tip, along the hand's z axis [m]."""
FINGER_RADIUS_M = 0.015
"""Radius of the arm's finger [m]."""
POINTING_HEIGHT_M = 0.05
"""Height above the spot on the table at which the fingertip stops [m]."""

LEFT, RIGHT = "left", "right"
WAYS = (LEFT, RIGHT)
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Joint angles times this give the posture mirrored at the plane y = 0."""

HOME = np.array([0.0, 0.5, 0.0, 1.9, 0.0, -1.74, 0.0])
HOME.setflags(write=False)
"""The hand hangs between the robot and the pole, on neither side of it."""

_RADII_M = np.array([0.068, 0.064, 0.060, FINGER_RADIUS_M])
"""Upper arm, forearm, wrist and finger as cylinders of these radii, for planning [m]."""
_ENDS = (1, 3, 5, 7)
"""DH frames of shoulder, elbow, wrist and hand."""


def chain(q: Floats) -> Floats:
    """Shoulder, elbow, wrist, hand and fingertip (..., 5, 3) for joint angles (..., 7)."""
    frames = frame_poses(q)
    joints = frames[..., _ENDS, :, :][..., :3, 3]
    tip = frames[..., 7, :3, 3] + FINGER_M * frames[..., 7, :3, 2]
    return np.concatenate([joints, tip[..., None, :]], axis=-2)


def fingertip(q: Floats) -> Floats:
    """The fingertip (..., 3) for joint angles (..., 7)."""
    return chain(q)[..., 4, :]


def planned_clearance(q: Floats) -> Floats:
    """Distance (...) of the arm, as four cylinders, from the pole's surface; negative inside.

    The pole is taken as endless, so that distances are those of lines seen from above.
    """
    points = chain(q)[..., :2]
    begin, along = points[..., :-1, :], np.diff(points, axis=-2)
    length = np.maximum(np.sum(along**2, axis=-1), 1e-12)
    share = np.clip(np.sum((POLE_M - begin) * along, axis=-1) / length, 0.0, 1.0)
    nearest = begin + share[..., None] * along
    distance = np.linalg.norm(nearest - POLE_M, axis=-1) - _RADII_M
    return distance.min(axis=-1) - POLE_RADIUS_M


def finger_clearance(hand: Floats, direction: Floats) -> float:
    """Distance of the finger from the pole's surface, for the hand's origin and z axis (3,)."""
    begin, along = hand[:2], FINGER_M * direction[:2]
    share = np.clip((POLE_M - begin) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    distance = np.linalg.norm(begin + share * along - POLE_M)
    return float(distance - FINGER_RADIUS_M - POLE_RADIUS_M)


def winding(path_m: Floats) -> float:
    """Angle by which a path (T, 2 or 3) turns about the pole, seen from above, anticlockwise > 0.

    A path from the robot to the far side turns by about -pi when it goes by the robot's left.
    """
    relative = np.asarray(path_m)[:, :2] - POLE_M
    angle = np.unwrap(np.arctan2(relative[:, 1], relative[:, 0]))
    return float(angle[-1] - angle[0])


def way_of(path_m: Floats) -> str:
    """Which way a path (T, 2 or 3) from the robot's side goes around the pole."""
    return LEFT if winding(path_m) < 0.0 else RIGHT
