# SPDX-License-Identifier: Apache-2.0
"""What the page asks of the graph: motions of arm and wrist, and services."""

import time
from copy import deepcopy
from unittest.mock import Mock

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.node import Node
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.dashboard import teleoperation as module
from intent_recognition.dashboard.cell import CellState, PersonState
from intent_recognition.dashboard.commands import Commands
from intent_recognition.dashboard.synthetic_demonstration import (
    SyntheticDemonstration,
    arm_motion,
    sample_demonstration,
)
from intent_recognition.dashboard.teleoperation import SILENT_ARM, Teleoperation
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import (
    JOINT_NAMES,
    LWR_LIMITS,
    RATE_TOLERANCE,
    position_violation,
)
from intent_recognition.motion import JointReference
from intent_recognition.motion.blending import Offset
from intent_recognition.nodes import qos
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from sim_bridge.arm import TrajectoryCommand, find_robot

SHOWN = SyntheticDemonstration(np.zeros(3), np.full(3, 0.1), np.zeros(3), 0.1, rest_s=0.05)
PANDA = find_robot("panda")


def dies(state):
    """Its last joint states were long ago."""
    state.take_joints(PANDA.joint_names, PANDA.ready, time.monotonic() - 1.1)


CASES = {
    "it stays": (lambda state: None, 1),
    "another comes": (lambda state: state.take_joints(JOINT_NAMES, np.zeros(7), np.inf), 0),
    "it goes": (lambda state: (state.joints.clear(), setattr(state, "description", "")), 0),
    "it dies": (dies, 0),
}
"""What becomes of the arm, and how many commands are sent."""


@pytest.mark.parametrize(("happens", "commands"), CASES.values(), ids=CASES)
def test_a_demonstration_ends_whatever_becomes_of_the_arm(harness, happens, commands):
    state = CellState(description=PANDA.description)
    state.take_joints(PANDA.joint_names, PANDA.ready, np.inf)
    teleoperation = Teleoperation(harness.probe, state, hand_link=PANDA.tip)
    sent = harness.collect(JointTrajectory, "joint_trajectory", qos.COMMAND)
    harness.spin_until(teleoperation.can_move_arm)
    teleoperation.take_wrist(np.zeros(3))
    done = []
    teleoperation.play(SHOWN, np.array(PANDA.ready) + 0.1, lambda: done.append(True))
    happens(state)
    harness.spin_until(lambda: done and len(sent) >= commands)
    assert np.allclose(teleoperation.position, SHOWN.goal_m)
    assert len(sent) == commands
    teleoperation.release_wrist()


@pytest.mark.parametrize("named", [(), ("anna", "ben")])
def test_the_wrist_is_the_first_persons(harness, named):
    topics = ["mocap/wrist/pose", *(f"mocap/{name}/wrist/pose" for name in named)]
    state = CellState(people={name: PersonState() for name in named or ("",)})
    teleoperation = Teleoperation(harness.probe, state)
    first, *others = [harness.collect(PoseStamped, topic, qos.SENSOR) for topic in topics]
    assert not teleoperation.others_move_wrist()
    teleoperation.take_wrist(np.full(3, 0.2))
    harness.spin_until(lambda: all([first, *others[:1]]), what="the wrist")
    assert not teleoperation.others_move_wrist() and not any(others[1:])
    teleoperation.release_wrist()
    other = harness.publisher(PoseStamped, topics[:2][-1], qos.SENSOR)
    harness.spin_until(teleoperation.others_move_wrist, what="who moves it")
    harness.probe.destroy_publisher(other)


def test_the_wrist_goes_on_where_the_clock_was_set_back():
    node = Mock()
    teleoperation = Teleoperation(node, CellState())
    teleoperation.take_wrist(np.zeros(3))
    for stamp_s, published in ((100.0, 1), (100.0, 1), (99.95, 1), (99.5, 2), (99.6, 3)):
        node.get_clock().now().nanoseconds = round(stamp_s * 1e9)
        teleoperation._publish()
        assert teleoperation._poses[0].publish.call_count == published


