# SPDX-License-Identifier: Apache-2.0
"""An arm with which a scenario was not taught: its home posture, and positions of its hand."""

from functools import cached_property

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Arm
from sim_bridge.arm import Robot
from sim_bridge.scenarios.toolbox.scene import HOME_HAND_M


class ToolboxArm:
    """Kinematics of an arm whose hand waits at a place (3,), world."""

    def __init__(self, robot: Robot, home_m: Floats = HOME_HAND_M):
        self.robot, self._home_m = robot, home_m
        self._arm = Arm.from_urdf(robot.description, base="world", tip=robot.tip, rest=robot.ready)

    @cached_property
    def home(self) -> Floats:
        """Posture with the hand at its waiting place, near the ready posture (n,) [rad].

        Raises:
            KinematicsError: the place is out of reach.
        """
        return self._arm.inverse_kinematics(self._home_m)

    def n_reached(self, places_m: Floats) -> int:
        """Number of places (n, 3), world, that the hand reaches to 1 cm."""
        near = (self._arm.nearest(place, self.home).distance_m for place in places_m)
        return sum(distance_m <= 0.01 for distance_m in near)

    def hand(self, q: Floats) -> Floats:
        """Positions of the hand in the world (..., 3) [m] for measured joints, fingers last."""
        return self._arm.forward_kinematics(q[..., : self.robot.n_joints])[..., :3, 3]
