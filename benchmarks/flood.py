# SPDX-License-Identifier: Apache-2.0
"""A driver that runs wild: `intent/tasks` after a flood of joint states, nodes as processes.

`python -m benchmarks.flood MODEL [SECONDS]` floods for so long.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from benchmarks.measure import Result, at_most
from benchmarks.offline import model_file
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_joint_state, to_pose, to_stamp
from intent_recognition.nodes.diagnostics import Readiness
from intent_recognition.nodes.processes import NodeProcesses, node_environment
from intent_recognition.nodes.runtime import make_executor, spin_until
from intent_recognition.promp import TaskLibrary

FLOOD_HZ, FLOOD_S = 10_000.0, 120.0
POSE_HZ = 100.0
READY_S, CURRENT_S = 60.0, 120.0
"""Longest waits: for the nodes, and for a current estimate after the flood [s]."""
RECOGNITION = ("mocap_ingest", "intent_estimator", "primitive_activation")


def flood(library: TaskLibrary, seconds: float = FLOOD_S) -> Iterator[Result]:
    """How long after the flood the estimate is of the newest pose again."""
    with model_file(library) as model:
        lag_s, sent, largest_s = after_flood(model, seconds, model.parent / "logs")
    remark = f"{sent / seconds:.0f} joint states a second for {seconds:.0f} s, poses at 100 Hz"
    yield at_most("intent/tasks current after a flood", lag_s, 1.0, "s", remark)
    remark = "age of the estimate, at most, while it lasted; no requirement"
    yield at_most("intent/tasks behind during a flood", largest_s, np.inf, "s", remark)


def after_flood(model: Path, seconds: float, logs: Path) -> tuple[float, int, float]:
    """Flood the nodes.

    Args:
        model: of the estimator.
        seconds: of the flood.
        logs: folder of the nodes' output.

    Returns:
        Time from its end to a current estimate [s], joint states sent, the largest age of the
        newest estimate meanwhile [s].
    """
    environment = node_environment(os.environ)
    os.environ.update(environment)
    rclpy.init(args=[])
    tracker = _Tracker()
    executor = make_executor()
    executor.add_node(tracker)
    try:
        with NodeProcesses(environment, logs) as nodes:
            for name in RECOGNITION:
                named = {} if name == "mocap_ingest" else {"model": model}
                nodes.start(name, f"intent_recognition.nodes.{name}", named)
            ready = Readiness(tracker, RECOGNITION)
            if not spin_until(executor, lambda: not ready.missing(), READY_S):
                raise TimeoutError(f"not ready: {ready.missing()}")
            command = [sys.executable, "-m", "benchmarks.flood", "--send", str(seconds)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
                spin_until(executor, lambda: driver.poll() is not None, seconds + READY_S)
                assert driver.stdout is not None
                sent, ended_ns = map(int, driver.stdout.read().split())
            spin_until(executor, lambda: tracker.newest_ns >= ended_ns, CURRENT_S)
            return (tracker.seen_ns(ended_ns) - ended_ns) * 1e-9, sent, tracker.largest_age_s
    finally:
        executor.shutdown()
        tracker.destroy_node()
        rclpy.try_shutdown()


class _Tracker(Node):
    """Publishes a resting wrist, and listens how old the estimates are."""

    def __init__(self) -> None:
        super().__init__("tracker")
        self.newest_ns, self.largest_age_s = 0, 0.0
        self._seen: list[tuple[int, int]] = []
        self._pose = to_pose(np.array([0.6, 0.0, 0.3]), np.array([0.0, 0.0, 0.0, 1.0]))
        self._poses = self.create_publisher(PoseStamped, "mocap/wrist/pose", qos.SENSOR)
        self.create_subscription(JointState, "intent/tasks", self._take, qos.STATE)
        self.create_timer(1.0 / POSE_HZ, self._publish)

    def _publish(self) -> None:
        message = PoseStamped(pose=self._pose)
        message.header.stamp, message.header.frame_id = to_stamp(time.time_ns()), "world"
        self._poses.publish(message)
        if self.newest_ns:
            self.largest_age_s = max(self.largest_age_s, (time.time_ns() - self.newest_ns) * 1e-9)

    def _take(self, message: JointState) -> None:
        stamp = message.header.stamp
        self.newest_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
        self._seen.append((self.newest_ns, time.time_ns()))

    def seen_ns(self, stamp_ns: int) -> int:
        """When the first estimate of this stamp or a later one came."""
        return next(now_ns for newest_ns, now_ns in self._seen if newest_ns >= stamp_ns)


def send(seconds: float) -> None:
    """Flood for so long; print how many were sent, and when the last one was [ns]."""
    rclpy.init()
    node = Node("wild_driver")
    states = node.create_publisher(JointState, "joint_states", qos.STATE)
    zeros = np.zeros(len(JOINT_NAMES))
    while not states.get_subscription_count():
        time.sleep(0.01)
    sent, start_s = 0, time.monotonic()
    while sent < seconds * FLOOD_HZ:
        data = serialize_message(to_joint_state(JOINT_NAMES, zeros, time_ns=time.time_ns()))
        due = int((time.monotonic() - start_s) * FLOOD_HZ)
        for _ in range(sent, due):
            states.publish(data)
        sent = due
        time.sleep(0.001)
    sys.stdout.write(f"{sent} {time.time_ns()}\n")
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__" and sys.argv[1] == "--send":
    send(float(sys.argv[2]))
elif __name__ == "__main__":
    length_s = float(sys.argv[2]) if len(sys.argv) > 2 else FLOOD_S
    found = after_flood(Path(sys.argv[1]), length_s, Path("out/flood"))
    sys.stdout.write("current after {:.2f} s; {} sent; behind by {:.2f} s\n".format(*found))
