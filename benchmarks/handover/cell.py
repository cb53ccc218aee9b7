# SPDX-License-Identifier: Apache-2.0
"""An arm with fingers, an object with mass and friction, a stand, and a person's hand.

World frame: the arm's base at the origin, x toward the person, z up. The hand is level and points
along x; its fingers close along y. The person's hand acts on the object by forces; it has no body.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.handover.fingers import Fingers, with_fingers
from benchmarks.handover.grip import CompliantHand
from intent_recognition.kinematics import Arm
from sim_bridge.arm import TIME_STEP_S, SensorNoise, SimulatedArm, find_robot
from sim_bridge.physics import pybullet

FRICTION = 0.6
"""Of objects on the pads: rubber on plastic."""
LEVEL = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Rotation of the level hand: its z along x, its y along y."""
STAND_M = (0.02, 0.02, 0.01)
"""Half edges of the stand below an object [m]. Convention: narrower than the objects."""
WAY_POINTS = 10
"""Points of a straight way of the grip. Convention: 3 cm apart."""
JUMP_RAD = 0.6
"""Joints that turn by more between two of them change their branch [rad]. Measured: 0.41 if not."""


class TransferObject(NamedTuple):
    """A box that is handed over.

    Attributes:
        mass_kg: its mass.
        half_edges_m: vertical, between the fingers, and from robot to person.
        grasp_m: how far from its centre, toward the robot, the robot holds it.
    """

    mass_kg: float
    half_edges_m: tuple[float, float, float]
    grasp_m: float


OBJECTS = {
    "box": TransferObject(0.1, (0.02, 0.015, 0.05), 0.015),
    "plate": TransferObject(0.4, (0.06, 0.004, 0.05), 0.015),
    "bottle": TransferObject(0.8, (0.10, 0.03, 0.035), 0.005),
}
"""What is handed over, by name."""
HELD_SHARE = 0.7
"""Where the person holds an object: share of its half length from its centre. Convention."""


class TransferCell:
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
        place_m: NDArray[np.float64],
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
        half = self._world_edges()
        centre = place_m + [thing.grasp_m, 0.0, 0.0]
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half.tolist())
        self.body = client.createMultiBody(thing.mass_kg, shape, basePosition=centre.tolist())
        self.set_friction(friction)
        client.changeDynamics(self.body, -1, linearDamping=0.0, angularDamping=0.0)
        below = centre - [0.0, 0.0, half[2] + STAND_M[2]]
        stand = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=STAND_M)
        self.stand = client.createMultiBody(0.0, stand, basePosition=below.tolist())
        for link in range(-1, client.getNumJoints(self.arm.body)):
            client.setCollisionFilterPair(self.arm.body, self.stand, link, -1, 0)
        self.arm.before_step.append(self._act)

    def posture(self, grip_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint angles (n,) with the level hand's grip at a place (3,), or nearest to it."""
        return self._nearest(grip_m, None)

    def way(self, begin: NDArray[np.float64], to_m: NDArray[np.float64]) -> NDArray[np.float64]:
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

    def _nearest(
        self, grip_m: NDArray[np.float64], seed: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = LEVEL, grip_m
        return self.model.nearest(pose, seed, seed).q

    def set_friction(self, friction: float) -> None:
        """Change the friction of the object."""
        self.arm.client.changeDynamics(self.body, -1, lateralFriction=friction)

    def pose(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the object is: centre (3,) and quaternion (4,), xyzw."""
        position, turn = self.arm.client.getBasePositionAndOrientation(self.body)
        return np.array(position), np.array(turn)

    def put(self, centre_m: NDArray[np.float64]) -> None:
        """Put the object somewhere, at rest and upright."""
        client = self.arm.client
        client.resetBasePositionAndOrientation(self.body, centre_m.tolist(), [0.0, 0.0, 0.0, 1.0])
        client.resetBaseVelocity(self.body, [0.0] * 3, [0.0] * 3)

    def speed_m_s(self) -> NDArray[np.float64]:
        """Velocity of the object's centre (3,)."""
        return np.array(self.arm.client.getBaseVelocity(self.body)[0])

    def held_point(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where a person holds the object (3,), and its orientation (4,)."""
        centre, turn = self.pose()
        return centre + self._lever(turn), turn

    def grip_m(self) -> NDArray[np.float64]:
        """Where the arm's grip is (3,), world."""
        return self.arm.hand_pose().position

    def close(self) -> None:
        """End the world."""
        self.arm.close()

    def __enter__(self) -> "TransferCell":
        """Return the cell."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the world."""
        self.close()

    def _world_edges(self) -> NDArray[np.float64]:
        up, across, along = self.thing.half_edges_m
        return np.array([along, across, up])

    def _lever(self, turn: NDArray[np.float64]) -> NDArray[np.float64]:
        matrix = np.reshape(self.arm.client.getMatrixFromQuaternion(turn.tolist()), (3, 3))
        return matrix[:, 0] * HELD_SHARE * self.thing.half_edges_m[2]

    def _act(self, arm: SimulatedArm) -> None:
        """Let the person and a bump act on the object in the coming step."""
        client, body = arm.client, self.body
        if self.push_n.any():
            at = client.getBasePositionAndOrientation(body)[0]
            client.applyExternalForce(body, -1, self.push_n.tolist(), at, pybullet.WORLD_FRAME)
        if self.person is None:
            return
        point, turn = self.held_point()
        moving, spin = client.getBaseVelocity(body)
        force, torque = self.person.step(
            TIME_STEP_S,
            point,
            np.array(moving) + _cross(spin, self._lever(turn)),
            turn,
            np.array(spin),
            self.thing.mass_kg,
        )
        if self.person.holds:
            client.applyExternalForce(
                body, -1, force.tolist(), point.tolist(), pybullet.WORLD_FRAME
            )
            client.applyExternalTorque(body, -1, torque.tolist(), pybullet.WORLD_FRAME)


def _cross(a: Sequence[float], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """As numpy's cross, ten times as fast for one pair."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
