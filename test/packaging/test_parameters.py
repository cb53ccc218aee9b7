# SPDX-License-Identifier: Apache-2.0
"""The shipped parameter file fits the nodes."""

import importlib
import re

import pytest
import yaml
from bag_builder import write_bag
from dashboard.browser import free_port
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.registry import NODES
from intent_recognition.share import share_path

TEXT = share_path("config/params.yaml").read_text(encoding="utf-8")
SECTIONS = yaml.safe_load(TEXT)


def node_class(name):
    """The node of an executable: the Node its module defines."""
    module = importlib.import_module(NODES[name].module)
    (found,) = [
        member
        for member in vars(module).values()
        if isinstance(member, type)
        and issubclass(member, Node)
        and member.__module__ == module.__name__
    ]
    return found


@pytest.mark.slow
@pytest.mark.parametrize("section", sorted(SECTIONS))
def test_node_takes_its_section(harness, section, tmp_path):
    name = section.removeprefix("/**/")
    values = SECTIONS[section]["ros__parameters"] | needed(name, tmp_path)
    if "autostart" in values:
        values["autostart"] = False
    node = harness.add(
        node_class(name)(parameter_overrides=[Parameter(k, value=v) for k, v in values.items()])
    )
    assert node.get_name() == name
    for parameter, value in values.items():
        assert node.get_parameter(parameter).value == value, parameter
    if name in ("mocap_ingest", "primitive_activation"):
        for parameter in values:
            said = node.describe_parameter(parameter)
            if said.floating_point_range or said.integer_range:
                assert "larger value" in said.description, parameter
    own = set(node._parameters) - {"use_sim_time", "start_type_description_service"}
    assert own <= set(words(name)), "not in the shipped file, not even as a comment"


def words(name):
    """Every word of a section, comments included: parameters without a default stand there."""
    (section,) = re.findall(rf"^/\*\*/{name}:\n((?:  .*\n|\n)+)", TEXT, re.MULTILINE)
    return re.findall(r"\w+", section)


def needed(name, folder):
    """Without what a node does not start, and what must not be taken on this machine."""
    if name == "bag_player":
        return {"bag": str(write_bag(folder / "bag")), "start_paused": True}
    if name == "task_teacher":
        return {"library": str(folder / "tasks")}
    return {"port": free_port()} if name == "dashboard" else {}


def test_every_node_has_a_section():
    assert {f"/**/{name}" for name in NODES} == set(SECTIONS)
