# SPDX-License-Identifier: Apache-2.0
"""Input of the arm on `robot_description`, for models that predict its hand instead of joints."""

from contextlib import suppress

from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.demonstrations import arm_in_world
from intent_recognition.errors import ArgumentError, describe
from intent_recognition.kinematics import Arm
from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import declare


def no_description(argument: str) -> str:
    """Error text for an argument that needs the arm's description before it has come."""
    return describe(argument, "a robot_description", "none", "Start robot_state_publisher.")


class HandInput:
    """Reads the arm when it is first needed, and again after another description has come.

    Attributes:
        link: link that is the hand; empty if none was named.
        description: text of the URDF; empty before it has come, or if it holds no arm.
        taught: link that the model names; it is the hand if `link` is empty and the arm has it.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._node, self._diagnostics, self.taught = node, diagnostics, ""
        self.link = declare(node, "hand")["hand_link"]
        self.description = ""
        self._arm: Arm | None = None
        diagnostics.subscribe(String, "robot_description", self._take, qos.LATCHED)

    @property
    def arm(self) -> Arm | None:
        """The arm; None before its description has come, or if that is unusable."""
        if self._arm is None and self.description:
            with self._diagnostics.rejecting("bad_robot_description"):
                self._arm = self._read()
                self._node.get_logger().info(f"the hand is {self._arm.tip}")
                return self._arm
            self.description = ""
        return self._arm

    def _read(self) -> Arm:
        if self.taught and not self.link:
            with suppress(ArgumentError):  # of another arm than the model's
                return arm_in_world(self.description, self.taught)
        return arm_in_world(self.description, self.link)

    def _take(self, message: String) -> None:
        if message.data != self.description:
            self.description, self._arm = message.data, None
