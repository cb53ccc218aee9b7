# SPDX-License-Identifier: Apache-2.0
"""The shipped parameter file fits the nodes."""

import importlib
import re
from pathlib import Path

import pytest
import yaml
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.share import share_path

ROOMS = {"lwr_sim": "sim_bridge", "coworker_sim": "sim_bridge"}
TEXT = share_path("config/params.yaml").read_text(encoding="utf-8")
SECTIONS = yaml.safe_load(TEXT)


def node_class(name):
    """The node of an executable: the Node its module defines."""
    module = importlib.import_module(f"{ROOMS.get(name, 'intent_recognition')}.nodes.{name}")
    (found,) = [
        member
        for member in vars(module).values()
        if isinstance(member, type)
        and issubclass(member, Node)
        and member.__module__ == module.__name__
    ]
    return found


@pytest.mark.parametrize("section", sorted(set(SECTIONS) - {"/**/bag_player"}))
def test_node_takes_its_section(harness, section):
    name = section.removeprefix("/**/")
    values = dict(SECTIONS[section]["ros__parameters"])
    if "autostart" in values:
        values["autostart"] = False
    node = harness.add(
        node_class(name)(parameter_overrides=[Parameter(k, value=v) for k, v in values.items()])
    )
    assert node.get_name() == name
    for parameter, value in values.items():
        assert node.get_parameter(parameter).value == value, parameter
    own = set(node._parameters) - {"use_sim_time", "start_type_description_service"}
    assert own <= set(words(name)), "not in the shipped file, not even as a comment"


def words(name):
    """Every word of a section, comments included: parameters without a default stand there."""
    (section,) = re.findall(rf"^/\*\*/{name}:\n((?:  .*\n|\n)+)", TEXT, re.MULTILINE)
    return re.findall(r"\w+", section)


def test_every_node_has_a_section():
    """One for each executable but `intent`."""
    setup = (Path(__file__).parents[2] / "setup.py").read_text(encoding="utf-8")
    nodes = re.findall(r'^    "(\w+)": (?:PACKAGE|"sim_bridge"),$', setup, re.MULTILINE)
    assert {f"/**/{name}" for name in nodes} == set(SECTIONS)


def test_player_declares_its_section():
    """It cannot start without a bag."""
    text = share_path("intent_recognition/nodes/bag_player.py").read_text(encoding="utf-8")
    for parameter in SECTIONS["/**/bag_player"]["ros__parameters"]:
        assert f'"{parameter}"' in text
