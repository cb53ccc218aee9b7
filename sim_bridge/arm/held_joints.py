# SPDX-License-Identifier: Apache-2.0
"""Moving joints beside the chain of an arm, such as fingers, held by PyBullet's own motors."""

from collections.abc import Sequence

import numpy as np

from sim_bridge.arm.urdf_loading import Joint
from sim_bridge.physics import BulletClient, pybullet


class HeldJoints:
    """Holds fingers as far from the middle as asked for, and others near zero."""

    def __init__(self, client: BulletClient, body: int, joints: Sequence[Joint]) -> None:
        self._client, self._body, self._joints = client, body, joints
        self.names = tuple(joint.name for joint in joints)
        self._half_width_m = np.inf

    def positions(self) -> list[float]:
        """Where they are [rad or m]."""
        numbers = [joint.number for joint in self._joints]
        states = self._client.getJointStates(self._body, numbers) if numbers else ()
        return [state[0] for state in states]

    def set_gripper(self, half_width_m: float = np.inf) -> None:
        """Bring each finger so far from the middle, or open them; nothing without fingers."""
        self._half_width_m = half_width_m
        self._hold()

    def reset(self) -> None:
        """Put them where they are held."""
        for joint in self._joints:
            self._client.resetJointState(self._body, joint.number, self._held(joint), 0.0)
        self._hold()

    def _held(self, joint: Joint) -> float:
        slides = joint.kind == pybullet.JOINT_PRISMATIC
        wanted = joint.lower + self._half_width_m if slides else 0.0
        return min(max(wanted, joint.lower), joint.upper) if joint.lower < joint.upper else 0.0

    def _hold(self) -> None:
        for joint in self._joints:
            self._client.setJointMotorControl2(
                self._body,
                joint.number,
                pybullet.POSITION_CONTROL,
                targetPosition=self._held(joint),
                force=20.0,
            )
