# SPDX-License-Identifier: Apache-2.0
"""A work cell for tests: a wrist shown to the nodes as fast as they take it, on simulated time."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags.reader import BagReader
from intent_recognition.kinematics.lwr import JOINT_NAMES, forward_kinematics
from intent_recognition.nodes import qos
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.conversions import joint_values, stamp_ns, to_pose, to_stamp
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from sim_bridge.scenarios.toolbox.scene import handover_point

LONGEST_STEP_S = 0.02


def n_taken(ingest: MocapIngest, estimator: IntentEstimatorNode) -> int:
    """Poses that have reached the estimator, and what the ingest refused."""
    totals = dict(estimator._diagnostics._totals)
    arrived = sum(n for stream, n in totals.items() if stream.startswith("human/"))
    return arrived + ingest._diagnostics._counts.total()


class PacedPlayer(BagPlayer):
    """Plays an observation when the one before has been taken: none is lost on the way.

    Args:
        topics: of the observations, as in the DOF file.
        ingest: takes them first.
        estimator: takes them in the end.
        kwargs: of the player.
    """

    def __init__(
        self, topics: set[str], ingest: MocapIngest, estimator: IntentEstimatorNode, **kwargs
    ):
        self._observed, self._chain, self._n_sent = topics, (ingest, estimator), 0
        super().__init__(**kwargs)

    def _publish(self, message, *when):
        super()._publish(message, *when)
        if message.topic.lstrip("/") not in self._observed:
            return
        self._n_sent += 1
        while n_taken(*self._chain) < self._n_sent:
            if self._stopping.wait(0.001):
                return


class PatientClock:
    """Real time [s], less what passes while someone is behind, and while nobody asks."""

    def __init__(self, behind: Callable[[], bool]):
        self._behind = behind
        self._now_s = self._asked_s = time.monotonic()

    def __call__(self) -> float:
        asked_s = time.monotonic()
        if not self._behind():
            self._now_s += min(asked_s - self._asked_s, LONGEST_STEP_S)
        self._asked_s = asked_s
        return self._now_s


POSES = "mocap/wrist/pose"
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
SECOND_NS = 1_000_000_000
START_DELAY_NS = SECOND_NS // 5


class Wrist(NamedTuple):
    """A wrist's way: times from its start (T,) [ns], positions (T, 3) [m], and what is known."""

    times_ns: np.ndarray
    positions: np.ndarray
    task: str = ""
    onset_ns: int = 0
    end_ns: int = 0
    handover: np.ndarray | None = None


def recorded(bag: Path, hold_s: float = 4.0) -> Wrist:
    """The wrist of a bag, which then holds still as it last did (its last 0.2 s on and on)."""
    reader = BagReader(bag)
    messages = [m.message for m in reader.messages([POSES])]
    stamps = np.array([stamp_ns(message) for message in messages])
    points = [m.pose.position for m in messages]
    positions = np.array([(p.x, p.y, p.z) for p in points])
    step_ns, n = 10_000_000, round(hold_s * 100)
    more = stamps[-1] + step_ns * np.arange(1, n + 1)
    again = positions[-20:][np.arange(n) % 20]
    data = reader.custom_data
    goal = np.array([float(x) for x in data["goal_m"].split()])
    return Wrist(
        np.r_[stamps, more] - stamps[0],
        np.vstack([positions, again]),
        data["task"],
        int(data["human_onset_ns"]) - int(stamps[0]),
        int(data["human_end_ns"]) - int(stamps[0]),
        handover_point(data["task"], goal),
    )


