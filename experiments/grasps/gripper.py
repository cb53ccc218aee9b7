# SPDX-License-Identifier: Apache-2.0
"""A hand of boxes with two parallel fingers, as large and strong as the Franka Hand.

Its four joints slide: along the approach, straight up, and one for each finger. A gear keeps both
fingers at the same distance from the middle.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.warping import Grasp
from sim_bridge.physics import BulletClient

FORCE_N = 40.0
"""Force of each finger [N]; the Franka Hand holds 70 N continuously."""
MAX_OPENING_M = 0.08
"""How far the hand can open [m], as the Franka Hand."""
CLEARANCE_M = 0.01
"""Distance of an open finger from the surface that its pad will touch [m]: a few times the error
of a scan, and little beside a cup."""
PAD_M = (0.020, 0.008, 0.018)
"""Width, thickness and length of a pad [m], as the Franka Hand's."""
FINGER_M = 0.05
"""From a fingertip to the palm [m]."""
PALM_M = (0.06, 0.20, 0.07)
"""Width, length along the closing direction, and depth of the palm [m]."""
BACK_M = 0.10
"""Distance behind the grasp at which the hand starts [m]."""
SPEED_M_S = 0.15
"""Speed of the hand [m/s]."""
CLOSING_M_S = 0.04
"""Speed of each closing finger [m/s]."""
STRONG_N = 500.0
"""Largest force of the joints that move the hand [N]: much more than they need."""
MASSES_KG = (0.5, 0.7, 0.1, 0.1)
"""Mass that each joint moves [kg]: a carriage, the palm, the fingers."""
PALM, FINGERS = 1, (2, 3)
"""Links of the hand."""
_ZERO, _STILL = [0.0] * 3, [0.0, 0.0, 0.0, 1.0]


class Gripper:
    """The hand, behind a grasp and open.

    Args:
        client: of the world; the hand is put into it.
        grasp: in the world's coordinates [m], z up.
        step_s: of the physics.
        friction: of its pads; that of a contact is the product of both bodies'.
    """

    def __init__(self, client: BulletClient, grasp: Grasp, step_s: float, friction: float) -> None:
        self._client, self._step_s = client, step_s
        turn = grasp.pose[:3, :3]
        behind = -0.5 * PALM_M[2] - FINGER_M + 0.5 * PAD_M[2]
        palm = self._box(PALM_M, [0.0, 0.0, behind])
        finger = (PAD_M[0], PAD_M[1], FINGER_M)
        pads = [
            self._box(finger, [0.0, side * 0.5 * PAD_M[1], 0.5 * (PAD_M[2] - FINGER_M)])
            for side in (1.0, -1.0)
        ]
        n = len(MASSES_KG)
        up = turn.T @ [0.0, 0.0, 1.0]
        self.body: int = client.createMultiBody(
            0.0,
            basePosition=(grasp.centre - BACK_M * grasp.approach).tolist(),
            baseOrientation=Rotation.from_matrix(turn).as_quat().tolist(),
            linkMasses=list(MASSES_KG),
            linkCollisionShapeIndices=[-1, palm, *pads],
            linkVisualShapeIndices=[-1] * n,
            linkPositions=[_ZERO] * n,
            linkOrientations=[_STILL] * n,
            linkInertialFramePositions=[_ZERO] * n,
            linkInertialFrameOrientations=[_STILL] * n,
            linkParentIndices=[0, 1, 2, 2],
            linkJointTypes=[client.JOINT_PRISMATIC] * n,
            linkJointAxis=[[0.0, 0.0, 1.0], up.tolist(), [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]],
        )
        for link in range(n):
            client.changeDynamics(self.body, link, lateralFriction=friction, linearDamping=0.0)
        gear = client.createConstraint(
            self.body, FINGERS[0], self.body, FINGERS[1], client.JOINT_GEAR, [0.0, 1.0, 0.0],
            _ZERO, _ZERO,
        )  # fmt: skip
        client.changeConstraint(gear, gearRatio=-1, erp=0.2, maxForce=STRONG_N)
        self._opening = min(0.5 * grasp.width_m + CLEARANCE_M, 0.5 * MAX_OPENING_M)
        for link in FINGERS:
            client.resetJointState(self.body, link, self._opening)
        self._targets = np.zeros(2)

    def move(self, ahead_m: float, up_m: float, duration_s: float, *, closed: bool) -> None:
        """Let time pass while the hand goes along the approach and up, counted from its start.

        Closed, the fingers press with all their force.
        """
        client, reach = self._client, SPEED_M_S * self._step_s
        for _ in range(round(duration_s / self._step_s)):
            self._targets += np.clip([ahead_m, up_m] - self._targets, -reach, reach)
            for link, target in enumerate(self._targets.tolist()):
                client.setJointMotorControl2(
                    self.body, link, client.POSITION_CONTROL, target, force=STRONG_N
                )
            for link in FINGERS:
                mode = client.VELOCITY_CONTROL if closed else client.POSITION_CONTROL
                aim = (
                    {"targetVelocity": -CLOSING_M_S}
                    if closed
                    else {"targetPosition": self._opening}
                )
                client.setJointMotorControl2(self.body, link, mode, force=FORCE_N, **aim)
            client.stepSimulation()

    def touching(self, body: int) -> set[int]:
        """Links of the hand that touch a body."""
        return {contact[3] for contact in self._client.getContactPoints(self.body, body)}

    def seen_from_palm(self, position: Floats, turn: Rotation) -> tuple[Floats, Rotation]:
        """A pose in the world as one in the axes of the palm."""
        state = self._client.getLinkState(self.body, PALM)
        palm = Rotation.from_quat(state[5]).inv()
        return palm.apply(position - np.array(state[4])), palm * turn

    def _box(self, sides_m: tuple[float, ...], centre_m: list[float]) -> int:
        shape: int = self._client.createCollisionShape(
            self._client.GEOM_BOX,
            halfExtents=[0.5 * side for side in sides_m],
            collisionFramePosition=centre_m,
        )
        return shape
