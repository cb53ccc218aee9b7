# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms between a tracker's frame and the world, quaternions as (x, y, z, w)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, settle
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals import LEAST_QUATERNION, rotation_matrix


def normalise_quaternions(quaternions: ArrayLike) -> Floats:
    """Normalise finite quaternions (..., 4); zero quaternions (no orientation) become NaN."""
    q = np.asarray(quaternions, dtype=np.float64)
    largest = np.maximum.reduce(np.abs(q), axis=-1, keepdims=True)
    scaled = q / np.where(largest < LEAST_QUATERNION, np.nan, largest)
    return scaled / np.sqrt(np.add.reduce(scaled * scaled, axis=-1, keepdims=True))


def multiply_quaternions(left: Floats, right: Floats) -> Floats:
    """Hamilton product (4,) of two quaternions xyzw: rotates by `right`, then by `left`."""
    x1, y1, z1, w1 = left
    x2, y2, z2, w2 = right
    return np.array(
        [
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        ]
    )


@dataclass(frozen=True)
class RigidTransform:
    """Pose of a frame in its parent: x_parent = R x_child + t.

    Raises:
        ShapeError: an array has the wrong length.
        ArgumentError: a value is not finite, or the quaternion is zero.
    """

    translation: Floats  # origin of the child in the parent (3,) [m]
    quaternion: Floats  # orientation of the child in the parent (4,) xyzw; normalised here

    def __post_init__(self) -> None:
        translation = np.array(self.translation, dtype=np.float64)
        quaternion = np.array(self.quaternion, dtype=np.float64)
        for name, array, size in (("translation", translation, 3), ("quaternion", quaternion, 4)):
            if array.shape != (size,):
                cure = "Give x y z and qx qy qz qw."
                raise ShapeError.about(name, f"{size} numbers", array.shape, cure)
            if not np.all(np.isfinite(array)):
                cure = "Correct the extrinsics."
                raise ArgumentError.about(name, "finite numbers", array.tolist(), cure)
        unit = normalise_quaternions(quaternion)
        if np.isnan(unit[0]):
            cure = "Use 0 0 0 1 for none."
            raise ArgumentError.about("quaternion", "a rotation", "all zeros", cure)
        settle(self, translation=translation, quaternion=unit)

    @classmethod
    def identity(cls) -> "RigidTransform":
        """The identity transform."""
        return cls(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

    @cached_property
    def rotation(self) -> Floats:
        """Rotation matrix (3, 3)."""
        return rotation_matrix(self.quaternion)

    def apply(self, points: ArrayLike) -> Floats:
        """Transform points (..., 3) [m] from the child frame to the parent frame."""
        return np.asarray(points) @ self.rotation.T + self.translation

    def inverse(self) -> "RigidTransform":
        """Pose of the parent in the child."""
        conjugate = self.quaternion * np.array([-1.0, -1.0, -1.0, 1.0])
        return RigidTransform(-self.rotation.T @ self.translation, conjugate)
