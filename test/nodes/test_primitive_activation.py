# SPDX-License-Identifier: Apache-2.0
"""The activation node on its topics, on simulated time, with a fake estimator and arm."""

import re
import time
from collections import Counter
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from activation_graph import GOALS, HOME, LABELS, Graph, predicted, reference
from joint_trajectories import build_joint_trajectory
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import IntentError
from intent_recognition.kinematics.lwr import JOINT_NAMES, LWR_LIMITS
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    stamp_ns,
    to_joint_state,
    trajectory_arrays,
)
from intent_recognition.nodes.diagnostics import Level, RejectionError
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from sim_bridge.arm import find_robot


@pytest.fixture
def graph(harness):
    return Graph(harness)


def check_commands(commands):
    assert commands
    names = list(JOINT_NAMES)
    for message in commands:
        times, q, rest = trajectory_arrays(message)
        assert message.joint_names == names and times[0] == 0.0 and np.all(np.diff(times) > 0)
        assert all(len(point.effort) == 0 for point in message.points)
        assert np.all(rest["velocities"][-1] == 0.0)
        assert np.all((q > LWR_LIMITS.lower) & (q < LWR_LIMITS.upper))
        assert np.all(np.abs(rest["velocities"]) <= 0.9 * LWR_LIMITS.velocity * (1 + 1e-6))
        assert np.all(np.abs(q[0]) < np.pi)
    for before, after in pairwise(commands):
        was, now = (reference(one, stamp_ns(after)) for one in (before, after))
        np.testing.assert_allclose(now[0], was[0], atol=1e-7)
        np.testing.assert_allclose(now[1], was[1], atol=1e-6)
        assert stamp_ns(after) >= stamp_ns(before)


@pytest.mark.parametrize(("rate_hz", "period_ms"), [(1.0, 40), (20.0, 25), (200.0, 5)])
def test_silence_is_noticed_between_updates_however_rare_they_are(harness, rate_hz, period_ms):
    """And updates come when they are due."""
    node = Graph(harness, command_rate=rate_hz).node
    assert node._timer.timer_period_ns == 1_000_000 * period_ms


@pytest.mark.slow
def test_an_interaction_on_the_topics(graph):
    late = graph.harness.collect(String, "intent/active_task", qos.LATCHED)
    graph.harness.spin_until(lambda: late, what="that no task is active")
    graph.begin()
    graph.until(lambda: graph.mode == "executing")
    graph.until(lambda: graph.mode == "homing")
    np.testing.assert_allclose(graph.arm(), HOME + GOALS["plate"] + graph.shift, atol=0.02)
    graph.until(lambda: graph.mode == "idle")
    assert [message.data for message in (late[0], *graph.active)] == ["", "plate", ""]
    np.testing.assert_allclose(graph.arm(), HOME, atol=1e-6)
    assert len(graph.commands) > 20
    check_commands(graph.commands)
    graph.run(20)  # the human still holds still: not again
    assert graph.mode == "idle"
    graph.task = "idle"
    graph.step()
    graph.begin("screw")
    graph.until(lambda: graph.mode == "executing")
    check_commands(graph.commands)


SPOIL = {
    "wrong_joint_names": lambda m: setattr(m, "joint_names", ["elbow", *JOINT_NAMES[1:]]),
    "wrong_size": lambda m: setattr(m.points[3], "positions", [0.0] * 6),
    "not_finite": lambda m: setattr(m.points[3], "positions", [float("nan")] * 7),
    "non_monotone_times": lambda m: setattr(
        m.points[4], "time_from_start", m.points[3].time_from_start
    ),
    "too_few_points": lambda m: setattr(m, "points", m.points[:1]),
    "no_task": lambda m: setattr(m.header, "frame_id", ""),
}
"""Faults of messages; what is out of time: test_activation_faults.py."""
BAD_TASKS = {"names": LABELS}, {"names": ("plate", "screw")}


