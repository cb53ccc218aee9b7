# SPDX-License-Identifier: Apache-2.0
"""Orientation of the wrist: rotation vectors relative to rest, as quaternions xyzw."""

import numpy as np
from numpy.typing import NDArray

# The wrist at rest: its x axis (along the hand) toward the robot, its z axis up.
REST_QUATERNION = np.array([0.0, 0.0, 1.0, 0.0])


def quaternions(
    rotation_vectors: NDArray[np.float64], rest: NDArray[np.float64] = REST_QUATERNION
) -> NDArray[np.float64]:
    """Unit quaternions xyzw (T, 4) of the wrist in the world, without a jump of sign.

    Args:
        rotation_vectors: rotations relative to the rest orientation (T, 3), in the wrist's axes.
        rest: the wrist's orientation at rest, quaternion xyzw (4,).
    """
    angle = np.linalg.norm(rotation_vectors, axis=1)
    half_sinc = 0.5 * np.sinc(angle / (2.0 * np.pi))
    turn = np.column_stack((rotation_vectors * half_sinc[:, None], np.cos(0.5 * angle)))
    out = _multiply(rest, turn)
    flips = np.sign(np.sum(out[1:] * out[:-1], axis=1))
    out[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return out


def _multiply(left: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hamilton product of a quaternion (4,) and many (T, 4), xyzw."""
    vector, scalar = left[:3], left[3]
    xyz = scalar * right[:, :3] + right[:, 3:] * vector + np.cross(vector, right[:, :3])
    w = scalar * right[:, 3] - right[:, :3] @ vector
    return np.column_stack((xyz, w))