def test_an_arm_whose_driver_died_is_not_moved_and_the_reason_is_told(harness):
    state = CellState(description=PANDA.description)
    teleoperation = Teleoperation(harness.probe, state, hand_link=PANDA.tip)
    sent = harness.collect(JointTrajectory, "joint_trajectory", qos.COMMAND)
    dies(state)
    harness.spin_until(lambda: harness.probe.count_subscribers("joint_trajectory") == 1)
    assert not teleoperation.can_move_arm()
    assert teleoperation.arm_problem == SILENT_ARM
    for ask in (teleoperation.drag_hand, teleoperation.posture_at):
        with pytest.raises(KinematicsError, match="joint states have stopped"):
            ask(np.array([0.4, 0.1, 0.4]))
    state.take_joints(PANDA.joint_names, PANDA.ready, time.monotonic())
    assert teleoperation.can_move_arm() and teleoperation.arm_problem == ""
    teleoperation.drag_hand(teleoperation.hand() + 0.01)
    harness.spin_until(lambda: sent, what="a command")
    assert len(sent) == 1


@pytest.fixture
def told():
    return []


@pytest.fixture
def commands(harness, told):
    return Commands(harness.probe, lambda ok, text: told.append((ok, text)))


def test_page_knows_whether_the_robot_helps_whoever_switched_it(harness, commands, told):
    node = harness.add(PrimitiveActivation())
    harness.spin_until(commands.can_switch_help)
    for helps in (False, True):
        commands.robot_helps(helps)
        harness.spin_until(lambda wanted=helps: node.active is wanted)
        commands.ask_for_help()
        harness.spin_until(lambda wanted=helps: commands.helping is wanted)
    harness.spin_until(lambda: len(told) == 2)
    commands.robot_helps(True)  # as it is
    harness.spin_until(lambda: len(told) == 3)
    assert [(ok, bool(text)) for ok, text in told] == [(True, True)] * 2 + [(True, False)]


def test_a_service_that_does_not_answer_is_called_once(harness, commands, told, monkeypatch):
    silent = Node("silent")
    try:
        silent.create_service(Trigger, "silent/undo", lambda _, answer: answer)
        harness.spin_until(lambda: commands.offers("silent/undo"))
        for _ in range(100):
            commands.trigger("silent/undo")
        assert told == [(False, "silent/undo has not answered the last call yet")] * 99
        monkeypatch.setattr("intent_recognition.dashboard.commands.ANSWER_S", 0.0)
        for _ in range(5):
            commands.trigger("silent/undo")
        assert told[99:] == [(False, "silent/undo did not answer")] * 5
        assert len(commands._clients["silent/undo"]._pending_requests) == 1
        monkeypatch.undo()
        harness.executor.add_node(silent)
        harness.spin_until(lambda: len(told) > 104)
        assert told[-1][1] == "silent/undo"
    finally:
        harness.executor.remove_node(silent)
        silent.destroy_node()


def test_no_answer_is_awaited_of_a_node_that_is_gone(harness, commands, told):
    dying = Node("dying")
    dying.create_service(Trigger, "dying/stop", lambda _, answer: answer)
    harness.spin_until(lambda: commands.offers("dying/stop"))
    commands.trigger("dying/stop")
    commands.give_up_lost()
    assert not told
    dying.destroy_node()
    harness.spin_until(lambda: not commands.offers("dying/stop"))
    commands.give_up_lost()
    assert told == [(False, "dying/stop did not answer")]


def test_nobody_there_is_told_at_once(commands, told):
    commands.trigger("nobody/start")
    assert told == [(False, "no node offers nobody/start")]


POINTS = arrays(float, 3, elements=st.floats(-1.0, 1.0))


@pytest.mark.slow
@given(POINTS, POINTS, st.floats(0.8, 4.0))
def test_wrist_rests_at_its_start_and_at_its_goal(start, goal, duration):
    show = SyntheticDemonstration(start, goal, np.array([0.0, 0.0, 0.05]), duration)
    for at in (0.0, show.rest_s):
        assert np.allclose(show.wrist(at), start)
    for at in (show.rest_s + duration, show.length_s):
        assert np.allclose(show.wrist(at), goal)
    assert show.rest_s < show.arm_start_s  # the arm follows the human
    assert show.arm_start_s + show.arm_duration_s > show.rest_s + duration


@given(POINTS, POINTS, st.integers(0, 1000))
def test_goals_of_wrist_and_hand_shift_together(start, goal, seed):
    drawn, shift = sample_demonstration(np.random.default_rng(seed), start, goal, 2.0, 0.03)
    assert np.allclose(drawn.goal_m, goal + shift)
    assert abs(drawn.bow_m @ (drawn.goal_m - start)) < 1e-9
    assert 1.4 <= drawn.duration_s <= 2.6