class Cell:
    """Listens to the whole graph, and moves the wrist as `/clock` goes on."""

    def __init__(self, harness):
        self.harness = harness
        self.now_ns = 0
        self.wrist: Wrist | None = None
        self.start_ns, self._next, self._n_sent = 0, 0, 0
        self.tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
        self.predictions = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
        self.commands = harness.collect(JointTrajectory, "joint_trajectory", qos.COMMAND)
        self.active = harness.collect(String, "intent/active_task", qos.LATCHED)
        self.states = harness.collect(JointState, "joint_states", qos.STATE)
        self._poses = harness.publisher(PoseStamped, POSES, qos.SENSOR)
        harness.probe.create_subscription(Clock, "/clock", self._on_clock, qos.STATE)

    def start_nodes(self, model: Path, factor: float) -> None:
        """All nodes in this process; simulated time waits for the observations to be taken."""
        from sim_bridge.nodes.lwr_sim import LwrSim  # needs PyBullet: replays do not

        node, simulated = self.harness.node, {"use_sim_time": True}
        named = simulated | {"model": str(model)}
        self.ingest = node(MocapIngest, **simulated)
        self.estimator = node(IntentEstimatorNode, **named)
        self.activation = node(PrimitiveActivation, hold_time=3.0, **named)
        self.arm = node(LwrSim, publish_clock=True, real_time_factor=factor)
        self.arm._now_s = PatientClock(self._behind)

    def _behind(self) -> bool:
        return n_taken(self.ingest, self.estimator) < self._n_sent

    def connect(self) -> None:
        """Wait until every topic of the chain has found its ends."""
        count = self.harness.probe.count_subscribers
        publishers = self.harness.probe.count_publishers
        needs = {"human/wrist": 1, "intent/tasks": 2, "intent/robot_trajectory": 2}
        needs |= {"joint_states": 2, "joint_trajectory": 2, POSES: 1}
        self.harness.spin_until(
            lambda: all(count(topic) >= n and publishers(topic) for topic, n in needs.items()),
            what="the graph",
        )
        self.harness.connect(self._poses)
        self.harness.spin_until(lambda: self.now_ns > 0 and self.active and self.states, what="sim")

    def show(self, wrist: Wrist) -> None:
        """Begin to move the wrist a little after now."""
        self.wrist, self._next = wrist, 0
        self.start_ns = self.now_ns + START_DELAY_NS

    def _on_clock(self, message: Clock) -> None:
        self.now_ns = stamp_ns(message.clock)
        while self.wrist is not None and self._next < len(self.wrist.times_ns):
            due_ns = self.start_ns + int(self.wrist.times_ns[self._next])
            if due_ns > self.now_ns:
                return
            pose = PoseStamped(pose=to_pose(self.wrist.positions[self._next], UPRIGHT))
            pose.header.stamp, pose.header.frame_id = to_stamp(due_ns), "world"
            self._poses.publish(pose)
            self._next += 1
            self._n_sent += 1

    def run_until(self, predicate, what: str, deadline_s: float = 300.0):
        """Spin until something is true; the deadline is generous, simulated time may be slow."""
        return self.harness.spin_until(predicate, deadline_s, what)

    def run_to(self, elapsed_s: float) -> None:
        """Spin until so much simulated time has passed since the wrist's start."""
        end_ns = self.start_ns + round(elapsed_s * SECOND_NS)
        self.run_until(lambda: stamp_ns(self.states[-1]) >= end_ns, f"{elapsed_s} simulated s")

    def labels(self) -> list[str]:
        """All values of intent/active_task so far."""
        return [message.data for message in self.active]

    def joints(self, elapsed_s: float) -> np.ndarray:
        """Measured joint angles (7,) so long after the wrist's start."""
        wanted = self.start_ns + elapsed_s * SECOND_NS
        nearest = min(self.states, key=lambda message: abs(stamp_ns(message) - wanted))
        return joint_values(nearest, JOINT_NAMES)

    def hand_error_m(self, elapsed_s: float) -> float:
        """Distance of the measured hand from where the demonstrator's rule puts it [m]."""
        hand = forward_kinematics(self.joints(elapsed_s))[:3, 3]
        return float(np.linalg.norm(hand - self.wrist.handover))

    def leader(self, since_s: float, until_s: float) -> list[str]:
        """Most probable label of every observation between two times."""
        leaders = []
        for message in self.tasks:
            elapsed_s = (stamp_ns(message) - self.start_ns) / SECOND_NS
            if since_s <= elapsed_s <= until_s:
                leaders.append(message.name[int(np.argmax(message.position))])
        return leaders
