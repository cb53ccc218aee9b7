# SPDX-License-Identifier: Apache-2.0
"""Shipped files are found; those for other tools name what is there; environments."""

import json
import os
import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from std_msgs.msg import String

from intent_recognition.errors import IntentError
from intent_recognition.kinematics import Arm
from intent_recognition.nodes.processes import (
    LOCALHOST,
    MIDDLEWARE,
    PEERS,
    PROFILES,
    RANGE,
    node_environment,
)
from intent_recognition.registry import BODY, NODES
from intent_recognition.share import share_path

ABSOLUTE = {"/diagnostics", "/clock"}
TOPICS = ABSOLUTE | {
    "/" + topic.replace(BODY, "wrist")
    for node in NODES.values()
    for topic in (*node.publishes, *node.subscribes)
}


def text(name):
    return share_path(f"config/bring_up/{name}").read_text(encoding="utf-8")


def sections(name, *keys):
    found = yaml.safe_load(text(name))
    for key in (*keys, "ros__parameters"):
        found = found[key]
    return found


def test_every_node_is_in_one_group_of_the_aggregator():
    values = sections("diagnostics.yaml", "analyzers").values()
    analyzers = [value for value in values if isinstance(value, dict)]
    grouped = [name for analyzer in analyzers for name in analyzer["contains"]]
    assert sorted(grouped) == sorted(NODES)
    for analyzer in analyzers:
        assert analyzer["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert set(analyzer.get("expected", ())) <= set(analyzer["contains"])


def test_the_manager_takes_the_lifecycle_nodes_up_and_waits_for_no_bond():
    settings = sections("lifecycle_manager.yaml", "lifecycle_manager")
    assert set(settings["node_names"]) == {name for name, node in NODES.items() if node.managed}
    assert settings["bond_timeout"] == 0.0 and settings["autostart"] is False


@pytest.mark.parametrize(
    ("name", "parse", "n_topics"),
    [
        ("bring_up/intent.perspective", json.loads, 2),
        ("bring_up/foxglove.json", json.loads, 8),
        ("plotjuggler.xml", ElementTree.fromstring, 18),
    ],
)
def test_layouts_show_topics_that_are_there(name, parse, n_topics):
    content = share_path(f"config/{name}").read_text(encoding="utf-8")
    parse(content)
    shown = set(re.findall(r"""(?<=["'])/[a-z_]+(?:/[a-z_]+)*""", content))
    assert len(shown) == n_topics
    assert [s for s in shown if not any(f"{s}/".startswith(f"{topic}/") for topic in TOPICS)] == []


def test_foxglove_places_every_panel_once():
    content = json.loads(text("foxglove.json"))
    parts, placed = [content["layout"]], []
    for part in parts:
        if isinstance(part, str):
            placed.append(part)
        else:
            parts += part["first"], part["second"]
    assert sorted(placed) == sorted(content["configById"])


def test_rviz_listens_to_relative_topics_as_they_are_offered():
    shown = yaml.safe_load(share_path("config/intent.rviz").read_text(encoding="utf-8"))
    found = {
        value["Value"]: (value["Reliability Policy"], value["Durability Policy"])
        for display in shown["Visualization Manager"]["Displays"]
        for key, value in display.items()
        if key.endswith("Topic") and isinstance(value, dict)
    }
    assert found == {
        "robot_description": ("Reliable", "Transient Local"),
        "intent/markers": ("Reliable", "Volatile"),
        "intent/human_path": ("Reliable", "Volatile"),
        "mocap/wrist/pose": ("Best Effort", "Volatile"),
    }


@pytest.mark.parametrize("arm", ["lwr", "panda"])
def test_hardware_and_controllers_are_of_the_arms_joints(repository, arm):
    from sim_bridge.arm import find_robot

    folder = repository / "config" / "ros2_control"
    hardware = (folder / f"{arm}.ros2_control.xml").read_text(encoding="utf-8")
    described = find_robot(arm).description.replace("</robot>", f"{hardware}</robot>")
    joints = ElementTree.fromstring(described).findall("ros2_control/joint")
    names = tuple(joint.get("name") for joint in joints)
    chain = Arm.from_urdf(described)
    assert names == chain.joint_names
    starts = [float(joint.find("state_interface/param").text) for joint in joints]
    assert np.all((starts > chain.limits.lower) & (starts < chain.limits.upper))
    text = (folder / f"{arm}_controllers.yaml").read_text(encoding="utf-8")
    controller = yaml.safe_load(text)["/**/joint_trajectory_controller"]["ros__parameters"]
    assert tuple(controller["joints"]) == names
    assert set(names) <= set(controller["constraints"])


def test_source_tree_comes_first(repository):
    assert share_path("config/params.yaml") == repository / "config" / "params.yaml"


def test_missing_file_is_named():
    with pytest.raises(IntentError, match=r"config/none\.yaml"):
        share_path("config/none.yaml")


def test_profiles_are_xml_and_alike():
    discovery, names = ".//{*}discovery_config", ("fastdds.xml", "fastdds_localhost.xml")
    roots = [ElementTree.parse(share_path(f"config/{name}")).getroot() for name in names]
    assert all(root.tag.endswith("dds") for root in roots)
    one, other = (ElementTree.tostring(root.find(discovery), method="text") for root in roots)
    assert one.split() == other.split()


def test_environment_keeps_what_the_user_set():
    environment = node_environment({PROFILES[0]: "mine", "ROS_DOMAIN_ID": "3"})
    assert environment[PROFILES[0]] == "mine" and PROFILES[1] not in environment
    assert environment["ROS_DOMAIN_ID"] == "3"
    assert environment[RANGE] == LOCALHOST
    assert environment["AMENT_PREFIX_PATH"] == sys.prefix
    assert node_environment({"ROS_DOMAIN_ID": "3"}, 7)["ROS_DOMAIN_ID"] == "7"
    assert node_environment({RANGE: "SUBNET"})[RANGE] == "SUBNET"
    assert node_environment({RANGE: "SUBNET"})[PROFILES[0]].endswith("fastdds.xml")


@pytest.mark.parametrize(
    ("own", "within"),
    [
        ({}, True),
        ({MIDDLEWARE: "rmw_fastrtps_dynamic_cpp"}, True),
        ({MIDDLEWARE: "rmw_cyclonedds_cpp"}, False),
        ({PEERS: "192.0.2.7"}, False),
    ],
)
def test_no_node_looks_beyond_this_machine_unless_it_is_told_to(own, within):
    """Our profiles stand for the range LOCALHOST only where the middleware reads them."""
    environment = node_environment({RANGE: LOCALHOST, **own})
    assert environment[PROFILES[0]].endswith("fastdds_localhost.xml") is within
    assert environment[RANGE] == ("SYSTEM_DEFAULT" if within else LOCALHOST)


HEARS = """
import rclpy
from std_msgs.msg import String
rclpy.init(args=[])
node, heard = rclpy.create_node("hears"), []
node.create_subscription(String, "said", heard.append, 10)
while not heard:
    rclpy.spin_once(node, timeout_sec=0.1)
print("fastrtps_port" in open("/proc/self/maps").read())
"""


@pytest.mark.slow
@pytest.mark.parametrize("within", ["SUBNET", LOCALHOST])
def test_nodes_hear_others_without_shared_memory(harness, within):
    """A segment of shared memory that outlives a killed node would cut the next one off."""
    base = {name: value for name, value in os.environ.items() if name not in PROFILES}
    environment = node_environment({**base, RANGE: within})
    said = harness.publisher(String, "said")
    harness.probe.create_timer(0.05, lambda: said.publish(String()))
    command = [sys.executable, "-c", HEARS]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    harness.spin_until(lambda: process.poll() is not None)
    assert process.communicate()[0].split() == ["False"]
