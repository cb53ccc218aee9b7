# SPDX-License-Identifier: Apache-2.0
"""Does a grasp hold? A hand takes a container from the table, lifts it and waits.

The hand comes along the approach, closes, and goes straight up. Table, container, palm and
fingers collide: a finger that comes down on the rim pushes the container over.
"""

from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from experiments.grasps.gripper import BACK_M, FINGERS, SPEED_M_S, Gripper
from experiments.grasps.shells import shell_pieces
from intent_recognition.array_types import Floats
from intent_recognition.warping import Grasp
from sim_bridge import GRAVITY_M_S2
from sim_bridge.balls import write_obj
from sim_bridge.physics import end_world, start_world

STEP_S = 1.0 / 480.0
"""Physics step [s]: half of PyBullet's default, so that a grip of thin walls is calm."""
SOLVER_ITERATIONS = 100
"""Iterations of the contact solver: a grip needs more than falling bodies."""
FRICTION = 0.6
"""Friction of a container on pads and table: dry rubber on glazed stoneware has 0.6 to 1."""
DENSITY_KG_M3 = 2400.0
"""Density of every container, that of stoneware [kg/m^3]; plastic and paper are lighter."""
CLOSE_S, HOLD_S, SETTLE_S = 0.7, 2.0, 0.3
"""Time to close, to hold, and to come to rest after each way [s]."""
LIFT_M = 0.12
"""Height to which the hand lifts [m]."""
LOOK_S = 0.02
"""Time between two looks at what touches what [s]."""


class Lifted(NamedTuple):
    """What became of a container.

    Attributes:
        held: during all of `HOLD_S` both fingers touched it and the table did not.
        tipped_rad: how far it turned in the hand since the fingers closed.
        pushed_m: how far it had been moved on the table before they closed.
    """

    held: bool
    tipped_rad: float
    pushed_m: float


class LiftingWorld(AbstractContextManager["LiftingWorld"]):
    """A table with one container on it. Use as a context: leaving it ends the world.

    Args:
        mesh: of the container in metres, z up; the table is below it where it is.
        friction: of the container with the hand and with the table.

    Raises:
        ArgumentError: the mesh is no open container.
    """

    def __init__(self, mesh: trimesh.Trimesh, friction: float = FRICTION) -> None:
        pieces = shell_pieces(mesh)
        masses = DENSITY_KG_M3 * np.array([ConvexHull(piece).volume for piece in pieces])
        middles = np.array([piece.mean(0) for piece in pieces])
        self.mass_kg = float(masses.sum())
        self._centre = masses @ middles / self.mass_kg
        squares = masses @ (middles - self._centre) ** 2
        self._inertia = (squares.sum() - squares).tolist()
        self._table_m = float(min(piece[:, 2].min() for piece in pieces))
        self._friction = friction
        self._folder = TemporaryDirectory(prefix="lifting_")
        self._shape = Path(self._folder.name) / "container.obj"
        write_obj(pieces, self._shape)
        self.client = start_world()

    def lift(self, grasp: Grasp) -> Lifted:
        """Take the container by a grasp in its own coordinates, lift it and hold it."""
        container, table = self._begin()
        hand = Gripper(self.client, grasp, STEP_S, 1.0)
        hand.move(0.0, 0.0, SETTLE_S, closed=False)
        stood, _ = self._pose(container)
        hand.move(BACK_M, 0.0, BACK_M / SPEED_M_S + SETTLE_S, closed=False)
        pushed = float(np.linalg.norm(self._pose(container)[0] - stood))
        hand.move(BACK_M, 0.0, CLOSE_S, closed=True)
        _, gripped = hand.seen_from_palm(*self._pose(container))
        hand.move(BACK_M, LIFT_M, LIFT_M / SPEED_M_S + SETTLE_S, closed=True)
        held, left = True, round(HOLD_S / LOOK_S)
        while held and left:
            hand.move(BACK_M, LIFT_M, LOOK_S, closed=True)
            stands = self.client.getContactPoints(container, table)
            held, left = hand.touching(container) >= set(FINGERS) and not stands, left - 1
        _, last = hand.seen_from_palm(*self._pose(container))
        return Lifted(held, float((last * gripped.inv()).magnitude()), pushed)

    def _begin(self) -> tuple[int, int]:
        """A fresh world with container and table: a lift depends on nothing before it."""
        client = self.client
        client.resetSimulation()
        client.setTimeStep(STEP_S)
        client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
        client.setPhysicsEngineParameter(numSolverIterations=SOLVER_ITERATIONS)
        plane = client.createCollisionShape(client.GEOM_PLANE)
        table = client.createMultiBody(0.0, plane, basePosition=[0.0, 0.0, self._table_m])
        shape = client.createCollisionShape(client.GEOM_MESH, fileName=str(self._shape))
        container = client.createMultiBody(
            self.mass_kg, shape, baseInertialFramePosition=self._centre.tolist()
        )
        client.changeDynamics(
            container, -1, lateralFriction=self._friction, localInertiaDiagonal=self._inertia
        )
        client.changeDynamics(table, -1, lateralFriction=1.0)
        return container, table

    def _pose(self, body: int) -> tuple[Floats, Rotation]:
        where, turn = self.client.getBasePositionAndOrientation(body)
        return np.array(where), Rotation.from_quat(turn)

    def __exit__(self, *_: object) -> None:
        """End the world."""
        end_world(self.client)
        self._folder.cleanup()
