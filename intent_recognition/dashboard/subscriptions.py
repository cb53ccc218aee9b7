# SPDX-License-Identifier: Apache-2.0
"""Topics of the cell into what the page knows."""

import time
from collections.abc import Callable

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.dashboard.cell import (
    CellState,
    NodeHealth,
    PathMarkers,
    Posterior,
    PredictedMotion,
)
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array

DEFAULT_BODY = "wrist"


class CellSubscriptions:
    """Subscribes with a node and fills a `CellState`.

    Args:
        node: owner of the subscriptions.
        state: what is filled.
        body: the tracked body that is drawn.
        clock: seconds, monotonic.
    """

    def __init__(
        self,
        node: Node,
        state: CellState,
        body: str = DEFAULT_BODY,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._state, self._clock = state, clock
        for kind, topic, handle, profile in (
            (JointState, "joint_states", self._on_joints, qos.STATE),
            (PoseStamped, f"mocap/{body}/pose", self._on_wrist, qos.SENSOR),
            (JointState, "intent/tasks", self._on_tasks, qos.STATE),
            (JointTrajectory, "intent/robot_trajectory", self._on_predicted, qos.COMMAND),
            (MarkerArray, "intent/markers", self._on_markers, qos.COMMAND),
            (String, "intent/active_task", self._on_active, qos.LATCHED),
            (String, "coworker/task", self._on_truth, qos.STATE),
            (String, "robot_description", self._on_description, qos.LATCHED),
            (String, "teach/status", self._on_teaching, qos.LATCHED),
            (DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        ):
            node.create_subscription(kind, topic, handle, profile)

    def _on_joints(self, message: JointState) -> None:
        self._state.take_joints(message.name, message.position, self._clock())

    def _on_wrist(self, message: PoseStamped) -> None:
        position = position_array(message.pose)
        if np.all(np.isfinite(position)):
            self._state.take_wrist(position, self._clock())

    def _on_tasks(self, message: JointState) -> None:
        posterior = Posterior(
            tuple(message.name), np.array(message.position), np.array(message.velocity)
        )
        self._state.take_posterior(posterior, self._clock())

    def _on_predicted(self, message: JointTrajectory) -> None:
        positions = np.array([point.positions for point in message.points])
        self._state.predicted = PredictedMotion(
            message.header.frame_id, tuple(message.joint_names), positions
        )
        self._state.predicted_at_s = self._clock()

    def _on_markers(self, message: MarkerArray) -> None:
        lines = [_points(m) for m in message.markers if m.type == Marker.LINE_STRIP]
        tubes = [_points(m) for m in message.markers if m.type == Marker.TRIANGLE_LIST]
        if len(lines) == 2 and len(tubes) == 1:
            self._state.drawn = PathMarkers(*lines, *tubes)
            self._state.drawn_at_s = self._clock()

    def _on_active(self, message: String) -> None:
        self._state.active = message.data

    def _on_truth(self, message: String) -> None:
        self._state.truth = message.data

    def _on_description(self, message: String) -> None:
        self._state.description = message.data

    def _on_teaching(self, message: String) -> None:
        self._state.teaching = message.data

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s = self._clock()
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self._state.nodes[status.name] = NodeHealth(
                status.level[0], status.message, values, now_s
            )


def _points(marker: Marker) -> NDArray[np.float64]:
    """Points of a marker (T, 3)."""
    return np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3)