def test_the_arm_moves_from_rest_to_rest_within_its_time():
    start, goal = np.zeros(7), np.linspace(-1.0, 1.0, 7)
    plan = arm_motion(JointReference.at_rest(start), goal, 1.7, LWR_LIMITS)
    times, q, qd = plan.times_s, plan.positions, plan.velocities
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(1.7)
    assert np.allclose(q[[0, -1]], [start, goal])
    assert np.allclose(qd[[0, -1]], 0.0)
    slopes = (q[2:] - q[:-2]) / (times[2:] - times[:-2])[:, None]
    assert np.max(np.abs(slopes - qd[1:-1])) < 0.02


@given(st.integers(0, 1000))
def test_the_shortest_motion_keeps_the_limits_and_reaches_one(seed):
    start, goal = np.random.default_rng(seed).uniform(LWR_LIMITS.lower, LWR_LIMITS.upper, (2, 7))
    plan = arm_motion(JointReference.at_rest(start), goal, 0.0, LWR_LIMITS)
    motion = Offset(start - goal, np.zeros(7), np.zeros(7), plan.duration_s).largest()
    shares = np.array(motion) / (LWR_LIMITS.velocity, LWR_LIMITS.acceleration)
    assert 0.98 < shares.max() <= 1.0 + RATE_TOLERANCE
    TrajectoryCommand.validated(JOINT_NAMES, plan.times_s, plan.positions, plan.velocities)


@pytest.fixture
def dragged(monkeypatch):
    """The page's hand on an arm, its state, what it sends, and the time [s] in a list."""
    state, sent, now_s = CellState(description=PANDA.description), [], [0.0]
    monkeypatch.setattr(module, "elapsed_s", lambda node: now_s[0])
    node = Mock()
    node.create_publisher().publish = lambda message: sent.append(deepcopy(message))
    teleoperation = Teleoperation(node, state, hand_link=PANDA.tip)
    return teleoperation, state, sent, now_s


def test_what_is_dragged_on_goes_on_at_the_speed_it_has(dragged):
    """A controller takes a new command at once: a start at rest would be a jump of velocity."""
    teleoperation, state, sent, now_s = dragged
    state.take_joints(PANDA.joint_names, PANDA.ready, np.inf)
    goal = np.array(PANDA.ready) + 0.3
    teleoperation.send_arm(goal, 1.0)
    plan = arm_motion(JointReference.at_rest(PANDA.ready), goal, 1.0, teleoperation._found().limits)
    for now_s[0], follows in ((0.4, True), (0.45, False)):
        asked = plan.at(now_s[0])
        state.take_joints(PANDA.joint_names, asked.position - (0.02 if follows else 0.5), np.inf)
        teleoperation.send_arm(goal + 0.1, 1.0)
        first = sent[-1].points[0]
        if follows:
            assert np.abs(asked.velocity).min() > 0.1
            np.testing.assert_allclose([first.positions, first.velocities], asked[:2], atol=1e-9)
    assert not np.any(first.velocities)
    np.testing.assert_allclose(first.positions, asked.position - 0.5)


@pytest.mark.parametrize("there_s", [0.5, 0.7])
def test_what_is_dragged_to_a_limit_does_not_pass_it(dragged, there_s):
    """From a motion toward it, one that takes its time would go past its goal."""
    teleoperation, state, sent, now_s = dragged
    limits = PANDA.limits
    state.take_joints(PANDA.joint_names, limits.upper - 0.6, np.inf)
    now_s[0] = there_s * teleoperation.send_arm(limits.upper - 0.02, 0.8)
    asked = teleoperation._sent[0].at(now_s[0])
    state.take_joints(PANDA.joint_names, asked.position, np.inf)
    goal = np.minimum(asked.position + 0.05, limits.upper)
    slow = arm_motion(asked, goal, 1.5, limits).positions
    assert position_violation(slow, limits).max() > 0.01
    teleoperation.send_arm(goal, 1.5)
    rows = np.array([point.positions for point in sent[-1].points])
    assert position_violation(rows, limits).max() < 1e-9
    np.testing.assert_allclose(rows[-1], goal)
