# SPDX-License-Identifier: Apache-2.0
"""Names and qualities of service that the contract fixes; those of other nodes: test_security."""

import pytest
from bag_builder import write_bag
from dashboard.browser import free_port
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSReliabilityPolicy

from intent_recognition.dashboard.node import Dashboard
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.bag_recorder import BagRecorder
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.object_transfer import ObjectTransfer
from intent_recognition.nodes.object_warper import ObjectWarper
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.nodes.task_teacher import TaskTeacher
from intent_recognition.registry import FRAMES
from sim_bridge.nodes.coworker_sim import CoworkerSim
from sim_bridge.nodes.lwr_sim import LwrSim

NODES = {
    "mocap_ingest": (MocapIngest, {}),
    "intent_estimator": (IntentEstimatorNode, {"autostart": False}),
    "primitive_activation": (PrimitiveActivation, {}),
    "bag_recorder": (BagRecorder, {}),
    "bag_player": (BagPlayer, {"start_paused": True, "wait_for_subscribers": 0.0}),
    "object_warper": (ObjectWarper, {}),
    "object_transfer": (ObjectTransfer, {}),
    "lwr_sim": (LwrSim, {"publish_clock": True}),
    "coworker_sim": (CoworkerSim, {"use_sim_time": True}),
    "task_teacher": (TaskTeacher, {}),
    "dashboard": (Dashboard, {}),
}
ABSOLUTE = {"/clock", "/diagnostics", "/rosout", "/parameter_events", *FRAMES}
SENSOR = (QoSReliabilityPolicy.BEST_EFFORT, QoSDurabilityPolicy.VOLATILE, 10)
STATE = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 10)
COMMAND = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 1)
LATCHED = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.TRANSIENT_LOCAL, 1)
OFFERED = {
    "mocap_ingest": {"human/wrist": SENSOR},
    "intent_estimator": {
        "intent/tasks": STATE,
        "intent/robot_trajectory": COMMAND,
        "intent/human_path": COMMAND,
        "intent/human_trajectory": COMMAND,
        "intent/markers": COMMAND,
        "intent/next_task": LATCHED,
    },
    "primitive_activation": {"joint_trajectory": COMMAND, "intent/active_task": LATCHED},
    "object_warper": {"object/labelled_cloud": STATE, "object/parameters": STATE},
    "object_transfer": {"intent/transfer": STATE},
    "lwr_sim": {"joint_states": STATE, "robot_description": LATCHED},
    "coworker_sim": {"mocap/wrist/pose": SENSOR, "coworker/task": STATE},
    "task_teacher": {"teach/status": LATCHED},
}
SERVICES = {
    "intent_estimator": {"reset", "reload_model"},
    "primitive_activation": {"reset"},
    "bag_recorder": {"start", "stop"},
    "bag_player": {"pause", "resume"},
    "task_teacher": {"start", "stop", "learn", "discard", "undo"},
    "lwr_sim": {"gravity_compensation"},
}


@pytest.fixture
def bag(tmp_path):
    write_bag(tmp_path / "bag")
    return str(tmp_path / "bag")


def needed(name, bag):
    """The parameters of a node, with those it does not start without."""
    values = NODES[name][1]
    if name == "task_teacher":
        return {**values, "library": f"{bag}_tasks"}
    if name == "dashboard":
        return {**values, "port": free_port()}
    return {**values, "bag": bag} if name == "bag_player" else values


def make(harness, name, bag, **more):
    kind = NODES[name][0]
    values = needed(name, bag) | more
    overrides = [Parameter(key, value=value) for key, value in values.items()]
    return harness.add(kind(namespace="/cell1", parameter_overrides=overrides))


def check_contract(node, name):
    """Names are in the namespace, and topics and services offered as the contract says."""
    topics = {entity.topic_name for entity in (*node.publishers, *node.subscriptions)}
    assert "/diagnostics" in topics
    assert all(topic.startswith("/cell1/") for topic in topics - ABSOLUTE)
    offered = {service.service_name for service in node.services}
    assert all(service.startswith(f"/cell1/{name}/") for service in offered)
    assert offered >= {f"/cell1/{name}/{service}" for service in SERVICES.get(name, ())}
    profiles = {p.topic_name: p.qos_profile for p in node.publishers}
    for topic, (reliability, durability, depth) in OFFERED.get(name, {}).items():
        profile = profiles[f"/cell1/{topic}"]
        assert (profile.reliability, profile.durability) == (reliability, durability), topic
        assert (profile.history, profile.depth) == (QoSHistoryPolicy.KEEP_LAST, depth), topic


def test_a_node_of_no_graph_keeps_the_contract(harness, bag):
    check_contract(make(harness, "object_warper", bag), "object_warper")
