# SPDX-License-Identifier: Apache-2.0
"""An arm with fingers, an object with mass and friction, a stand, and a person's hand.

World frame: the arm's base at the origin, x toward the person, z up. The hand is level and points
along x; its fingers close along y. The person's hand acts on the object by forces; it has no body.
"""

from contextlib import AbstractContextManager

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Arm
from sim_bridge.arm import SensorNoise, SimulatedArm, find_robot
from sim_bridge.handover import (
    FRICTION,
    LEVEL,
    CompliantHand,
    Fingers,
    HandedThing,
    TransferObject,
    with_fingers,
)
from sim_bridge.physics import pybullet

STAND_M = (0.02, 0.02, 0.01)
"""Half edges of the stand below an object [m]."""
WAY_POINTS = 10
"""Points of a straight way of the grip: some 3 cm apart."""
JUMP_RAD = 0.6
"""Turn of a joint between two of them that changes its branch [rad]; 0.41 was measured without."""
OBJECTS = {
    "box": TransferObject(0.1, (0.02, 0.015, 0.05), 0.015),
    "plate": TransferObject(0.4, (0.06, 0.004, 0.05), 0.015),
    "bottle": TransferObject(0.8, (0.10, 0.03, 0.035), 0.005),
    "rod": TransferObject(0.12, (0.012, 0.012, 0.2), 0.15),
}
"""What is handed over, by name."""


class TransferCell(AbstractContextManager["TransferCell"]):
    """The physics. Use as a context: leaving it ends the world.

    Args:
        robot: name of the arm.
        thing: the object.
        place_m: where the arm's grip is when the object is on its stand (3,).
        rng: of the sensors' noise.
        friction: of the object on the pads.
    """

    def __init__(
        self,
        robot: str,
        thing: TransferObject,
        place_m: Floats,
        rng: np.random.Generator,
        friction: float = FRICTION,
    ) -> None:
        found = with_fingers(find_robot(robot))
        self.model = Arm.from_urdf(found.urdf, tip=found.tip, rest=found.ready)
        self.thing, self.push_n = thing, np.zeros(3)
        self.person: CompliantHand | None = None
        self.home = self.posture(place_m)
        self.arm = SimulatedArm(self.home, robot=found, noise=SensorNoise(), rng=rng)
        self.fingers = Fingers(self.arm)
        client = self.arm.client
        centre = place_m + [thing.grasp_m, 0.0, 0.0]
        self.held = HandedThing(client, thing, centre, friction=friction)
        self.body = self.held.body
        below = centre - [0.0, 0.0, thing.half_edges_m[0] + STAND_M[2]]
        stand = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=STAND_M)
        self.stand = client.createMultiBody(0.0, stand, basePosition=below.tolist())
        for link in range(-1, client.getNumJoints(self.arm.body)):
            client.setCollisionFilterPair(self.arm.body, self.stand, link, -1, 0)
        self.arm.before_step.append(self._act)

    def posture(self, grip_m: Floats) -> Floats:
        """Joint angles (n,) with the level hand's grip at a place (3,), or nearest to it."""
        return self._nearest(grip_m, None)

    def way(self, begin: Floats, to_m: Floats) -> Floats:
        """Joint angles (k, n) that bring the level hand's grip straight from a posture to (3,).

        It stops where the arm would have to change its branch.
        """
        begin_m = self.model.forward_kinematics(begin)[:3, 3]
        way = [begin]
        for place_m in np.linspace(begin_m, to_m, WAY_POINTS)[1:]:
            q = self._nearest(place_m, way[-1])
            if np.abs(q - way[-1]).max() > JUMP_RAD:
                break
            way.append(q)
        return np.array([*way, way[-1]] if len(way) == 1 else way)

    def _nearest(self, grip_m: Floats, seed: Floats | None) -> Floats:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = LEVEL, grip_m
        return self.model.nearest(pose, seed, seed).q

    def grip_m(self) -> Floats:
        """Where the arm's grip is (3,), world."""
        return self.arm.hand_pose().position

    def __exit__(self, *_: object) -> None:
        """End the world."""
        self.arm.close()

    def _act(self, arm: SimulatedArm) -> None:
        """Let the person and a bump act on the object in the coming step."""
        client, body = arm.client, self.body
        if self.push_n.any():
            at = client.getBasePositionAndOrientation(body)[0]
            client.applyExternalForce(body, -1, self.push_n.tolist(), at, pybullet.WORLD_FRAME)
        if self.person is not None:
            self.held.act(self.person)
