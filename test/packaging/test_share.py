# SPDX-License-Identifier: Apache-2.0
"""Shipped files are found, and nodes get the environment they need."""

import sys
import xml.etree.ElementTree as ElementTree

import pytest

from intent_recognition.errors import IntentError
from intent_recognition.nodes.processes import FAST_DISCOVERY, node_environment
from intent_recognition.share import share_path


def test_source_tree_comes_first(repository):
    assert share_path("config/params.yaml") == repository / "config" / "params.yaml"


def test_missing_file_is_named():
    with pytest.raises(IntentError, match=r"config/none\.yaml"):
        share_path("config/none.yaml")


def test_profile_is_xml():
    root = ElementTree.parse(share_path("config/fastdds.xml")).getroot()
    assert root.tag.endswith("dds")


def test_environment_keeps_what_the_user_set():
    environment = node_environment({FAST_DISCOVERY[0]: "mine", "ROS_DOMAIN_ID": "3"})
    assert environment[FAST_DISCOVERY[0]] == "mine"
    assert environment["ROS_DOMAIN_ID"] == "3"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert environment["AMENT_PREFIX_PATH"] == sys.prefix
    assert node_environment({"ROS_DOMAIN_ID": "3"}, 7)["ROS_DOMAIN_ID"] == "7"
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE" not in node_environment({}, localhost=False)
