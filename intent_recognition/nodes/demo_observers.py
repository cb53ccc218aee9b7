# SPDX-License-Identifier: Apache-2.0
"""Nodes that log what the cell does while a recording is played, or during a pour."""

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import DofEntry
from intent_recognition.errors import MessageError
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import joint_values, message_class
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.runtime import now_ns
from intent_recognition.nodes.warped_primitive import OBJECTS, REFUSED, REQUEST


class RecordingObserver(Node):
    """Logs the active task and the posture of some joints of the arm during each recording.

    A recording begins with its first observed sample. `task` is its first active task, and
    `posture` the newest posture (n,), NaN before the first. `held` is the posture farthest from
    the initial one while a task was active; None without one.
    """

    def __init__(self, entry: DofEntry, joints: Sequence[str], **kwargs: Any) -> None:
        super().__init__("recording_observer", **kwargs)
        self._joints, self.posture = joints, np.full(len(joints), np.nan)
        self._forget = self.create_client(Trigger, "intent_estimator/reset")
        self.begin()
        take = self.create_subscription
        take(message_class(entry.type), entry.topic.lstrip("/"), self._begun, qos.SENSOR, raw=True)
        take(String, "intent/active_task", self._take_active, qos.LATCHED)
        take(JointState, "joint_states", self._take_joints, qos.MEASURED)

    def begin(self) -> None:
        """Clear the log and reset the estimator, before another recording."""
        self.task, self.active = "", False
        self.held: Floats | None = None
        self._before, self._farthest = self.posture, 0.0
        self._began_ns = self._acted_ns = 0
        if self._forget.service_is_ready():
            self._forget.call_async(Trigger.Request())

    @property
    def acted_s(self) -> float:
        """Time from the first sample to the active task [s]; NaN without one."""
        return (self._acted_ns - self._began_ns) * 1e-9 if self.task else np.nan

    def _begun(self, _: bytes) -> None:
        self._began_ns = self._began_ns or now_ns(self)

    def _take_active(self, message: String) -> None:
        if message.data and self._began_ns and not self.task:
            self.task, self._acted_ns = message.data, now_ns(self)
        self.active = bool(message.data)

    def _take_joints(self, message: JointState) -> None:
        with suppress(MessageError):  # of other joints, such as the gripper's
            self.posture = joint_values(message, self._joints)
            distance = float(np.linalg.norm(self.posture - self._before))
            if self.active and self.task and distance > self._farthest:
                self._farthest, self.held = distance, self.posture


class PouringObserver(Node):
    """Collects the topics of one pour; `refused` says why it was refused, empty if it was not."""

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
            min(self._heard.values()) >= 2  # then the cup's lip point faces the other container
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
