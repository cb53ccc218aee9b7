# SPDX-License-Identifier: Apache-2.0
"""Where parameters come from is said as rcl takes them: real_arm.yaml, a user's file, arguments."""

import re

import pytest
from ros_harness import NodeProcess

from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.nodes.parameters import parameter_sources
from intent_recognition.share import share_path

OWN = """
/**/primitive_activation: {ros__parameters: {velocity_scale: 0.3, home: [0.0]}}
/cell/left: {ros__parameters: {timeout: 0.2}}
cell: {left: {ros__parameters: {hold_time: 2.0}}, "*": {ros__parameters: {max_lateness: 1.0}}}
other: {ros__parameters: {threshold: 0.6}}
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(OWN, encoding="utf-8")
    return str(path)


def test_the_last_one_that_sets_a_parameter_is_named(own, tmp_path):
    shipped = str(share_path("config/real_arm.yaml"))
    of_launch = tmp_path / "launch_params_x1"
    of_launch.write_text("/**: {ros__parameters: {model: m.npz}}", encoding="utf-8")
    files = [word for file in (shipped, own, of_launch) for word in ("--params-file", str(file))]
    given = ["node", "--ros-args", *files, "-p", "timeout:=0.4", "-p", "left:hold_time:=1.0"]
    sources = parameter_sources(given, "/primitive_activation")
    assert sources["max_wrong"] == shipped and sources["velocity_scale"] == own
    assert sources["timeout"] == "command line" and sources["model"] == "launch argument"
    assert "hold_time" not in sources and "return_home" not in sources
    sources = parameter_sources(given[:-4], "/cell/left")
    assert sources["velocity_scale"] == shipped and "home" not in sources
    assert sources["timeout"] == sources["hold_time"] == sources["max_lateness"] == own


@pytest.mark.parametrize("content", [None, "[1, 2", "text", "[]", "{a: {ros__parameters: 3}}"])
def test_a_file_that_cannot_be_read_is_passed_over(tmp_path, content):
    path = tmp_path / "odd.yaml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    assert parameter_sources(["--ros-args", "--params-file", str(path)], "/a") == {}


@pytest.mark.slow
def test_under_another_name_the_careful_limits_hold_and_are_logged():
    shipped = str(share_path("config/real_arm.yaml"))
    names = "joint_names:=[" + ", ".join(JOINT_NAMES) + "]"
    node = NodeProcess(
        "intent_recognition.nodes.primitive_activation",
        *("--ros-args", "--params-file", shipped, "-r", "__node:=left", "-r", "__ns:=/cell"),
        *("-p", names, "-p", "timeout:=0.2"),
    )
    with node:
        line = next(line for line in node.process.stderr if "limits in force" in line)
        node.stop()
    for text in ("velocity_scale 0.1", "acceleration_limit 1.0", "max_tracking_error 0.2"):
        assert f"{text} ({shipped})" in line
    assert "timeout 0.2 (command line)" in line
    assert re.search(r"velocity \[0\.\d+.*\(the LWR's\)", line)
