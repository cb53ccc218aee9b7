# SPDX-License-Identifier: Apache-2.0
"""A box that is handed over: a body with mass and friction, on which a person's hand acts."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from sim_bridge.arm import TIME_STEP_S
from sim_bridge.handover.grip import CompliantHand
from sim_bridge.physics import BulletClient, pybullet

FRICTION = 0.6
"""Friction coefficient of objects on the pads, as of rubber on plastic."""
HELD_SHARE = 0.7
"""Distance from an object's centre at which the person holds it, as a share of its half length."""
LEVEL = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Rotation of the level hand, whose z points along x and whose y along y of the world."""
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
"""Quaternion xyzw of an object in a level hand."""


class TransferObject(NamedTuple):
    """A box that is handed over."""

    mass_kg: float
    # half edges: vertical, between the fingers, and from robot to person
    half_edges_m: tuple[float, float, float]
    grasp_m: float  # distance from the centre, toward the robot, at which the robot holds it


class HandedThing:
    """The body of an object in a world, with its centre (3,) and orientation (4,), xyzw."""

    def __init__(
        self,
        client: BulletClient,
        what: TransferObject,
        centre_m: Floats,
        turn: Floats = UPRIGHT,
        friction: float = FRICTION,
    ) -> None:
        self._client, self.what = client, what
        up, across, along = what.half_edges_m
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[along, across, up])
        self.body = client.createMultiBody(what.mass_kg, shape, basePosition=centre_m.tolist())
        self.put(centre_m, turn)
        self.set_friction(friction)
        client.changeDynamics(self.body, -1, linearDamping=0.0, angularDamping=0.0)

    def set_friction(self, friction: float) -> None:
        """Change the friction."""
        self._client.changeDynamics(self.body, -1, lateralFriction=friction)

    def put(self, centre_m: Floats, turn: Floats = UPRIGHT) -> None:
        """Put the object somewhere, at rest."""
        at = centre_m.tolist(), turn.tolist()
        self._client.resetBasePositionAndOrientation(self.body, *at)
        self._client.resetBaseVelocity(self.body, [0.0] * 3, [0.0] * 3)

    def pose(self) -> tuple[Floats, Floats]:
        """Centre (3,) and orientation (4,), xyzw, of the object."""
        position, turn = self._client.getBasePositionAndOrientation(self.body)
        return np.array(position), np.array(turn)

    def speed_m_s(self) -> Floats:
        """Velocity of the object's centre (3,)."""
        return np.array(self._client.getBaseVelocity(self.body)[0])

    def held_point(self) -> tuple[Floats, Floats]:
        """Point at which a person holds the object (3,), and its orientation (4,)."""
        centre, turn = self.pose()
        return centre + self._lever(turn), turn

    def act(self, hand: CompliantHand) -> None:
        """Let a hand act on the object in the next step."""
        point, turn = self.held_point()
        moving, spin = (np.array(v) for v in self._client.getBaseVelocity(self.body))
        force, torque = hand.step(
            TIME_STEP_S,
            point,
            moving + _cross(spin, self._lever(turn)),
            turn,
            spin,
            self.what.mass_kg,
        )
        if hand.holds:
            # the wrist keeps level the weight that the hand lifts
            torque -= _cross(self._lever(turn), np.array([0.0, 0.0, hand.lift_n]))
            at, world = (self.body, -1), pybullet.WORLD_FRAME
            self._client.applyExternalForce(*at, force.tolist(), point.tolist(), world)
            self._client.applyExternalTorque(*at, torque.tolist(), world)

    def _lever(self, turn: Floats) -> Floats:
        matrix = np.reshape(self._client.getMatrixFromQuaternion(turn.tolist()), (3, 3))
        return matrix[:, 0] * HELD_SHARE * self.what.half_edges_m[2]


def in_grip(what: TransferObject, grip_m: Floats, grip_turn: Floats) -> tuple[Floats, Floats]:
    """Centre (3,) and orientation (4,), xyzw, of an object in a grip with a given pose."""
    hand = Rotation.from_quat(grip_turn)
    turn = hand * Rotation.from_matrix(LEVEL).inv()
    return grip_m + what.grasp_m * hand.as_matrix()[:, 2], turn.as_quat()


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of two vectors (3,), ten times as fast as numpy's."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
