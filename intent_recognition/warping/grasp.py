# SPDX-License-Identifier: Apache-2.0
"""A grasp of a gripper with two parallel fingers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, settle
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.untrusted import LARGEST


@dataclass(frozen=True, eq=False)
class Grasp:
    """Where two parallel fingers hold an object.

    Attributes:
        pose: of the fingers (4, 4) in the object's coordinates [m]: the origin is in the middle
            between the pads, y the direction in which they close, z the one in which the hand
            approaches. The two fingers are alike: a half turn about z is the same grasp.
        width_m: distance of the pads that touch the object; to get there the hand opens wider.

    Raises:
        ShapeError: the pose is not (4, 4).
        ArgumentError: it is no rigid motion, or the width is not above 0.
    """

    pose: Floats
    width_m: float

    def __post_init__(self) -> None:
        """Check the values; take a copy of the pose that cannot be written to."""
        pose = np.array(self.pose, dtype=float)
        if pose.shape != (4, 4):
            raise ShapeError.about("pose", "shape (4, 4)", pose.shape, "Give a 4x4 matrix.")
        turn = pose[:3, :3]
        rigid = np.all(np.abs(pose) <= LARGEST) and np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
        if not rigid or np.abs(turn.T @ turn - np.eye(3)).max() > 1e-4:  # files keep 32 bits
            cure = "Give orthonormal axes as columns, and the last row 0, 0, 0, 1."
            raise ArgumentError.about("pose", "a rigid motion", pose.tolist(), cure)
        if np.linalg.det(turn) < 0.0:
            cure = "Let x be the cross product of y and z."
            raise ArgumentError.about("pose", "right-handed axes", "left-handed ones", cure)
        if not (np.isfinite(self.width_m) and self.width_m > 0.0):
            cure = "Give the distance of the two contacts in metres."
            raise ArgumentError.about("width_m", "a number above 0", self.width_m, cure)
        settle(self, pose=pose, width_m=float(self.width_m))

    @property
    def centre(self) -> Floats:
        """Middle between the pads (3,) [m]."""
        return self.pose[:3, 3]

    @property
    def closing(self) -> Floats:
        """Unit direction (3,) in which the fingers close."""
        return self.pose[:3, 1]

    @property
    def approach(self) -> Floats:
        """Unit direction (3,) in which the hand approaches."""
        return self.pose[:3, 2]
