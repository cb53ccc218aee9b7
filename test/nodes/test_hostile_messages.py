# SPDX-License-Identifier: Apache-2.0
"""No message of a subscribed type ends a node, and the next good one is taken as before."""

import copy
from functools import cache

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from hostile.random_messages import TEXTS, random_message, spoiled_message
from joint_trajectories import build_joint_trajectory
from kinematics.robots import lwr_urdf
from nav_msgs.msg import Odometry
from nodes.test_object_warper import message_of
from nodes.test_warped_primitive import LIP_M, told
from rclpy.serialization import serialize_message
from scan_builder import scanned
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.demonstrations import DofEntry
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes import mocap_ingest, object_warper, task_teacher
from intent_recognition.nodes.conversions import to_joint_state, to_pose
from intent_recognition.nodes.demo_observers import PouringObserver, RecordingObserver
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.object_transfer import NAMES
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.nodes.session_observer import SessionObserver
from intent_recognition.nodes.warped_primitive import WarpedPrimitiveNode
from sim_bridge.nodes.coworker_sim import CoworkerSim
from sim_bridge.nodes.lwr_sim import LwrSim
from sim_bridge.scenarios.pouring import OPENING_M, start_posture

ROUNDS, SEED = 40, 14
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
LABELS = ("plate_handover", "screw_handover", "hold_screwdriver", "none")
WRIST = DofEntry(
    "mocap/wrist/pose", "geometry_msgs/msg/PoseStamped", fields=("pose.position.x",), unit="m"
)
PERSON = tuple(f"mocap/wrist/pose.pose.position.{axis}" for axis in "xyz")
SEQUENCE = """
box:
- {task: plate_handover}
- {task: screw_handover, when: {wrist_in: {center: [0.5, 0, 0.3], radius: 0.2}, after: 1.0}}
"""
VIA = "- {name: bottle, phase: 0.6, hand: [0.4, 0.1, 0.3], std: 0.01}"
TEXTS_HERE = (
    *TEXTS, *LABELS, *JOINT_NAMES, "world", "wrist", "human/wrist", "empty", "full", "25", "1e400",
    VIA, lwr_urdf()[:5000], "- {name: x, time: .nan, dofs: {lwr_a4_joint: 1e300}}",
    "- {name: y, phase: 1, hand: [1.0e+300, 0, .inf]}", "[{}, []]", "- &a [*a]",
)  # fmt: skip


@cache
def posture():
    return start_posture("tea_cup")


def trajectory(now_ns, goal=0.2):
    share = np.linspace(0.0, 1.0, 20)[:, None]
    start = posture()
    path = start + (goal - start) * share**3 * (10 - 15 * share + 6 * share**2)
    times_s = 4.0 * share[:, 0]
    speeds = np.gradient(path, times_s, axis=0)
    speeds[[0, -1]] = 0.0
    std = np.full(path.shape, 0.01)
    found = build_joint_trajectory(JOINT_NAMES, times_s, path, speeds, std, time_ns=now_ns)
    found.header.frame_id = "plate_handover"
    return found


def placed(kind, now):
    found = kind(header=Header(frame_id="world", stamp=now.to_msg()))
    if kind is Odometry:
        found.child_frame_id = "wrist_world_aligned"
        found.pose.pose = to_pose(np.array([0.4, 0.1, 0.3]), UPRIGHT)
        found.pose.covariance = (1e-6 * np.eye(6)).ravel()
    else:
        found.pose = to_pose(np.array([0.4, 0.1, 0.3]), UPRIGHT)
    return found


def good(node, topic, kind):
    """A message as it should be, of now."""
    now, name = node.get_clock().now(), topic.lstrip("/")
    if name in ("cup/parameters", "cup/pose"):
        return copy.deepcopy(told("tea_cup", tuple(LIP_M))[name == "cup/pose"])
    if name in ("second/parameters", "second/pose"):
        return copy.deepcopy(told("paper_cup", None, tuple(OPENING_M))[name == "second/pose"])
    if name == "intent/transfer":
        found = to_joint_state(NAMES, (0.2, 3.0, 4.0, 20.0, 0.0), time_ns=now.nanoseconds)
        found.header.frame_id = "carrying"
        return found
    if kind is JointState and name.startswith("intent/"):
        values = (0.98, 0.01, 0.0, 0.01)
        found = to_joint_state(LABELS, values, values, time_ns=now.nanoseconds)
        found.effort = [-1.0, -9.0, -9.0, -9.0]
        return found
    if kind is JointState:
        return to_joint_state(JOINT_NAMES, posture(), np.zeros(7), time_ns=now.nanoseconds)
    if kind is JointTrajectory and name == "intent/human_trajectory":
        path = np.tile([0.4, 1.5, 0.3], (5, 1))
        values = (np.arange(5.0), path, None, np.full((5, 3), 0.01))
        return build_joint_trajectory(PERSON, *values, time_ns=now.nanoseconds)
    if kind is JointTrajectory:
        return trajectory(now.nanoseconds)
    if kind in (PoseStamped, Odometry):
        return placed(kind, now)
    if kind is PointCloud2:
        return message_of(scanned("tea_cup"))
    if kind is String:
        text = {"robot_description": lwr_urdf(), "intent/via_points": VIA, "pour": "empty"}
        return String(data=text.get(name, "plate_handover"))
    if kind is DiagnosticArray:
        return DiagnosticArray(status=[good(node, topic, DiagnosticStatus)])
    if kind is DiagnosticStatus:
        rows = {"outcome": "arrived", "corrections": "1", "state": "active", "spilled": "0.1"}
        values = [KeyValue(key=key, value=value) for key, value in rows.items()]
        return DiagnosticStatus(name="plate_handover", message="arrived", values=values)
    return kind()


