# SPDX-License-Identifier: Apache-2.0
"""The scene "pouring" of a simulated arm: containers and balls in its world, and their topics."""

from collections.abc import Callable

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.model import SPILLED
from intent_recognition.nodes.object_messages import to_labelled_cloud
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.qos import FEEDBACK, SENSOR, STATE
from sim_bridge.arm import SimulatedArm

POURING = "pouring"


class PouringScene:
    """Declares the scene's parameters; `begin` puts its objects into the arm's world.

    Out: `balls`, a named vector of counts; `cup/cloud` and `second/cloud` while no task is active;
    `intent/feedback`, the number of balls that an execution spilled.
    """

    held = "cup"

    def __init__(self, node: Node) -> None:
        self._node = node
        values = declare(node, "pouring_scene")
        self.cup = values["cup"]
        self.second = values["second"]
        self._opening = values["second_opening"]
        self._task = ""
        self._lay_beside = 0

    @property
    def posture(self) -> Floats:
        """Initial joint angles of the arm (7,) [rad]."""
        from sim_bridge.scenarios.pouring import start_posture

        return start_posture(self.cup)

    def begin(self, arm: SimulatedArm, seed: int, stamp: Callable[[], Time]) -> "PouringScene":
        """Put containers and balls into the world of an arm at rest in `posture`.

        Raises:
            ArgumentError: a container is unknown, or the place is not three numbers.
        """
        from sim_bridge.scenarios.pouring import LivePouring

        if len(self._opening) != 3:
            cure = "Give x, y and z in metres."
            raise ArgumentError.about("second_opening", "three numbers", self._opening, cure)
        self._arm, self._stamp = arm, stamp
        self._world = LivePouring(arm, self.cup, self.second, np.array(self._opening), seed)
        self._counts = self._node.create_publisher(JointState, "balls", STATE)
        self._feedback = self._node.create_publisher(DiagnosticStatus, "intent/feedback", FEEDBACK)
        self._clouds = [
            self._node.create_publisher(PointCloud2, f"{name}/cloud", SENSOR)
            for name in ("cup", "second")
        ]
        return self

    def set_task(self, task: str) -> None:
        """Set the task being executed, "" when idle; publish how much the one before spilled."""
        if task == self._task:
            return
        beside = self._world.look().spilled
        if self._task:
            spilled = KeyValue(key=SPILLED, value=str(beside - self._lay_beside))
            self._feedback.publish(DiagnosticStatus(name=self._task, values=[spilled]))
        self._task, self._lay_beside = task, beside

    def update(self) -> None:
        """Observe the balls and publish what is due; call this every few milliseconds."""
        counts, n = self._world.look(), self._arm.n_steps
        if n % 100:  # 0.1 s
            return
        header = Header(stamp=self._stamp(), frame_id="world")
        message = JointState(header=header, name=list(counts._fields))
        message.position = [float(value) for value in counts]
        self._counts.publish(message)
        if n % 1000 == 0 and not self._task:  # 1 s
            for publisher, cloud in zip(self._clouds, self._world.clouds(), strict=True):
                no_labels = np.zeros(len(cloud.points))
                publisher.publish(to_labelled_cloud(header, cloud.points, cloud.normals, no_labels))
