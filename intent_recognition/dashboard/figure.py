# SPDX-License-Identifier: Apache-2.0
"""Posture of a simple human figure with a given wrist position: inverse kinematics on arrays.

Only the wrist is measured. Shoulder, elbow and the other parts show one of many possible postures
and say nothing about where the person is.

Lengths are shares of the body's height (Drillis and Contini 1966, in D. A. Winter, Biomechanics
and Motor Control of Human Movement, 4th ed., Fig. 4.1).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats

HIP, SHOULDER, UPPER_ARM, FOREARM = 0.530, 0.818, 0.186, 0.146
SHOULDER_HALF_WIDTH = 0.129
MOST_LEAN_RAD = 0.8
"""Largest lean of the upper body [rad]; for a wrist farther away the whole figure is moved."""


@dataclass(frozen=True)
class Stance:
    """Where a person stands."""

    ground_m: Floats  # point between the feet (3,), world
    faces_rad: float = 0.0  # facing direction about the world's z; 0 faces along x
    height_m: float = 1.75
    left: bool = False  # whether the measured wrist is the left one

    @property
    def arm_m(self) -> tuple[float, float]:
        """Lengths of upper arm and forearm [m]."""
        return UPPER_ARM * self.height_m, FOREARM * self.height_m

    @property
    def side(self) -> float:
        """1 for the left arm, -1 for the right one."""
        return 1.0 if self.left else -1.0

    @cached_property
    def arm(self) -> Floats:
        """Vector (3,) from the middle of the hips to the shoulder of an upright person, world."""
        across, up = self.side * SHOULDER_HALF_WIDTH, SHOULDER - HIP
        return self.rotation @ (self.height_m * np.array([0.0, across, up]))

    @cached_property
    def pole(self) -> Floats:
        """Direction in which the elbow points (3,), world: backward, outward and down."""
        return self.rotation @ [-0.35, 0.45 * self.side, -1.0]

    @cached_property
    def rotation(self) -> Floats:
        """The person's axes forward, left and up as columns (3, 3), world."""
        return Rotation.from_euler("z", self.faces_rad).as_matrix()


class Posture(NamedTuple):
    """A posture; points (3,) [m] and rotations (3, 3) are in the world.

    Attributes:
        hip: middle of the hips, about which the upper body leans.
        upper_body: axes forward, left and up of the upper body.
        shoulder, elbow: joints of the arm whose wrist is given.
    """

    hip: Floats
    upper_body: Floats
    shoulder: Floats
    elbow: Floats


def reach(stance: Stance, wrist: Floats) -> Posture:
    """Compute the posture of a figure whose wrist is at a point (3,) [m], world.

    The upper body leans as little as needed toward a wrist out of the arm's reach; if that does
    not suffice, the whole figure is moved. The wrist is always reached, bones keep their lengths,
    and the posture changes continuously with the wrist.
    """
    upper, fore = stance.arm_m
    hip = stance.ground_m + np.array([0.0, 0.0, HIP * stance.height_m])
    # a stretched arm defines no plane to bend in
    longest, shortest = 0.98 * (upper + fore), 1.1 * abs(upper - fore)
    lean = lean_toward(stance.arm, wrist - hip, longest)
    shoulder = hip + lean @ stance.arm
    way = wrist - shoulder
    distance = float(np.linalg.norm(way))
    direction = way / distance if distance > 0.0 else stance.rotation[:, 0]
    moved = (distance - min(max(distance, shortest), longest)) * direction
    shoulder = shoulder + moved
    elbow = bend(shoulder, wrist, upper, fore, stance.pole)
    return Posture(hip + moved, lean @ stance.rotation, shoulder, elbow)


def lean_toward(arm: Floats, target: Floats, reach_m: float) -> Floats:
    """Smallest rotation (3, 3) of a lever that brings its end within reach of a target.

    The angle is at most `MOST_LEAN_RAD`, and zero if the target is already within reach.

    Args:
        arm: vector (3,) [m] from the pivot to the lever's end.
        target: vector (3,) [m] from the pivot to the target.
        reach_m: largest distance between lever's end and target.
    """
    lever, distance = float(np.linalg.norm(arm)), float(np.linalg.norm(target))
    axis = np.cross(arm, target)
    sine = float(np.linalg.norm(axis))
    if sine <= 1e-12 * lever * distance:
        return np.eye(3)
    between = np.arctan2(sine, arm @ target)
    # Law of cosines: the angle at the pivot of a triangle with the sides lever, distance, reach.
    cosine = (lever**2 + distance**2 - reach_m**2) / (2.0 * lever * distance)
    allowed = np.arccos(min(max(cosine, -1.0), 1.0))
    angle = min(max(between - allowed, 0.0), MOST_LEAN_RAD)
    if angle == 0.0:
        return np.eye(3)
    return Rotation.from_rotvec(angle * axis / sine).as_matrix()


def bend(root: Floats, end: Floats, first_m: float, second_m: float, pole: Floats) -> Floats:
    """Position (3,) of the joint between two bones, in the plane of their ends and a direction.

    Args:
        root: start of the first bone (3,) [m].
        end: end of the second bone (3,) [m], at most the sum of both lengths away.
        first_m: length of the first bone.
        second_m: length of the second bone.
        pole: direction in which the joint bends (3,), not parallel to the line between the ends.
    """
    way = end - root
    distance = float(np.linalg.norm(way))
    along = way / distance
    out = pole - (pole @ along) * along
    share = (first_m**2 - second_m**2 + distance**2) / (2.0 * distance)
    height = np.sqrt(max(first_m**2 - share**2, 0.0))
    return root + share * along + height * out / np.linalg.norm(out)


def bone_axes(bone: Floats, pole: Floats) -> Floats:
    """Axes (3, 3) with z along a bone (3,) and x as close as possible to a pole direction."""
    z = bone / np.linalg.norm(bone)
    x = pole - (pole @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))