def hear(node, subscription, message):
    data = serialize_message(message)  # it can be sent
    subscription.callback(data if subscription.raw else message)


def with_sequences(harness, folder, model):
    (folder / "sequence.yaml").write_text(SEQUENCE)
    values = {"sequences": str(folder / "sequence.yaml"), "person_dofs": list(PERSON)}
    return harness.node(PrimitiveActivation, model=str(model), correction="lwr", **values)


NODES = {
    "mocap": lambda harness, *_: harness.node(mocap_ingest.MocapIngest, bodies=["wrist"]),
    "estimator": lambda harness, _, model: harness.node(IntentEstimatorNode, model=str(model)),
    "activation": with_sequences,
    "warper": lambda harness, *_: harness.node(object_warper.ObjectWarper, source="mug"),
    "primitive": lambda harness, *_: harness.node(WarpedPrimitiveNode),
    "teacher": lambda h, f, _: h.node(task_teacher.TaskTeacher, library=str(f / "t")),
    "coworker": lambda harness, *_: harness.node(CoworkerSim),
    "session": lambda harness, *_: harness.add(SessionObserver(print, print)),
    "pouring": lambda harness, *_: harness.add(PouringObserver()),
    "recording": lambda harness, *_: harness.add(RecordingObserver(WRIST, JOINT_NAMES)),
    "arm": lambda harness, *_: harness.node(LwrSim),
    "hand_over": lambda harness, *_: harness.node(
        LwrSim, scene="transfers", publish_clock=True, wait_for_answers=["plate_handover"]
    ),
}
TELLS = {
    "mocap": ("mocap/wrist/pose", Odometry, "human/wrist"),
    "estimator": ("human/wrist", JointState, "intent/tasks"),
    "activation": ("intent/robot_trajectory", JointTrajectory, "joint_trajectory"),
    "warper": ("object/cloud", JointState, "object/parameters"),
    "primitive": ("pour", JointTrajectory, "intent/robot_trajectory"),
    "arm": ("joint_trajectory", JointState, "joint_states"),
    "hand_over": ("joint_trajectory", JointState, "joint_states"),
}
"""What a good message is answered with, by topic."""


def hear_good(node, *topics):
    """Every subscribed topic, or these, once, as it should be."""
    for subscription in node.subscriptions:
        name = subscription.topic_name
        if not topics or name.lstrip("/") in topics:
            hear(node, subscription, good(node, name, subscription.msg_type))


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_messages_of_strangers_leave_it_running(harness, tmp_path, toolbox_model, name):
    node, rng = NODES[name](harness, tmp_path, toolbox_model), np.random.default_rng(SEED)
    subscriptions = [s for s in node.subscriptions if s.topic_name != "/clock"]
    for _ in range(ROUNDS):
        for subscription in subscriptions:
            kind, choice = subscription.msg_type, rng.random()
            if choice < 0.3:
                message = random_message(rng, kind, TEXTS_HERE)
            else:
                message = good(node, subscription.topic_name, kind)
            if choice > 0.5:
                message = spoiled_message(rng, message, TEXTS_HERE)
            hear(node, subscription, message)
        for timer in list(node.timers):
            timer.callback()
    if name not in TELLS:
        return
    asked, kind, answered = TELLS[name]
    publisher = next(p for p in node.publishers if p.topic_name == f"/{answered}")
    answers = harness.collect(kind, answered, publisher.qos_profile)
    harness.connect(publisher)

    def answer():
        hear_good(node)
        hear_good(node, asked)
        return answers

    harness.spin_until(answer, what=f"{answered} after {asked}")
