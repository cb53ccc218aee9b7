# SPDX-License-Identifier: Apache-2.0
"""The KUKA LWR 4+: joint names, Denavit-Hartenberg parameters, limits and forward kinematics.

Lengths, position, velocity and torque limits are those of the public models (kuka-isir/rtt_lwr,
CentroEPiaggio/kuka-lwr).
"""

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ShapeError
from intent_recognition.kinematics.limits import JointLimits

JOINT_NAMES: tuple[str, ...] = tuple(f"lwr_a{i}_joint" for i in range(1, 8))
N_JOINTS = len(JOINT_NAMES)
DEFAULT_ACCELERATION_RAD_S2 = 8.0
"""Acceleration limit of every joint [rad/s^2], assumed because KUKA publishes none."""

SHOULDER_HEIGHT_M, UPPER_ARM_M, FOREARM_M, HAND_OFFSET_M = 0.3105, 0.400, 0.390, 0.078
D_M = np.array([SHOULDER_HEIGHT_M, 0.0, UPPER_ARM_M, 0.0, FOREARM_M, 0.0, HAND_OFFSET_M])
ALPHA_RAD = np.radians([90.0, -90.0, -90.0, 90.0, 90.0, -90.0, 0.0])
"""Standard Denavit-Hartenberg parameters with `D_M`, (7,): frame i is frame i-1 times Rz(q_i)
Tz(d_i) Tx(a_i) Rx(alpha_i), where every a_i is zero."""
_LARGEST_RAD = np.radians([170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 170.0])
LWR_LIMITS = JointLimits(
    lower=-_LARGEST_RAD,
    upper=_LARGEST_RAD,
    velocity=np.radians([110.0, 110.0, 128.0, 128.0, 204.0, 184.0, 184.0]),
    acceleration=np.full(N_JOINTS, DEFAULT_ACCELERATION_RAD_S2),
    torque=np.array([176.0, 176.0, 100.0, 100.0, 100.0, 38.0, 38.0]),
)

_COS_ALPHA = np.round(np.cos(ALPHA_RAD))  # all angles are multiples of 90 degrees: exact
_SIN_ALPHA = np.round(np.sin(ALPHA_RAD))


def joint_vector(q: ArrayLike, argument: str = "q") -> Floats:
    """Return q as float64 of shape (..., 7), or raise ShapeError."""
    array = np.asarray(q, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != N_JOINTS:
        cure = "Give seven joint angles in rad."
        raise ShapeError.about(argument, "shape (..., 7)", array.shape, cure)
    return array


def frame_poses(q: ArrayLike) -> Floats:
    """Return the poses of frames 0..7 in the base frame, (..., 8, 4, 4), for q (..., 7) [rad]."""
    q = joint_vector(q)
    cos, sin = np.cos(q), np.sin(q)
    step = np.zeros((*q.shape, 4, 4))
    step[..., 0, 0] = cos
    step[..., 0, 1] = -sin * _COS_ALPHA
    step[..., 0, 2] = sin * _SIN_ALPHA
    step[..., 1, 0] = sin
    step[..., 1, 1] = cos * _COS_ALPHA
    step[..., 1, 2] = -cos * _SIN_ALPHA
    step[..., 2, 1] = _SIN_ALPHA
    step[..., 2, 2] = _COS_ALPHA
    step[..., 2, 3] = D_M
    step[..., 3, 3] = 1.0
    poses = np.empty((*q.shape[:-1], N_JOINTS + 1, 4, 4))
    poses[..., 0, :, :] = np.eye(4)
    for i in range(N_JOINTS):
        poses[..., i + 1, :, :] = poses[..., i, :, :] @ step[..., i, :, :]
    return poses


def forward_kinematics(q: ArrayLike) -> Floats:
    """Return the hand's pose in the base frame, shape (..., 4, 4), for q (..., 7) [rad]."""
    return frame_poses(q)[..., N_JOINTS, :, :]


def hand_position(q: ArrayLike) -> Floats:
    """Return the hand's position in the base frame, shape (..., 3) [m], for q (..., 7) [rad]."""
    return forward_kinematics(q)[..., :3, 3]


def jacobian(q: ArrayLike) -> Floats:
    """Return the geometric Jacobian in base axes, shape (..., 6, 7), of joints (..., 7) [rad].

    Rows 0-2 map joint velocities to the linear velocity [m/s] of the hand, rows 3-5 to its angular
    velocity [rad/s].
    """
    poses = frame_poses(q)
    axes = poses[..., :N_JOINTS, :3, 2]
    origins = poses[..., :N_JOINTS, :3, 3]
    tip = poses[..., N_JOINTS, :3, 3]
    linear = np.cross(axes, tip[..., None, :] - origins)
    return np.swapaxes(np.concatenate([linear, axes], axis=-1), -1, -2)
