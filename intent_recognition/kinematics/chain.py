# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics of any chain of joints, batched over joint vectors.

A joint is a fixed pose in its parent's frame, followed by a turn about an axis or a shift along it,
as in a URDF.
"""

from functools import reduce
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats


class Chain(NamedTuple):
    """n joints, from the base on; those that do not move are among them.

    Values of joints are in rad or m; those of fixed joints do not count.

    Attributes:
        origins: poses in the frame of the joint before, (n, 4, 4) [m].
        turns: axes of revolute joints, unit vectors, zero for the others, (n, 3).
        shifts: axes of prismatic joints, alike, (n, 3).
    """

    origins: Floats
    turns: Floats
    shifts: Floats


def tip_positions(chain: Chain, values: Floats) -> Floats:
    """Positions of the last joint's frame in the base frame, (T, 3) [m], for values (T, n)."""
    values = np.asarray(values, dtype=np.float64)
    tips = np.zeros((len(values), 3))
    for joint in reversed(range(len(chain.origins))):
        moved = Rotation.from_rotvec(values[:, joint, None] * chain.turns[joint]).apply(tips)
        moved += values[:, joint, None] * chain.shifts[joint]
        origin = chain.origins[joint]
        tips = moved @ origin[:3, :3].T + origin[:3, 3]
    return tips


def tip_pose(chain: Chain, values: Floats) -> Floats:
    """Pose of the last joint's frame in the base frame, (4, 4) [m], for values (n,)."""
    wxyz, positions = joint_poses(chain, values)
    local = np.tile(np.eye(4), (len(wxyz), 1, 1))
    local[:, :3, :3] = Rotation.from_quat(np.roll(wxyz, -1, axis=1)).as_matrix()
    local[:, :3, 3] = positions
    return reduce(np.matmul, local, np.eye(4))


def joint_poses(chain: Chain, values: Floats) -> tuple[Floats, Floats]:
    """Where each joint's frame is in that of its parent: quaternions wxyz (n, 4), positions (n, 3).

    For values (n,); the joints need not follow one another.
    """
    values = np.asarray(values, dtype=np.float64)[:, None]
    rotations = Rotation.from_matrix(chain.origins[:, :3, :3])
    turned = rotations * Rotation.from_rotvec(values * chain.turns)
    positions = chain.origins[:, :3, 3] + rotations.apply(values * chain.shifts)
    return np.roll(turned.as_quat(), 1, axis=1), positions
