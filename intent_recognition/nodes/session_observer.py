# SPDX-License-Identifier: Apache-2.0
"""Node: subscribes to the topics of a session and logs them; simulated time waits for it."""

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import MessageError
from intent_recognition.evaluation import ContactLog, SessionLog, TransferLog
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array, stamp_ns, trajectory_arrays
from intent_recognition.nodes.diagnostics import answer_of
from intent_recognition.nodes.runtime import now_ns
from intent_recognition.promp import NONE
from intent_recognition.registry import ANSWERS

EVERY_PATH_NS = 100_000_000
"""Time between two predictions that are kept [ns]. Convention."""


class SessionObserver(Node):
    """Collects the topics of a toolbox session until `log` is asked for.

    Args:
        on_task: called with (ground truth label, or "" at the end of a movement).
        on_active: called with the active task whenever it changes.
    """

    def __init__(
        self, on_task: Callable[[str], None], on_active: Callable[[str], None], **kwargs: Any
    ) -> None:
        super().__init__("session_observer", **kwargs)
        self._on_active = on_active
        self._labels: tuple[str, ...] = (NONE,)
        self._wrist: list[tuple[int, NDArray[np.float64]]] = []
        self._tasks: list[tuple[int, NDArray[np.float64]]] = []
        self._active: list[tuple[int, str]] = []
        self._joints: list[tuple[int, NDArray[np.float64]]] = []
        self._predictions: list[tuple] = []
        self._paths: list[tuple[int, NDArray[np.float64]]] = []
        self._contacts: list[tuple[int, str, NDArray[np.float64]]] = []
        self._transfers: list[tuple[int, str, NDArray[np.float64]]] = []
        topics = (
            (PoseStamped, "mocap/wrist/pose", self._take_wrist, qos.SENSOR),
            (JointState, "intent/tasks", self._take_tasks, qos.STATE),
            (String, "intent/active_task", self._take_active, qos.LATCHED),
            (JointState, "joint_states", self._take_joints, qos.MEASURED),
            (JointTrajectory, "intent/robot_trajectory", self._take_prediction, qos.COMMAND),
            (Path, "intent/human_path", self._take_path, qos.COMMAND),
            (String, "coworker/task", lambda message: on_task(message.data), qos.STATE),
            (JointState, "coworker/hand", partial(self._keep, self._contacts, 3), qos.STATE),
            (JointState, "intent/transfer", partial(self._keep, self._transfers, 5), qos.STATE),
        )
        self._heard: Counter[str] = Counter()
        self._answers = self.create_publisher(JointState, ANSWERS, qos.FEEDBACK)
        self._inputs = [
            self.create_subscription(kind, topic, partial(self._take, topic, take), profile)
            for kind, topic, take, profile in topics
        ]

    def _take(self, topic: str, take: Callable[[Any], None], message: Any) -> None:
        """Take a message, and tell those whose time waits for it."""
        take(message)
        self._heard[topic] += 1
        self._answers.publish(answer_of(self.get_name(), self._heard))

    def close(self) -> None:
        """Unsubscribe: what comes after the session is not part of it."""
        while self._inputs:
            self.destroy_subscription(self._inputs.pop())
        self._answers.publish(answer_of(self.get_name(), {}))

    def graph_is_complete(self) -> bool:
        """Whether the nodes that must run before the human moves have found one another."""
        return (
            self.count_subscribers("mocap/wrist/pose") >= 2
            and self.count_publishers("human/wrist") >= 1
            and self.count_subscribers("human/wrist") >= 1
            and self.count_subscribers("intent/tasks") >= 2
            and self.count_subscribers("joint_trajectory") >= 1
            and self.count_publishers("joint_trajectory") >= 1
            and self.count_subscribers("joint_states") >= 3
            and bool(self._joints)
        )

    def log(self) -> SessionLog:
        """Everything so far, as arrays."""
        wrist_ns, wrist = _columns(self._wrist, 3)
        tasks_ns, probabilities = _columns(self._tasks, len(self._labels))
        joint_ns, joints = _columns(self._joints, len(self._joints[0][1]) if self._joints else 7)
        return SessionLog(
            self._labels,
            wrist_ns,
            wrist,
            tasks_ns,
            probabilities,
            np.array([stamp for stamp, _ in self._active], dtype=np.int64),
            tuple(task for _, task in self._active),
            joint_ns,
            joints,
            tuple(self._predictions),
            tuple(self._paths),
            ContactLog(*_states(self._contacts, 3)),
            TransferLog(*_states(self._transfers, 5)),
        )

    def _take_wrist(self, message: PoseStamped) -> None:
        self._wrist.append((stamp_ns(message), position_array(message.pose)))

    def _take_tasks(self, message: JointState) -> None:
        if len(message.position) != len(message.name):
            return
        if not self._tasks:
            self._labels = tuple(message.name)
        row = np.array(message.position)
        if tuple(message.name) != self._labels:  # a task was taught, or taken back
            by_label = dict(zip(message.name, message.position, strict=True))
            row = np.array([by_label.get(label, 0.0) for label in self._labels])
        self._tasks.append((stamp_ns(message), row))

    def _take_active(self, message: String) -> None:
        if self._active or message.data:
            self._active.append((now_ns(self), message.data))
        self._on_active(message.data)

    def _take_joints(self, message: JointState) -> None:
        positions = np.array(message.position)
        if not self._joints or self._joints[0][1].shape == positions.shape:
            self._joints.append((stamp_ns(message), positions))

    def _take_prediction(self, message: JointTrajectory) -> None:
        now = now_ns(self)
        if self._predictions and now - self._predictions[-1][0] < EVERY_PATH_NS:
            return
        try:
            times, positions, others = trajectory_arrays(message)
            std = others["effort"]
        except (MessageError, KeyError):
            return  # none of the estimator's
        self._predictions.append(
            (now, stamp_ns(message), message.header.frame_id, times, positions, std)
        )

    def _take_path(self, message: Path) -> None:
        now = now_ns(self)
        if not self._paths or now - self._paths[-1][0] >= EVERY_PATH_NS:
            points = np.array([position_array(pose.pose) for pose in message.poses])
            self._paths.append((now, points))

    def _keep(
        self, rows: list[tuple[int, str, NDArray[np.float64]]], width: int, message: JointState
    ) -> None:
        if len(message.position) == width:
            rows.append((stamp_ns(message), message.header.frame_id, np.array(message.position)))


def _columns(
    rows: list[tuple[int, NDArray[np.float64]]], width: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
    return stamps, np.array([row for _, row in rows]).reshape(len(rows), width)


def _states(
    rows: list[tuple[int, str, NDArray[np.float64]]], width: int
) -> tuple[NDArray[np.int64], tuple[str, ...], NDArray[np.float64]]:
    stamps, values = _columns([(stamp, row) for stamp, _, row in rows], width)
    return stamps, tuple(state for _, state, _ in rows), values