def send_bad(graph):
    """Send a bad message each time; the reason why it is rejected."""
    for fault, spoil in SPOIL.items():
        message = predicted("plate", graph.onset_ns)
        spoil(message)
        graph.send_prediction(message)
        yield fault
    for case in BAD_TASKS:
        graph.send_tasks(p=[0.5, 0.5], **case)
        yield "bad_tasks"
    for fault, n, last, time_ns in (
        ("joint_states_incomplete", 6, 0.0, 1),
        ("joint_states_not_finite", 7, np.nan, graph.now_ns + 1),
        ("joint_states_zero_stamp", 7, 0.0, 0),
        ("joint_state_not_increasing", 7, 0.0, 1),
    ):
        q = np.array([*HOME[: n - 1], last])
        message = to_joint_state(JOINT_NAMES[:n], q, time_ns=time_ns)
        graph.hear("joint_states", message)
        yield fault


@pytest.mark.slow
def test_bad_messages_are_rejected_by_reason_and_harm_nothing(graph):
    graph.begin(already_s=0.2)
    graph.until(lambda: graph.mode == "executing")
    expected = Counter()
    for fault in send_bad(graph):
        expected[fault] += 1
        assert graph.rejected(fault) == expected[fault], fault
        graph.step()
        graph.tick()
    assert graph.mode == "executing"
    values = graph.report()[1]
    assert all(values[f"rejected {fault}"] == str(n) for fault, n in expected.items())
    graph.until(lambda: graph.mode == "homing")
    check_commands(graph.commands)


def test_diagnostics_say_why_a_recognised_task_is_not_executed(graph):
    graph.begin()
    uncertain = predicted("plate", graph.onset_ns)
    uncertain.points[-1].effort = [0.05] * 6 + [0.52]
    for _ in range(8):
        graph.tick()
        graph.send_joints()
        graph.send_prediction(uncertain)
        graph.send_tasks()
    text = "recognised plate, but the predicted end is uncertain: 0.52 rad, limit 0.35"
    status, values = graph.report()
    assert status.level == b"\x01" and status.message == text
    assert values["last held back"] == text and "rejected uncertain_end" not in values
    graph.task = "idle"
    graph.step()
    graph.step()
    status, values = graph.report()
    assert status.level == b"\x00" and status.message == "idle"
    assert values["rejected uncertain_end"] == "1" and values["last held back"] == text


def test_reset_sends_the_arm_home(graph):
    graph.begin(already_s=0.2)
    graph.until(lambda: graph.mode == "executing")
    assert graph.harness.trigger("/primitive_activation/reset").success
    assert graph.mode == "homing"


def test_deactivating_brakes_with_its_limits_and_activating_starts_clean(graph):
    graph.begin(already_s=0.2)
    graph.until(lambda: graph.mode == "executing")
    graph.until(lambda: np.abs(graph.arm() - HOME).max() > 0.02)
    n = len(graph.commands)
    graph.node.trigger_deactivate()
    assert len(graph.commands) == n + 1
    check_commands(graph.commands)
    brake_s = trajectory_arrays(graph.commands[-1])[0][-1]
    end_ns = stamp_ns(graph.commands[-1]) + round(brake_s * 1e9)
    assert brake_s < 1.0 and graph.now_ns < end_ns
    slower = [Parameter("velocity_scale", value=0.3)]
    (refused,) = graph.node.set_parameters(slower)
    assert not refused.successful and "braking" in refused.reason
    while graph.now_ns <= end_ns:
        graph.tick()
    (taken,) = graph.node.set_parameters(slower)
    assert taken.successful, taken.reason
    graph.node.trigger_activate()
    assert graph.mode == "idle"


def test_joints_of_another_arm_need_limits(harness):
    names = tuple(f"joint_{i}" for i in range(7))
    graph = Graph(harness)
    graph.begin()
    graph.send_prediction(predicted("plate", graph.onset_ns, names=names))
    assert graph.rejected("wrong_joint_names") == 1 and graph.node.activation is None


