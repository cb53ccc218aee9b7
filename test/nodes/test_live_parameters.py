# SPDX-License-Identifier: Apache-2.0
"""Parameters: which change at run time, and where their values come from."""

import re
import sys

import numpy as np
import pytest
from bag_builder import write_bag
from model_builder import learned_model, make_dofs
from rclpy.parameter import Parameter

from intent_recognition.activation.states import Homing, Idle
from intent_recognition.errors import BagError
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.model.file import save_model
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.bag_recorder import BagRecorder
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.parameters import parameter_sources
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.nodes.task_teacher import TaskTeacher
from intent_recognition.share import share_path


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "m.npz"
    save_model(path, learned_model(make_dofs()))
    return str(path)


def change(node, **values):
    """The reason why the values were not taken, or empty."""
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return node.set_parameters_atomically(parameters).reason


def test_ingest_takes_noise_and_speed_and_refuses_what_is_none(harness):
    node = harness.node(MocapIngest)
    assert change(node, position_std=0.01, max_speed=2.0, orientation_std_rad=0.1) == ""
    assert node._settings.max_speed_m_s == 2.0
    assert np.allclose(node._settings.covariances["world"], np.eye(3) * 1e-4)
    assert node._settings.orientation_std_rad == pytest.approx(0.1)
    for value in (0.0, -1.0, float("nan"), float("inf"), 2000.0):
        assert "max_speed" in change(node, max_gap=0.2, max_speed=value)
        assert (node._settings.max_speed_m_s, node._settings.max_gap_s) == (2.0, 0.5)


def test_estimator_takes_rate_and_expectation(harness, model):
    node = harness.node(IntentEstimatorNode, model=model)
    assert change(node, publish_rate=5.0, transition_prior=False, forget_after=1.0) == ""
    assert node.people[""].publish_rate == 5.0
    assert node.people[""].estimator.expectation._forget_after_s == 1.0
    assert "publish_rate" in change(node, publish_rate=0.0)


def test_activation_takes_the_decision_at_once(harness, model):
    node = harness.node(PrimitiveActivation, model=model)
    assert change(node, threshold=0.8, n_observations=2, timeout=0.2) == ""
    settings = node.activation._parts.common.settings
    assert (settings.decision.threshold, settings.decision.n_observations) == (0.8, 2)
    assert settings.timeout_s == 0.2


def test_the_bound_on_wrong_actions_is_that_of_the_share_in_force(harness, model):
    node = harness.node(PrimitiveActivation, model=model)
    bounds = []
    for values in ({"max_wrong": 0.5}, {"max_wrong": 0.4}, {"threshold": 0.8}):
        assert change(node, **values) == ""
        values_now = values_of(node.diagnostics.report())
        bounds.append(values_now["wrong actions at most"])
        assert values_now["wrong switches at most"] == "0.010"
    assert bounds == ["0.500", "0.400", "not known"]


def test_activation_tells_what_does_not_fit(harness, model):
    node = harness.node(PrimitiveActivation)
    assert "0 without a model" in change(node, pretrigger_threshold=0.5)
    other = harness.node(PrimitiveActivation, model=model)
    assert "7 angles" in change(other, home=[0.0, 0.0])
    assert " rad" in change(other, home=[0.0, 90.0, *[0.0] * 5])


def test_limits_change_only_while_the_arm_rests(harness, model):
    node = harness.node(PrimitiveActivation, model=model)
    before = node._limits.velocity
    node._timer.cancel()  # nothing steps it on meanwhile
    node.activation.state = Homing(None)
    assert "an arm at rest, got homing" in change(node, velocity_scale=0.45)
    assert change(node, threshold=0.95) == ""
    node.activation.state = Idle()
    assert change(node, velocity_scale=0.45, home=[0.1] * 7) == ""
    np.testing.assert_allclose(node._limits.velocity, before / 2.0)
    limits = node.activation._parts.common.settings.limits
    np.testing.assert_allclose(limits.velocity, before / 2.0)
    np.testing.assert_allclose(node.activation.home, 0.1)


def test_player_goes_on_at_another_rate(harness, tmp_path):
    bag = str(write_bag(tmp_path / "bag", count=30))
    node = harness.node(BagPlayer, bag=bag, rate=0.001, wait_for_subscribers=0.0)
    harness.spin_until(lambda: node.published >= 1)
    assert change(node, rate=0.0) == ""
    harness.spin_until(node.finished.is_set)
    assert node.published == 60


@pytest.mark.parametrize("kind", [BagRecorder, TaskTeacher])
def test_a_label_that_cannot_name_a_task_is_refused(harness, tmp_path, kind):
    needed = {"library": str(tmp_path / "tasks")} if kind is TaskTeacher else {}
    node = harness.node(kind, **needed)
    for label in ("bad/label", "x" * 300, "a\x1b[2J", ".."):
        reason = change(node, task=label)
        assert "label" in reason and "\x1b" not in reason
    assert change(node, task="give_cup") == ""
    if kind is BagRecorder:
        with pytest.raises(BagError, match="label"):
            harness.node(kind, task="bad/label")


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


def test_under_another_name_the_careful_limits_hold_and_are_logged(harness, monkeypatch, capfd):
    shipped = str(share_path("config/real_arm.yaml"))
    names = "joint_names:=[" + ", ".join(JOINT_NAMES) + "]"
    words = ["--ros-args", "--params-file", shipped, "-r", "__node:=left", "-r", "__ns:=/cell"]
    words += ["-p", names, "-p", "timeout:=0.2"]
    monkeypatch.setattr(sys, "argv", ["primitive_activation", *words])
    harness.add(PrimitiveActivation(cli_args=words))
    (line,) = (s for s in capfd.readouterr().err.splitlines() if "limits in force" in s)
    for text in ("velocity_scale 0.1", "acceleration_limit 1.0", "max_tracking_error 0.2"):
        assert f"{text} ({shipped})" in line
    assert "timeout 0.2 (command line)" in line
    assert re.search(r"velocity \[0\.\d+.*\(the LWR's\)", line)
