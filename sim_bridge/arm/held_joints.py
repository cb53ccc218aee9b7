# SPDX-License-Identifier: Apache-2.0
"""Moving joints beside the chain of an arm, such as fingers, held by PyBullet's own motors."""

from collections.abc import Sequence

import numpy as np

from sim_bridge.arm.urdf_loading import Joint
from sim_bridge.physics import BulletClient, pybullet


class HeldJoints:
    """Holds fingers open, and others near zero."""

    def __init__(self, client: BulletClient, body: int, joints: Sequence[Joint]) -> None:
        self._client, self._body, self._joints = client, body, joints
        self.names = tuple(joint.name for joint in joints)

    def positions(self) -> list[float]:
        """Where they are [rad or m]."""
        numbers = [joint.number for joint in self._joints]
        states = self._client.getJointStates(self._body, numbers) if numbers else ()
        return [state[0] for state in states]

    def reset(self) -> None:
        """Put them where they are held."""
        for joint in self._joints:
            held = _held(joint)
            self._client.resetJointState(self._body, joint.number, held, 0.0)
            self._client.setJointMotorControl2(
                self._body, joint.number, pybullet.POSITION_CONTROL, targetPosition=held, force=20.0
            )


def _held(joint: Joint) -> float:
    wanted = np.inf if joint.kind == pybullet.JOINT_PRISMATIC else 0.0
    return min(max(wanted, joint.lower), joint.upper) if joint.lower < joint.upper else 0.0
