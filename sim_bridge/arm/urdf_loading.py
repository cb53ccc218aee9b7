# SPDX-License-Identifier: Apache-2.0
"""Bringing a URDF text into a PyBullet world, with its joints free for torque control."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pybullet
from pybullet_utils.bullet_client import BulletClient

from intent_recognition.kinematics import JOINT_NAMES, N_JOINTS
from sim_bridge.arm.urdf import HAND_LINK


def load_urdf(client: BulletClient, urdf: str, base_position_m: tuple[float, float, float]) -> int:
    """Load a URDF text with a fixed base and its own inertias; return PyBullet's body id."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "lwr.urdf"
        path.write_text(urdf, encoding="utf-8")
        return client.loadURDF(
            str(path),
            basePosition=base_position_m,
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
        )


def free_joints(client: BulletClient, body: int) -> tuple[list[int], int]:
    """Free the joints of PyBullet's motors and damping; return their indices and the hand's."""
    joints: dict[str, int] = {}
    hand = -1
    for index in range(client.getNumJoints(body)):
        info = client.getJointInfo(body, index)
        joints[info[1].decode()] = index
        if info[12].decode() == HAND_LINK:
            hand = index
    indices = [joints[name] for name in JOINT_NAMES]
    client.setJointMotorControlArray(
        body, indices, pybullet.VELOCITY_CONTROL, forces=[0.0] * N_JOINTS
    )
    for index in range(-1, client.getNumJoints(body)):
        client.changeDynamics(body, index, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
    return indices, hand
