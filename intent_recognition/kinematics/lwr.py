# SPDX-License-Identifier: Apache-2.0
"""The KUKA LWR 4+: joint names, Denavit-Hartenberg parameters and limits.

Lengths, position, velocity and torque limits are those of the public models (kuka-isir/rtt_lwr,
CentroEPiaggio/kuka-lwr).
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics.limits import JointLimits

N_JOINTS = 7
"""Joints of the arm."""
JOINT_NAMES: tuple[str, ...] = tuple(f"lwr_a{i}_joint" for i in range(1, N_JOINTS + 1))
DEFAULT_ACCELERATION_RAD_S2 = 8.0
"""Acceleration limit of every joint [rad/s^2]. Convention: KUKA publishes none."""


class DHParameters(NamedTuple):
    """Standard DH parameters, arrays of shape (n_joints,).

    Frame i is frame i-1 times Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i); here a is zero throughout.
    """

    d_m: Floats
    alpha_rad: Floats


DH = DHParameters(
    d_m=np.array([0.3105, 0.0, 0.400, 0.0, 0.390, 0.0, 0.078]),
    alpha_rad=np.radians([90.0, -90.0, -90.0, 90.0, 90.0, -90.0, 0.0]),
)
SHOULDER_HEIGHT_M = float(DH.d_m[0])
UPPER_ARM_M = float(DH.d_m[2])
FOREARM_M = float(DH.d_m[4])
HAND_OFFSET_M = float(DH.d_m[6])
_LARGEST_RAD = np.radians([170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 170.0])
LWR_LIMITS = JointLimits(
    lower=-_LARGEST_RAD,
    upper=_LARGEST_RAD,
    velocity=np.radians([110.0, 110.0, 128.0, 128.0, 204.0, 184.0, 184.0]),
    acceleration=np.full(N_JOINTS, DEFAULT_ACCELERATION_RAD_S2),
    torque=np.array([176.0, 176.0, 100.0, 100.0, 100.0, 38.0, 38.0]),
)
