# SPDX-License-Identifier: Apache-2.0
"""Bringing a URDF text into a PyBullet world, with its joints free for torque control."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pybullet
from pybullet_utils.bullet_client import BulletClient

from intent_recognition.errors import ArgumentError, describe


class Joint(NamedTuple):
    """A joint that moves: PyBullet's number of it, name and type, and its limits [rad or m]."""

    number: int
    name: str
    kind: int
    lower: float
    upper: float


def load_urdf(client: BulletClient, urdf: str, base_position_m: tuple[float, float, float]) -> int:
    """Load a URDF text with a fixed base and its own inertias; return PyBullet's body id.

    Raises:
        ArgumentError: PyBullet cannot load it.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf, encoding="utf-8")
        try:
            return client.loadURDF(
                str(path),
                basePosition=base_position_m,
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            )
        except pybullet.error as error:
            cure = "Check it with check_urdf, and that its meshes can be read."
            raise ArgumentError(describe("robot", "a URDF", error, cure)) from error


def free_joints(
    client: BulletClient, body: int, names: Sequence[str], tip: str
) -> tuple[list[int], int, list[Joint]]:
    """Free joints of PyBullet's motors and damping.

    Args:
        client: the world.
        body: the arm.
        names: joints to free.
        tip: a link.

    Returns:
        Their indices, the link's, and all joints that move in PyBullet's order.
    """
    moving: list[Joint] = []
    hand = -1
    for index in range(client.getNumJoints(body)):
        info = client.getJointInfo(body, index)
        if info[2] != pybullet.JOINT_FIXED:
            moving.append(Joint(index, info[1].decode(), info[2], info[8], info[9]))
        if info[12].decode() == tip:
            hand = index
    by_name = {joint.name: joint.number for joint in moving}
    indices = [by_name[name] for name in names]
    client.setJointMotorControlArray(
        body, indices, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(indices)
    )
    for index in range(-1, client.getNumJoints(body)):
        client.changeDynamics(body, index, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
    return indices, hand, moving
