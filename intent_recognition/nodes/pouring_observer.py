# SPDX-License-Identifier: Apache-2.0
"""Node: asks for a pour, and takes down what the topics tell of it."""

from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.warped_primitive import OBJECTS, REFUSED, REQUEST

SETTLED = 2
"""Clouds of each container that are warped before a pour: from the second on the cup's lip is
toward the other one."""


class PouringObserver(Node):
    """Collects the topics of one pour.

    Attributes:
        parameters: newest warped parameters of each container, by name.
        balls: newest counts.
        active: the active task; empty when idle.
        refused: why the pour was refused; empty if it was not.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("pouring_observer", **kwargs)
        self.parameters: dict[str, dict[str, float]] = {}
        self.balls: dict[str, float] = {}
        self.active = self.refused = ""
        self._asked = False
        self._heard = dict.fromkeys(OBJECTS, 0)
        for name in OBJECTS:
            handle = partial(self._take_parameters, name)
            self.create_subscription(JointState, f"{name}/parameters", handle, qos.STATE)
        self.create_subscription(JointState, "balls", self._take_balls, qos.STATE)
        self.create_subscription(String, "intent/active_task", self._take_active, qos.LATCHED)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._take_reports, 10)
        self._pour = self.create_publisher(String, REQUEST, qos.STATE)

    def is_ready(self) -> bool:
        """Whether the containers were seen and the nodes have found one another."""
        return (
            min(self._heard.values()) >= SETTLED
            and bool(self.balls)
            and self._pour.get_subscription_count() >= 1
            and self.count_subscribers("intent/robot_trajectory") >= 1
            and self.count_subscribers("intent/tasks") >= 1
            and self.count_subscribers("joint_trajectory") >= 1
            and self.count_publishers("joint_trajectory") >= 1
        )

    def ask(self, amount: str) -> None:
        """Ask for a pour: "empty", "full" or millilitres."""
        self._asked = True
        self._pour.publish(String(data=amount))

    def _take_parameters(self, name: str, message: JointState) -> None:
        self.parameters[name] = dict(zip(message.name, message.position, strict=False))
        self._heard[name] += 1

    def _take_balls(self, message: JointState) -> None:
        self.balls = dict(zip(message.name, message.position, strict=False))

    def _take_active(self, message: String) -> None:
        self.active = message.data

    def _take_reports(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "warped_primitive":
                self.refused = values_of(status).get(REFUSED, "") if self._asked else ""
