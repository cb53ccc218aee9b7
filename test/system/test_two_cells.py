# SPDX-License-Identifier: Apache-2.0
"""Nodes in namespaces of one graph: nothing passes between them, whatever the command line says."""

import pytest
from rclpy.parameter import Parameter

from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.primitive_activation import PrimitiveActivation

pytestmark = pytest.mark.slow

KINDS = {
    "mocap_ingest": MocapIngest,
    "intent_estimator": IntentEstimatorNode,
    "primitive_activation": PrimitiveActivation,
}


def start(harness, call):
    """A node of a graph, as it is launched."""
    rules = [word for rule in call.remappings for word in ("-r", ":=".join(rule))]
    node = KINDS[call.name](
        namespace=call.namespace,
        parameter_overrides=[Parameter(name, value=v) for name, v in call.parameters.items()],
        cli_args=["--ros-args", *rules] if rules else [],
    )
    return harness.add(node)


def topics(node):
    absolute = {"/clock", "/diagnostics", "/rosout", "/parameter_events"}
    return {e.topic_name for e in (*node.publishers, *node.subscriptions)} - absolute


def test_the_nodes_of_a_cell_have_no_topic_outside_its_namespace(harness, toolbox_model):
    given = {"model": str(toolbox_model), "use_sim_time": True, "namespace": "a"}
    nodes = {call.name: start(harness, call) for call in resolve("intent", given)}
    assert nodes.keys() == KINDS.keys()
    names = set().union(*map(topics, nodes.values()))
    chain = ("mocap/wrist/pose", "human/wrist", "intent/tasks", "joint_trajectory")
    assert {f"/a/{name}" for name in chain} <= names
    assert all(name.startswith("/a/") for name in names)


def test_parameters_files_names_and_remaps_come_from_the_command_line(harness, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "/**/primitive_activation:\n  ros__parameters: {threshold: 0.8, timeout: 0.4}\n"
        "/b/primitive_activation:\n  ros__parameters: {hold_time: 3}\n",
        encoding="utf-8",
    )
    words = ["--params-file", str(file), "-p", "timeout:=0.3", "-r", "__ns:=/b"]
    words += ["-r", "joint_trajectory:=/controller/joint_trajectory", "-r", "joint_states:=arm"]
    node = harness.add(PrimitiveActivation(cli_args=["--ros-args", *words]))
    values = {name: node.get_parameter(name).value for name in ("threshold", "timeout")}
    assert values == {"threshold": 0.8, "timeout": 0.3}
    assert node.get_parameter("hold_time").value == pytest.approx(3.0)
    assert node.get_fully_qualified_name() == "/b/primitive_activation"
    names = topics(node)
    assert {"/controller/joint_trajectory", "/b/arm", "/b/intent/tasks"} <= names
    assert "/b/joint_states" not in names
