# SPDX-License-Identifier: Apache-2.0
"""The bodies of the toolbox assembly: plate, screw and screwdriver, and who holds them.

An object is fixed to whoever holds it by a constraint: to its stand, to the arm's hand, or to the
worker's hand, which is a body without mass that is put where the worker is.
"""

from collections.abc import Iterable
from enum import Enum

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from sim_bridge.arm import SimulatedArm
from sim_bridge.coworker import HOLD, PLATE, SCREW, TASKS
from sim_bridge.physics import fix, pybullet
from sim_bridge.scenarios.toolbox import STANDS_M, stand_pose

OBJECT_MASS_KG = {PLATE: 0.4, SCREW: 0.02, HOLD: 0.3}
"""The object of each task: a plate, a screw, a screwdriver."""
# Where an object's centre is in the hand frame, and half its edges there.
_GRASP_M = {PLATE: (0.0, 0.0, 0.09), SCREW: (0.0, 0.0, 0.03), HOLD: (0.0, 0.0, 0.05)}
_HALF_EDGES_M = {
    PLATE: (0.06, 0.004, 0.08),
    SCREW: (0.004, 0.004, 0.012),
    HOLD: (0.1, 0.014, 0.014),
}
_COLOURS = {PLATE: (0.2, 0.4, 0.8, 1.0), SCREW: (0.9, 0.5, 0.1, 1.0), HOLD: (0.2, 0.7, 0.3, 1.0)}
_NO_TURN = (0.0, 0.0, 0.0, 1.0)
"""Quaternion xyzw of no rotation."""


Rgba = tuple[float, float, float, float]
"""Red, green, blue and opacity, each 0 to 1."""


class ObjectHolder(Enum):
    """Who holds an object."""

    STAND = "stand"
    ROBOT = "robot"
    WORKER = "worker"


class ToolboxObjects:
    """Plate, screw and screwdriver as bodies with mass in the world of an arm at its origin."""

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm
        self._client = arm.client
        self._constraints: dict[str, int | None] = dict.fromkeys(TASKS)
        self.holders: dict[str, ObjectHolder] = {}
        self.worker = self._body(0.0, pybullet.GEOM_SPHERE, (0.035,), (0.9, 0.7, 0.6, 1.0))
        self.bodies = {
            task: self._body(
                OBJECT_MASS_KG[task], pybullet.GEOM_BOX, _HALF_EDGES_M[task], _COLOURS[task]
            )
            for task in TASKS
        }
        self.move_worker(np.array([1.1, 0.0, 0.27]))
        for task in TASKS:
            self.put_back(task)

    def move_worker(self, position_m: Floats) -> None:
        """Put the worker's hand at a position (3,) in the world."""
        self._client.resetBasePositionAndOrientation(
            self.worker, [float(value) for value in position_m], _NO_TURN
        )

    def position(self, task: str) -> Floats:
        """Where the centre of a task's object is (3,), world."""
        return np.array(self._client.getBasePositionAndOrientation(self.bodies[task])[0])

    def put_back(self, task: str) -> None:
        """Put plate or screw back into its stand, the screwdriver onto its place on the bench."""
        body = self.bodies[task]
        self._let_go(task)
        if task in STANDS_M:
            target = stand_pose(task)
            centre = target[:3, 3] + target[:3, :3] @ np.array(_GRASP_M[task])
            self._place(body, centre, Rotation.from_matrix(target[:3, :3]).as_quat())
        else:
            self._place(body, (0.98, 0.32, 0.085), _NO_TURN)
        self._fix(task, -1, -1)
        self.holders[task] = ObjectHolder.STAND

    def worker_brings(self, task: str) -> None:
        """Put a task's object into the worker's hand, as the screwdriver that is handed over."""
        body = self.bodies[task]
        self._let_go(task)
        position, _ = self._client.getBasePositionAndOrientation(self.worker)
        self._place(body, np.array(position) - np.array([0.1, 0.0, 0.0]), _NO_TURN)
        self._fix(task, self.worker, -1)
        self.holders[task] = ObjectHolder.WORKER

    def give_to_robot(self, task: str) -> None:
        """Fix a task's object in the arm's hand, and let the arm carry its weight."""
        body = self.bodies[task]
        self._let_go(task)
        position, orientation = self._arm.hand_pose()
        centre, turn = self._client.multiplyTransforms(
            position.tolist(), orientation.tolist(), _GRASP_M[task], _NO_TURN
        )
        self._place(body, centre, turn)
        self._fix(task, self._arm.body, self._arm.hand_link)
        self._arm.set_payload(OBJECT_MASS_KG[task], _GRASP_M[task])
        self.holders[task] = ObjectHolder.ROBOT

    def give_to_worker(self, task: str) -> None:
        """Release a task's object from the arm: the worker has it now."""
        self._let_go(task)
        self._fix(task, self.worker, -1)
        self._arm.set_payload(0.0)
        self.holders[task] = ObjectHolder.WORKER

    def _body(self, mass_kg: float, shape: int, size: tuple[float, ...], colour: Rgba) -> int:
        key = "radius" if shape == pybullet.GEOM_SPHERE else "halfExtents"
        value = size[0] if shape == pybullet.GEOM_SPHERE else list(size)
        collision = self._client.createCollisionShape(shape, **{key: value})
        visual = self._client.createVisualShape(shape, rgbaColor=colour, **{key: value})
        body = self._client.createMultiBody(mass_kg, collision, visual)
        self._client.setCollisionFilterGroupMask(body, -1, 0, 0)
        self._client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
        return body

    def _place(self, body: int, position: Iterable[float], orientation: Iterable[float]) -> None:
        self._client.resetBasePositionAndOrientation(
            body, [float(value) for value in position], [float(value) for value in orientation]
        )
        self._client.resetBaseVelocity(body, [0.0] * 3, [0.0] * 3)

    def _fix(self, task: str, parent: int, link: int) -> None:
        self._constraints[task] = fix(self._client, self.bodies[task], parent, link)

    def _let_go(self, task: str) -> None:
        constraint = self._constraints[task]
        if constraint is not None:
            self._client.removeConstraint(constraint)
            self._constraints[task] = None
