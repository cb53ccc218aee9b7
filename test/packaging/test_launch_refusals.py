# SPDX-License-Identifier: Apache-2.0
"""What the launch files refuse before the first node starts, and when they end."""

import sys
import types

import pytest
from ament_index_python.packages import PackageNotFoundError
from stand_in_launch import Context, start, values

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes import launch_checks


def test_a_published_clock_is_followed_or_refused(describe):
    nodes = start(describe("sim"), publish_clock="true")
    assert values(nodes["coworker_sim"])["use_sim_time"] is True
    assert "use_sim_time" not in values(nodes["lwr_sim"])
    assert "use_sim_time" not in values(start(describe("sim"))["coworker_sim"])
    with pytest.raises(ArgumentError, match="use_sim_time"):
        start(describe("sim"), publish_clock="true", use_sim_time="false")
    with pytest.raises(ArgumentError, match="use_sim_time"):
        start(describe("replay"), use_sim_time="false")


@pytest.mark.parametrize(("code", "ends"), [(0, False), (1, True), (-9, False), (-11, False)])
def test_a_node_that_cannot_start_ends_the_launch_and_one_that_dies_does_not(describe, code, ends):
    node = start(describe("real"))["primitive_activation"]
    exited = types.SimpleNamespace(returncode=code, process_name="primitive_activation-3")
    if not ends:
        assert node["on_exit"](exited, Context()) is None
        return
    with pytest.raises(IntentError, match="primitive_activation-3 cannot run"):
        node["on_exit"](exited, Context())


def test_what_is_optional_is_there_before_the_first_node_starts(describe, monkeypatch, tmp_path):
    entities = describe("replay")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ArgumentError, match="bag: expected a file or folder"):
        start(entities, bag="missing")
    with pytest.raises(ArgumentError, match="model: expected a file or folder"):
        start(entities, model="missing.npz")
    monkeypatch.setattr(launch_checks, "get_package_prefix", no_package)
    with pytest.raises(ArgumentError, match="rviz: expected the package robot_state_publisher"):
        start(entities, rviz="true")


def test_ros2_control_looks_first_and_starts_its_own_nodes_last(describe, monkeypatch):
    _, check, graph, controllers = describe("ros2_control")
    assert graph.kind == "IncludeLaunchDescription"
    check, controllers = check.options["function"], controllers.options["function"]
    context = Context(arm="lwr", namespace="/cell1/")
    assert check(context) == []
    for node in controllers(context):
        assert node.options["namespace"] == "cell1"
        with pytest.raises(IntentError, match="spawner-2 cannot run"):
            exited = types.SimpleNamespace(returncode=1, process_name="spawner-2")
            node.options["on_exit"](exited, context)
    command = ["ros2", "launch", "intent_recognition", "ros2_control.launch.py", "modle:=m.npz"]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(ArgumentError, match="Did you mean model"):
        check(context)
    monkeypatch.setattr(sys, "argv", [*command[:-1], "activate:=true", "arm:=lwr"])
    check(context)
    monkeypatch.setattr(launch_checks, "get_package_prefix", no_package)
    with pytest.raises(ArgumentError, match="Install ros-jazzy-controller-manager"):
        check(context)


def no_package(name):
    raise PackageNotFoundError(name)


def test_an_argument_that_nobody_takes_is_refused(describe, monkeypatch):
    entities = describe("demo")
    command = ["ros2", "launch", "intent_recognition", "demo.launch.py", "modle:=m.npz"]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(ArgumentError, match="Did you mean model"):
        start(entities)
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "mine.launch.py", "other:=1"])
    assert start(entities)


def test_a_section_that_no_node_takes_is_refused(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    for section, taken in (
        ("/**/mocap_ingst", False),
        ("/cell1/nobody", False),
        ("/**", True),
        ("/cell1/*", True),
        ("object_warper", True),
        ("/cell2/mocap_ingest", True),
    ):
        own.write_text(f"{section}:\n  ros__parameters: {{use_sim_time: true}}\n", encoding="utf-8")
        if taken:
            assert start(describe("intent"), params_file=str(own), namespace="cell1")
            continue
        with pytest.raises(ArgumentError, match=section.rsplit("/", 1)[-1]):
            start(describe("intent"), params_file=str(own), namespace="cell1")


def test_a_parameter_that_the_node_has_not_is_refused(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    for section, name, taken in (
        ("/**/mocap_ingest", "max_sped", False),
        ("cup_warper", "neighbors", False),
        ("primitive_activation", "threshold", True),
        ("primitive_activation", "qos_overrides", True),
        ("somebody/**", "anything", True),
        ("/**", "anything", True),
    ):
        own.write_text(f"{section}:\n  ros__parameters: {{{name}: 1.0}}\n", encoding="utf-8")
        if taken:
            assert start(describe("intent"), params_file=str(own), namespace="somebody")
            continue
        with pytest.raises(ArgumentError, match=f"{name}. Did you mean"):
            start(describe("intent"), params_file=str(own))


KINDS = [
    ("rate", "fast", "expected a number, got 'fast'. Give rate:=1.0."),
    ("headless", "perhaps", "expected true or false, got 'perhaps'. Give headless:=true."),
    ("seed", "1.5", "expected a whole number, got '1.5'. Give seed:=1."),
]


@pytest.mark.parametrize(("name", "value", "message"), KINDS)
def test_a_value_of_another_kind_is_named(describe, name, value, message):
    with pytest.raises(ArgumentError, match=f"{name}: {message}"):
        start(describe("demo"), **{name: value})
