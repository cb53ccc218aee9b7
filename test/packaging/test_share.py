# SPDX-License-Identifier: Apache-2.0
"""Shipped files are found, and nodes get the environment they need."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
from std_msgs.msg import String

from intent_recognition.errors import IntentError
from intent_recognition.nodes.processes import (
    LOCALHOST,
    MIDDLEWARE,
    PEERS,
    PROFILES,
    RANGE,
    node_environment,
)
from intent_recognition.share import share_path


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