def test_limits_of_another_arm_are_those_of_its_description(harness):
    panda = find_robot("panda")
    names = list(panda.joint_names)
    node = harness.node(PrimitiveActivation, autostart=False, joint_names=names)
    assert node.trigger_configure() == TransitionCallbackReturn.FAILURE
    harness.hear(node, "robot_description", String(data=panda.description))
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    np.testing.assert_array_equal(node._limits.upper, panda.limits.upper)
    assert "of robot_description" in node._settings.limits_in_force(tuple(names), {})
    lower = re.sub(r'upper="[^"]*"', 'upper="0.5"', panda.description)
    harness.hear(node, "robot_description", String(data=lower))
    assert node._settings.settings(tuple(names), {}).limits.upper.max() == 0.5
    with pytest.raises(RejectionError, match=r"elbow: robot_description moves panda_\w+, .*model"):
        node._settings.settings(("elbow",), {})


def test_a_prediction_that_is_rejected_does_not_fix_the_joints(harness):
    graph = Graph(harness, home=None)
    degrees = np.full((5, 6), 50.0)
    message = build_joint_trajectory(
        JOINT_NAMES[:6], np.arange(5.0), degrees, 0.0 * degrees, time_ns=graph.now_ns
    )
    message.header.frame_id = "plate"
    graph.send_prediction(message)
    assert graph.rejected("outside_range") == 1 and graph.node.joint_names == ()
    graph.begin()
    graph.send_prediction()
    assert graph.node.joint_names == JOINT_NAMES


@pytest.mark.parametrize("name", ["lower", "upper", "velocity"])
def test_a_limit_that_is_given_alone_counts_beside_those_of_the_arm(harness, name):
    own = 0.25 * getattr(LWR_LIMITS, name)
    overrides = {"joint_names": list(JOINT_NAMES), "velocity_scale": 1.0, name: own.tolist()}
    node = harness.node(PrimitiveActivation, **overrides)
    for limit in ("lower", "upper", "velocity"):
        expected = own if limit == name else getattr(LWR_LIMITS, limit)
        np.testing.assert_array_equal(getattr(node._limits, limit), expected)


@pytest.mark.parametrize(
    "wrong",
    [
        {"velocity": [0.5] * 6, "joint_names": list(JOINT_NAMES)},
        {"threshold": 0.2},
        {"home": np.rad2deg(HOME).tolist(), "joint_names": list(JOINT_NAMES)},
        {"n_observations": 0},
    ],
)
def test_wrong_parameters_are_errors_at_start(harness, wrong):
    with pytest.raises(IntentError):
        harness.node(PrimitiveActivation, **wrong)


@pytest.mark.parametrize("n", [1, 7])
def test_velocities_that_the_hardware_has_not_are_none(graph, n):
    """ros2_control's joint_state_broadcaster fills them with NaN."""

    def send():
        nothing = np.where(np.arange(7) < n, np.nan, 0.0)
        message = to_joint_state(JOINT_NAMES, graph.arm(), nothing, time_ns=graph.now_ns)
        graph.hear("joint_states", message)

    graph.send_joints = send
    graph.run(10)  # without velocities the arm must be seen to rest
    graph.begin()
    graph.until(lambda: graph.mode == "executing")
    assert graph.rejected("joint_states_not_finite") == 0


@pytest.mark.parametrize("allowed", [False, True])
def test_two_who_command_are_an_error_and_refused(harness, allowed):
    """Until the other is gone; the page may move the arm by hand."""
    graph = Graph(harness, allow_shared_arm=allowed)
    page = harness.add(Node("dashboard"))
    page.create_publisher(JointTrajectory, "joint_trajectory", qos.COMMAND)

    def until(mode):
        graph.until(lambda: graph.node._look_for_silence() or graph.mode == mode)

    graph.begin()
    until("executing")
    other_page = harness.add(Node("dashboard", namespace="other"))
    other = other_page.create_publisher(JointTrajectory, "/joint_trajectory", qos.COMMAND)
    harness.spin_until(lambda: graph.node._output.shared, what="the other")
    status, values = graph.report()
    assert status.level == b"\x02" and "publishes on /joint_trajectory, too" in status.message
    assert values.get("rejected shared_arm") == (None if allowed else "1")
    if allowed:
        assert graph.mode in ("executing", "arrived")
        return
    until("idle")
    n = graph.seen("joint_trajectory")
    assert graph.commands[-1].points[-1].velocities.tolist() == [0.0] * 7
    graph.run(30)
    assert graph.seen("joint_trajectory") == n
    assert graph.active[-1].data == ""
    _, values = graph.report()
    assert (values["mode"], values["active task"]) == ("idle", "none")
    graph.node.set_parameters([Parameter("allow_shared_arm", value=True)])
    until("executing")
    graph.node.set_parameters([Parameter("allow_shared_arm", value=False)])
    until("idle")
    other_page.destroy_publisher(other)
    harness.spin_until(lambda: not graph.node._output.shared, what="its end")
    until("executing")


