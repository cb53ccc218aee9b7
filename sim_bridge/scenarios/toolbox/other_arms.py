# SPDX-License-Identifier: Apache-2.0
"""The toolbox with an arm that it was not taught with: its home, and where its hand is."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics import Arm
from sim_bridge.arm import Robot
from sim_bridge.scenarios.toolbox.scene import HOME_HAND_M


class ToolboxArm:
    """What the toolbox needs to know of an arm.

    Args:
        robot: the arm, and where it stands.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self._arm = Arm.from_urdf(robot.description, base="world", tip=robot.tip, rest=robot.ready)

    @cached_property
    def home(self) -> NDArray[np.float64]:
        """Posture with the hand where every interaction starts, near the ready one (n,) [rad].

        Raises:
            KinematicsError: it is out of reach.
        """
        return self._arm.inverse_kinematics(HOME_HAND_M)

    def hand(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of the hand in the world (..., 3) [m] for measured joints, fingers last."""
        return self._arm.forward_kinematics(q[..., : self.robot.n_joints])[..., :3, 3]
