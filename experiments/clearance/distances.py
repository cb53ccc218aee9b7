# SPDX-License-Identifier: Apache-2.0
"""How near an arm comes to boxes by PyBullet's own collision queries, without physics."""

from collections.abc import Sequence
from contextlib import AbstractContextManager

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Box
from sim_bridge.arm import Robot, add_box, load_urdf
from sim_bridge.physics import end_world, start_world

_FAR_M = 10.0
"""Nothing in a cell is farther than this [m]."""


class BulletCell(AbstractContextManager["BulletCell"]):
    """An arm and boxes, in the frame of the world, in a physics world of their own."""

    def __init__(self, robot: Robot, boxes: Sequence[Box]) -> None:
        self._client = client = start_world()
        self._arm = load_urdf(client, robot.urdf, robot.base_position_m)
        joints = range(client.getNumJoints(self._arm))
        infos = [client.getJointInfo(self._arm, k) for k in joints]
        numbers = {info[1].decode(): info[0] for info in infos}
        self._joints = [numbers[name] for name in robot.joint_names]
        self._links = {info[12].decode(): info[0] for info in infos}
        self._boxes = [add_box(client, box) for box in boxes]

    def __exit__(self, *_: object) -> None:
        """End the world."""
        end_world(self._client)

    def distances_m(self, q: Floats) -> dict[str, float]:
        """Of each link with a shape from the nearest box, negative inside, at a posture (n,)."""
        for joint, value in zip(self._joints, q, strict=True):
            self._client.resetJointState(self._arm, joint, value)
        found: dict[str, float] = {}
        for name, link in self._links.items():
            near = [
                point[8]
                for box in self._boxes
                for point in self._client.getClosestPoints(self._arm, box, _FAR_M, linkIndexA=link)
            ]
            if near:
                found[name] = min(near)
        return found