def test_a_recording_of_joint_states_obeys_nobody(harness):
    graph = Graph(harness)
    graph.begin()
    graph.until(lambda: graph.mode == "executing")
    for name, obeys in (("driver", True), ("rosbag2_player", False)):
        harness.add(Node(name)).create_publisher(JointState, "joint_states", qos.STATE)

        def is_there(name=name):
            there = graph.node.get_publishers_info_by_topic("/joint_states")
            return name in [info.node_name for info in there]

        harness.spin_until(is_there, what=name)
        graph.node._look_for_silence()
        assert graph.node.activation.arm.obeys == obeys


def test_a_publisher_whose_node_is_not_discovered_yet_is_no_other(harness, monkeypatch):
    """Unless it never gets a name; it may be the page."""
    graph = Graph(harness)
    output, named = graph.node._output, "_NODE_NAME_UNKNOWN_"

    def there(_topic):
        return [SimpleNamespace(node_name=named, node_namespace="/", endpoint_gid=[1, 2])]

    monkeypatch.setattr(graph.node, "get_publishers_info_by_topic", there)
    assert not any(output.look_for_others() for _ in range(19))
    named = "dashboard"
    assert not output.look_for_others()
    named = "_NODE_NAME_UNKNOWN_"
    assert not any(output.look_for_others() for _ in range(19))
    assert output.look_for_others() and named in output.shared


@pytest.mark.slow
@pytest.mark.parametrize("dead", ["intent/tasks", "joint_states"])
def test_a_sender_that_died_is_named_within_a_second(graph, dead, monkeypatch):
    both, now_s = ("intent/tasks", "joint_states"), [time.monotonic()]
    (other,) = {*both} - {dead}
    monkeypatch.setattr(graph.node.diagnostics, "_clock", lambda: now_s[0])
    reports = graph.harness.said(graph.node, "/diagnostics")

    def speak(*streams):
        graph.tick()
        fingers = to_joint_state(["finger"], [0.0], time_ns=graph.now_ns)
        graph.hear("joint_states", fingers)  # of a driver that lives
        for stream in streams:
            (graph.send_tasks if stream == "intent/tasks" else graph.send_joints)()
        graph.node._look_for_silence()
        return [status.message for report in reports for status in report.status]

    graph.begin()
    graph.until(lambda: graph.mode == "executing")
    assert speak(*both) == []
    now_s[0] += 0.9
    (silent,) = speak(other)
    assert f"silent: {dead}" in silent and other not in silent
    assert "silent" not in speak(*both)[1]
    assert not graph.rejected("joint_states_incomplete")


@pytest.mark.parametrize("wrong", [{"time_ns": 0}, {"late_s": 5.0}, {"q": np.full(7, np.nan)}])
def test_joint_states_that_cannot_be_used_count_as_silence(graph, wrong, monkeypatch):
    now_s = [time.monotonic()]
    monkeypatch.setattr(graph.node.diagnostics, "_clock", lambda: now_s[0])
    graph.begin()
    graph.step()
    now_s[0] += 0.9
    at_ns = wrong.get("time_ns", graph.now_ns - round(wrong.get("late_s", 0.0) * 1e9))
    graph.hear("joint_states", to_joint_state(JOINT_NAMES, wrong.get("q", HOME), time_ns=at_ns))
    graph.send_tasks()
    graph.node._look_for_silence()
    status, _ = graph.report()
    assert status.level == bytes([Level.WARN])
    assert "silent: joint_states of the arm" in status.message
