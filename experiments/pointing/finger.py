# SPDX-License-Identifier: Apache-2.0
"""The finger as a body in the arm's hand, and the table it points at."""

from scipy.spatial.transform import Rotation

from experiments.pointing.scene import CIRCLE_CENTRE_M, FINGER_LENGTH_M, TABLE_HEIGHT_M
from sim_bridge.arm import SimulatedArm
from sim_bridge.physics import fix, pybullet

FINGER_MASS_KG = 0.05
"""Mass of the rod [kg]."""
FINGER_RADIUS_M = 0.008
"""Radius of the rod [m]."""
_TABLE_HALF_M = (0.32, 0.45, 0.02)
"""Half the table's length, width and thickness [m]."""
_MIDDLE_M = (0.0, 0.0, 0.5 * FINGER_LENGTH_M)


class PointingBodies:
    """A rod fixed along the hand's z axis, its weight carried by the arm, and a table under it.

    The rod touches the table if it comes down to it; it ignores the arm, whose base must stand at
    the world's origin.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm, client = arm, arm.client
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=_TABLE_HALF_M)
        look = client.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=_TABLE_HALF_M, rgbaColor=(0.75, 0.65, 0.5, 1.0)
        )
        centre = (*CIRCLE_CENTRE_M, TABLE_HEIGHT_M - _TABLE_HALF_M[2])
        self.table = client.createMultiBody(0.0, shape, look, centre)
        rod = client.createCollisionShape(
            pybullet.GEOM_CAPSULE,
            radius=FINGER_RADIUS_M,
            height=FINGER_LENGTH_M - 2.0 * FINGER_RADIUS_M,
        )
        self.finger = client.createMultiBody(FINGER_MASS_KG, rod)
        client.changeDynamics(self.finger, -1, linearDamping=0.0, angularDamping=0.0)
        for link in range(-1, client.getNumJoints(arm.body)):
            client.setCollisionFilterPair(self.finger, arm.body, -1, link, 0)
        hand = arm.hand_pose()
        middle = hand.position + Rotation.from_quat(hand.orientation).apply(_MIDDLE_M)
        client.resetBasePositionAndOrientation(
            self.finger, middle.tolist(), hand.orientation.tolist()
        )
        fix(client, self.finger, arm.body, arm.hand_link)
        arm.set_payload(FINGER_MASS_KG, _MIDDLE_M)

    def touches(self) -> bool:
        """Whether finger or arm touch the table right now."""
        client = self._arm.client
        return bool(
            client.getContactPoints(bodyA=self.finger, bodyB=self.table)
            or client.getContactPoints(bodyA=self._arm.body, bodyB=self.table)
        )
