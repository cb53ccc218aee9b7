# SPDX-License-Identifier: Apache-2.0
"""Map orientations to rotation vectors in the tangent space at a reference, and back.

A unit quaternion q (xyzw) and -q are the same rotation, and unit quaternions form no vector space.
An orientation is therefore learned as the rotation vector v = Log(q_ref^-1 q) [rad]: axis times
angle of the rotation from a reference to it, in the axes of the reference. One reference serves all
tasks and phases (Huang, Abu-Dakka, Silverio & Caldwell 2021, "Toward Orientation Learning and
Adaptation in Cartesian Space", IEEE Transactions on Robotics 37(1)), so that an observation has the
same coordinates under every hypothesis of the filter. The reference is the mean of the
demonstrations, so that v does not depend on the orientation of the world frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals.arrays import as_numbers

LARGEST_ANGLE_RAD = 0.95 * np.pi
"""Largest angle from the reference that is represented [rad]: 9 degrees below a half turn, where v
jumps to -v, and more than a hand turns from its mean."""
LEAST_QUATERNION = 1e-6
"""Norm of a quaternion below which it means "not measured"; trackers send zeros."""
SMALL_ANGLE_RAD = 1e-4
"""Angle below which series replace quotients [rad], for numerical safety; both agree to 1e-9."""


def to_tangent(quaternions: ArrayLike, reference: ArrayLike) -> Floats:
    """Rotation vectors from the reference to orientations, in the axes of the reference.

    Args:
        quaternions: (..., 4) xyzw, of any norm and sign.
        reference: unit quaternion (4,) xyzw.

    Returns:
        (..., 3) [rad]; NaN where a quaternion is zero, not finite or farther than
        `LARGEST_ANGLE_RAD` from the reference.

    Raises:
        ShapeError: the last dimension of an argument is not 4.
    """
    q = _of_size(4, "quaternions", quaternions)
    x, y, z, w = _of_size(4, "reference", reference)
    conjugate = np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        relative = q @ conjugate.T
        norm = np.linalg.norm(relative, axis=-1, keepdims=True)
        relative = relative / np.where(norm > LEAST_QUATERNION, norm, np.nan)
        relative = np.where(relative[..., 3:] < 0.0, -relative, relative)
        sine = np.linalg.norm(relative[..., :3], axis=-1, keepdims=True)
        angle = 2.0 * np.arctan2(sine, relative[..., 3:])
        scale = np.where(angle < SMALL_ANGLE_RAD, 2.0 + angle**2 / 12.0, angle / sine)
    return np.where(angle <= LARGEST_ANGLE_RAD, scale * relative[..., :3], np.nan)


def from_tangent(vectors: ArrayLike, reference: ArrayLike) -> Floats:
    """Unit quaternions (..., 4) xyzw of rotation vectors from the reference.

    The sign is continuous: successive quaternions have a non-negative scalar product.

    Args:
        vectors: (..., 3) [rad].
        reference: unit quaternion (4,) xyzw.

    Raises:
        ShapeError: the last dimension of vectors is not 3, or of the reference not 4.
    """
    v = _of_size(3, "vectors", vectors)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    u, c = 0.5 * np.sinc(angle / (2.0 * np.pi)) * v, np.cos(0.5 * angle)
    x, y, z, w = _of_size(4, "reference", reference)
    product = np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])
    quaternions = np.concatenate([u, c], axis=-1) @ product.T
    if quaternions.ndim == 1 or not len(quaternions):
        return quaternions
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=-1, keepdims=True)
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], signs * quaternions[1:]])


def mean_orientation(quaternions: ArrayLike) -> Floats:
    """The mean of orientations (T, 4) xyzw, a unit quaternion (4,) with w >= 0.

    It is the dominant eigenvector of sum q q^T (Markley, Cheng, Crassidis & Oshman 2007, "Averaging
    Quaternions"), which does not depend on signs.

    Args:
        quaternions: (T, 4) xyzw; zero or non-finite quaternions are ignored.

    Raises:
        ShapeError: the shape is not (T, 4).
        ArgumentError: no orientation was measured.
    """
    q = _of_size(4, "quaternions", quaternions).reshape(-1, 4)
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    measured = (norm[:, 0] > LEAST_QUATERNION) & np.isfinite(norm[:, 0])
    if not measured.any():
        cure = "Record orientations, or leave the entry out."
        raise ArgumentError.about("quaternions", "at least one that is measured", 0, cure)
    q = q[measured] / norm[measured]
    mean = np.linalg.eigh(q.T @ q)[1][:, -1]
    return mean if mean[3] >= 0.0 else -mean


def _of_size(size: int, argument: str, values: ArrayLike) -> Floats:
    """Check that values have the shape (..., size)."""
    array = as_numbers(argument, values)
    if array.shape[-1:] != (size,):
        cure = "Quaternions are x, y, z, w; rotation vectors are three angles."
        raise ShapeError.about(argument, f"shape (..., {size})", array.shape, cure)
    return array


def right_jacobian(vectors: ArrayLike) -> Floats:
    """Right Jacobian J (..., 3, 3): a change dv of a rotation vector turns the body by J dv [rad].

    The turn is about the body's axes. See Chirikjian (2012), "Stochastic Models, Information
    Theory, and Lie Groups", vol. 2, p. 40.
    """
    v = np.asarray(vectors, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    cross = np.zeros((*v.shape[:-1], 3, 3))
    for row, column, axis, sign in ((0, 1, 2, -1), (0, 2, 1, 1), (1, 2, 0, -1)):
        cross[..., row, column] = sign * v[..., axis]
        cross[..., column, row] = -sign * v[..., axis]
    small = angle < SMALL_ANGLE_RAD
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) - first * cross + second * (cross @ cross)


def to_tangent_covariance(covariance: ArrayLike, vector: ArrayLike, reference: ArrayLike) -> Floats:
    """Convert a covariance about the world's axes to that of a rotation vector (3,).

    `covariance` is (3, 3) [rad^2], of small rotations as in ROS; `reference` is a unit quaternion.
    """
    quaternion = from_tangent(vector, reference)
    change = np.linalg.solve(right_jacobian(vector), rotation_matrix(quaternion).T)
    turned = change @ np.asarray(covariance, dtype=np.float64) @ change.T
    return 0.5 * (turned + turned.T)


def rotation_matrix(quaternion: ArrayLike) -> Floats:
    """Rotation matrix (3, 3) of a unit quaternion (4,) xyzw."""
    x, y, z, w = np.asarray(quaternion, dtype=np.float64)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def homogeneous(rotations: ArrayLike, positions: ArrayLike) -> Floats:
    """Homogeneous transforms (..., 4, 4) of rotations (..., 3, 3) and positions (..., 3) [m]."""
    positions = np.asarray(positions, dtype=np.float64)
    poses = np.zeros((*positions.shape[:-1], 4, 4))
    poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = rotations, positions, 1.0
    return poses


def quaternion_rates(quaternions: Floats, vectors: ArrayLike, rates: ArrayLike) -> Floats:
    """Time derivatives (..., 4) of quaternions xyzw, from the rates (..., 3) of their vectors.

    `quaternions` and `vectors` are as in `from_tangent`; all rates are per second.
    """
    turn = np.einsum("...ij,...j->...i", right_jacobian(vectors), np.asarray(rates))
    xyz, w = quaternions[..., :3], quaternions[..., 3:]
    return 0.5 * np.concatenate(
        [w * turn + np.cross(xyz, turn), -np.sum(xyz * turn, axis=-1, keepdims=True)], axis=-1
    )
