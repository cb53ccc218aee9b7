# SPDX-License-Identifier: Apache-2.0
"""What the running nodes take, from a pose to the robot's trajectory.

All nodes share one process and one executor, as the relay they are compared with: two bare rclpy
nodes that answer every pose with an odometry message and that with a trajectory of the same size.
Poses go through both in turn, one at a time, the next when the last is answered; who comes first
changes from pose to pose, so that neither finds the processor's caches as the other left them.
"""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks.measure import Result, at_most
from benchmarks.offline import model_file
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    OdometryBuilder,
    TrajectoryBuilder,
    stamp_ns,
    to_pose,
    to_stamp,
)
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.runtime import make_executor, settle
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration
from intent_recognition.tracking import TrackedPose

N_POINTS, N_JOINTS = 50, 7
ANSWER_TIMEOUT_S = 0.05
FAST_HZ, FAST_S = 1000.0, 2.5
FRESH_S = 0.05


def node(library: TaskLibrary, recordings: list[Demonstration]) -> Iterator[Result]:
    """Latency beside a bare relay, and whether 1 kHz of input is kept up with."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    rclpy.init(args=["--ros-args", "--log-level", "error"])
    try:
        with model_file(library) as model:
            yield from _latency(model, recordings)
            yield from _keeping_up(model, recordings[0])
    finally:
        rclpy.try_shutdown()


class _Graph:
    """Some nodes on one executor, spun until something has happened."""

    def __init__(self, *nodes: Node):
        self.nodes = nodes
        self.executor = make_executor()
        for one in nodes:
            self.executor.add_node(one)

    def spin_until(self, happened: Callable[[], bool], timeout_s: float) -> bool:
        end_s = time.perf_counter() + timeout_s
        while not happened():
            left_s = end_s - time.perf_counter()
            if left_s <= 0:
                return False
            self.executor.spin_once(timeout_sec=left_s)
        return True

    def close(self) -> None:
        for one in self.nodes:
            self.executor.remove_node(one)
            one.destroy_node()
        self.executor.shutdown()


@dataclass
class _Chain:
    """Poses in, trajectories out: counts what comes and when."""

    probe: Node
    pose_topic: str
    trajectory_topic: str
    arrivals: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.publisher = self.probe.create_publisher(PoseStamped, self.pose_topic, qos.SENSOR)
        self.probe.create_subscription(
            JointTrajectory, self.trajectory_topic, self._on_trajectory, qos.COMMAND
        )

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.arrivals.append(time.perf_counter())

    def ask(self, graph: _Graph, pose: PoseStamped) -> float | None:
        """Seconds from a pose to its trajectory, None if there is none."""
        before = len(self.arrivals)
        start_s = time.perf_counter()
        self.publisher.publish(pose)
        answered = graph.spin_until(lambda: len(self.arrivals) > before, ANSWER_TIMEOUT_S)
        return self.arrivals[-1] - start_s if answered else None


class _Relay(Node):
    """Answers each message with a ready one, as fast as rclpy can."""

    def __init__(
        self,
        name: str,
        kind: type,
        topic: str,
        in_qos: QoSProfile,
        answer: Any,
        out: str,
        out_qos: QoSProfile,
    ):
        super().__init__(name)
        self._answer = answer
        self._publisher = self.create_publisher(type(answer), out, out_qos)
        self.create_subscription(kind, topic, self._on_message, in_qos)

    def _on_message(self, message: Any) -> None:
        self._answer.header.stamp = message.header.stamp
        self._publisher.publish(self._answer)


def _relays() -> tuple[_Relay, _Relay]:
    odometry = Odometry(child_frame_id="wrist_world_aligned")
    odometry.header.frame_id = "world"
    builder = TrajectoryBuilder([f"lwr_a{i + 1}_joint" for i in range(N_JOINTS)])
    values = np.random.default_rng(0).normal(size=(N_POINTS, N_JOINTS))
    trajectory = builder.build(1, np.linspace(0.0, 3.0, N_POINTS), values, values, values)
    first = _Relay(
        "relay_pose", PoseStamped, "relay/pose", qos.SENSOR, odometry, "relay/human", qos.SENSOR
    )
    second = _Relay(
        "relay_human",
        Odometry,
        "relay/human",
        qos.SENSOR,
        trajectory,
        "relay/trajectory",
        qos.COMMAND,
    )
    return first, second


def _estimator(model: Path, publish_rate: float) -> IntentEstimatorNode:
    return IntentEstimatorNode(
        parameter_overrides=[
            Parameter("model", Parameter.Type.STRING, str(model)),
            Parameter("publish_rate", Parameter.Type.DOUBLE, publish_rate),
        ]
    )


def _poses(recorded: Demonstration, first_ns: int) -> Iterator[PoseStamped]:
    """The recorded poses, the first at another stamp."""
    (signal,) = recorded.observed
    shift_ns = first_ns - int(signal.stamps_ns[0])
    for measured_ns, position in zip(signal.stamps_ns, signal.values, strict=True):
        yield _pose(int(measured_ns) + shift_ns, position)


def _pose(stamp_ns: int, position: np.ndarray) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp = to_stamp(stamp_ns)
    message.header.frame_id = "world"
    message.pose = to_pose(position, np.array([0.0, 0.0, 0.0, 1.0]))
    return message


def _latency(model: Path, recordings: list[Demonstration]) -> Iterator[Result]:
    probe = Node("probe")
    ours = _Chain(probe, "mocap/wrist/pose", "intent/robot_trajectory")
    bare = _Chain(probe, "relay/pose", "relay/trajectory")
    graph = _Graph(probe, MocapIngest(), _estimator(model, 1000.0), *_relays())
    try:
        graph.spin_until(lambda: ours.publisher.get_subscription_count() > 0, 5.0)
        graph.spin_until(lambda: bare.publisher.get_subscription_count() > 0, 5.0)
        graph.spin_until(lambda: False, 0.5)
        settle()
        times: tuple[list[float], list[float]] = ([], [])
        unanswered = asked = 0
        first_ns = 1_000_000_000
        for recorded in recordings:
            moving = False
            for pose in _poses(recorded, first_ns):
                if moving:
                    asked += 1
                    chains = (ours, bare) if asked % 2 else (bare, ours)
                    answers = [chain.ask(graph, pose) for chain in chains]
                    took_s = [one for one in answers if one is not None]
                    if len(took_s) < len(answers):
                        unanswered += 1
                    else:
                        for kept, one in zip(times, took_s[:: 1 if asked % 2 else -1], strict=True):
                            kept.append(one)
                else:
                    before = len(ours.arrivals)
                    ours.publisher.publish(pose)
                    graph.spin_until(lambda: False, 0.002)
                    moving = len(ours.arrivals) > before
            first_ns += int(recorded.end_ns - recorded.start_ns) + 3_000_000_000
        yield from _ratios(*times, unanswered)
    finally:
        graph.close()


def _ratios(ours: list[float], bare: list[float], unanswered: int) -> Iterator[Result]:
    for name, percentile, required in (("p50", 50, 2.5), ("p99", 99, 3.0)):
        mine, relay = (1e6 * np.percentile(times, percentile) for times in (ours, bare))
        yield at_most(
            f"pose to trajectory, {name}, a bare relay takes 1",
            float(mine / relay),
            required,
            "x",
            f"{mine:.0f} and {relay:.0f} us over {len(ours)} poses, by the wall clock;"
            f" {unanswered} others not answered by both in {1e3 * ANSWER_TIMEOUT_S:.0f} ms",
        )


def _keeping_up(model: Path, recorded: Demonstration) -> Iterator[Result]:
    """Poses at 1 kHz by the wall clock: how old the newest estimate is, and what was dropped."""
    probe = Node("probe")
    estimator = _estimator(model, 25.0)
    publisher = probe.create_publisher(Odometry, "human/wrist", qos.SENSOR)
    ages: list[float] = []

    def on_tasks(message: JointState) -> None:
        ages.append(time.time() - stamp_ns(message) * 1e-9)

    probe.create_subscription(JointState, "intent/tasks", on_tasks, qos.STATE)
    graph = _Graph(probe, estimator)
    try:
        graph.spin_until(lambda: publisher.get_subscription_count() > 0, 5.0)
        (signal,) = recorded.observed
        seconds = signal.seconds(int(signal.stamps_ns[0]))
        at_s = np.arange(int(FAST_S * FAST_HZ) + 1) / FAST_HZ
        path = np.stack([np.interp(at_s, seconds, c) for c in signal.values.T], axis=1)
        covariance, builder = 4e-6 * np.eye(3), OdometryBuilder("wrist", "world")
        sent, start_s = 0, time.time()
        while (now_s := time.time() - start_s) < FAST_S:
            while sent < now_s * FAST_HZ:
                stamp = round((start_s + at_s[sent]) * 1e9)
                turn = np.array([0.0, 0.0, 0.0, 1.0])
                pose = TrackedPose(stamp, path[sent], turn, True, covariance)
                publisher.publish(builder.build(pose, 4e-4))
                sent += 1
            graph.executor.spin_once(timeout_sec=0.0005)
        late = float(np.percentile(ages[len(ages) // 2 :], 99)) if ages else float("inf")
        yield at_most(
            f"age of an estimate at {FAST_HZ:.0f} Hz of input, p99",
            1e3 * late,
            1e3 * FRESH_S,
            "ms",
            f"{len(ages)} estimates of {sent} poses,"
            f" {estimator._diagnostics.rejected('dropped_behind')} counted as dropped",
        )
    finally:
        graph.close()
