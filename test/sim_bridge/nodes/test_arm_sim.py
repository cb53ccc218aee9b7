# SPDX-License-Identifier: Apache-2.0
"""The arms' nodes: joints, fingers and description of another arm, and what stands about it."""

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from joint_trajectories import build_joint_trajectory
from rclpy.duration import Duration
from scipy.interpolate import CubicSpline
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from experiments.teaching.path import plan_teaching
from intent_recognition.errors import ArgumentError, KinematicsError
from intent_recognition.kinematics import JOINT_NAMES, hand_position
from intent_recognition.nodes.diagnostics import answer_of
from intent_recognition.nodes.qos import COMMAND, FEEDBACK, LATCHED, STATE
from intent_recognition.registry import ANSWERS
from sim_bridge.arm.robots import find_robot
from sim_bridge.coworker.styles import PLATE, STYLES
from sim_bridge.nodes.arm_sim import ArmSim
from sim_bridge.nodes.lwr_sim import LwrSim
from sim_bridge.nodes.pouring_scene import PouringScene
from sim_bridge.scenarios.pouring.live import LiveCounts


def test_a_panda_follows_a_trajectory_and_shows_its_fingers(harness):
    robot = find_robot("panda")
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = harness.node(ArmSim, robot="panda", real_time_factor=5.0)
    descriptions = harness.collect(String, "robot_description", LATCHED)  # late
    harness.spin_until(lambda: states and descriptions and sender.get_subscription_count())
    fingers = ["panda_finger_joint1", "panda_finger_joint2"]
    assert list(states[0].name) == [*robot.joint_names, *fingers]
    np.testing.assert_allclose(states[0].position[:7], robot.ready, atol=1e-6)
    np.testing.assert_allclose(states[0].position[7:], 0.04, atol=1e-6)
    assert descriptions[0].data == robot.description
    goal = robot.ready + 0.2
    rest = np.zeros((2, 7))
    sender.publish(
        build_joint_trajectory(
            robot.joint_names, np.array([0.0, 1.0]), np.stack([robot.ready, goal]), rest
        )
    )
    harness.spin_until(lambda: np.abs(np.array(states[-1].position[:7]) - goal).max() < 3e-3)
    assert node.arm.saturated_steps == 0


def test_time_begins_with_the_person_however_long_others_have_answered(harness):
    """Else the arm, its noise and who estimates from it are older in one run than in another."""
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointState, ANSWERS, FEEDBACK)
    waits = ["coworker_sim", "mocap_ingest"]
    node = harness.node(ArmSim, robot="panda", publish_clock=True, wait_for_answers=waits)
    harness.connect(sender)
    ticks: list[int] = []
    harness.probe.create_timer(0.02, lambda: ticks.append(0))
    sender.publish(answer_of("mocap_ingest", {"mocap/wrist/pose": 0}))
    harness.spin_until(lambda: len(ticks) >= 10)
    assert (node.arm.n_steps, states, node.clock.pacer.dropped_s) == (0, [], 0.0)
    sender.publish(answer_of("coworker_sim", {"/clock": 0}))
    harness.spin_until(lambda: states, what="the first joint state")
    assert states[0].header.stamp == Time(nanosec=node.arm.n_steps * 1_000_000)


def test_of_commands_sent_at_once_each_is_counted(harness):
    """Simulated time would wait in vain for one that a newer one had replaced unseen."""
    robot = find_robot("panda")
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = harness.node(ArmSim, robot="panda")
    harness.connect(sender)
    ways, rest = np.stack([robot.ready, robot.ready]), np.zeros((2, 7))
    for _ in range(3):
        sender.publish(build_joint_trajectory(robot.joint_names, np.array([0, 1.0]), ways, rest))
    assert sender.wait_for_all_acked(Duration(seconds=30))
    harness.spin_until(lambda: node.diagnostics._totals["joint_trajectory"] == 3)


def test_a_box_that_it_touches_is_in_the_diagnostics(harness):
    robot = find_robot("lwr")
    crate = "crate " + " ".join(f"{x:.3f}" for x in hand_position(robot.ready)) + " 0.1 0.1 0.1"
    node = harness.node(ArmSim, boxes=[crate], initial_position=robot.ready.tolist(), scene="none")
    harness.spin_until(lambda: node.surroundings.touches)
    node._report()
    status = node.diagnostics.report()
    told = {item.key: item.value for item in status.values}
    assert int(told["contacts"]) >= 1 and told["last contact"].endswith(" and crate")


def test_where_it_stands_and_begins_can_be_told(harness):
    start = (find_robot("iiwa").ready + 0.1).tolist()
    node = harness.node(ArmSim, robot="iiwa", base_position=[0.2, 0.0, 0.1], initial_position=start)
    assert node.arm.robot.base_position_m == (0.2, 0.0, 0.1)
    np.testing.assert_allclose(node.arm.state().q, start)


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"joint_state_rate": 0.0}, ArgumentError, "joint_state_rate"),
        ({"real_time_factor": -1.0}, ArgumentError, "real_time_factor"),
        ({"stiffness_scale": 0.0}, ArgumentError, "stiffness_scale"),
        ({"robot": "/no/such.urdf"}, ArgumentError, "robot"),
        ({"robot": "panda", "tip": "hand"}, ArgumentError, "tip"),
        ({"robot": "panda", "base_position": [1.0]}, ArgumentError, "base_position"),
        ({"boxes": ["crate 0 0"]}, ArgumentError, "boxes: expected 'name x y z"),
        ({"robot": "panda", "initial_position": [9.0] * 7}, KinematicsError, "panda_joint"),
        ({"robot": "panda", "initial_position": [0.0] * 6}, ArgumentError, "panda_joint1"),
    ],
)
def test_wrong_parameters_are_named(harness, parameters, error, message):
    with pytest.raises(error, match=message):
        harness.node(ArmSim, **parameters)


def fetch_and_carry() -> JointTrajectory:
    path = plan_teaching(
        np.random.default_rng(0), PLATE, STYLES[PLATE].goal_centre_m, 0.0, 3.0, 3.2
    )
    spline, times_s = CubicSpline(path.stamps_s, path.joints_rad), np.arange(0.1, 3.21, 0.1)
    moving = times_s[:, None] < 3.15
    return build_joint_trajectory(
        JOINT_NAMES, times_s, spline(times_s), moving * spline(times_s, 1)
    )


@pytest.mark.slow
def test_a_plate_is_taken_from_its_stand(harness):
    node = harness.node(LwrSim, real_time_factor=5.0, scene="transfers")
    tasks = harness.publisher(String, "intent/active_task", LATCHED)
    commands = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    holding = harness.collect(Bool, "intent/holding", STATE)
    harness.connect(tasks, commands, node.scene._holding)
    tasks.publish(String(data=PLATE))
    harness.spin_until(lambda: node.scene._world.task == PLATE, what="the task")
    assert not holding
    commands.publish(fetch_and_carry())
    harness.spin_until(lambda: holding, what="the plate between the fingers")
    assert holding[0].data


BAD = [
    ("", [0.2, 4.0, 20.0], "bad_transfer"),
    ("carrying", [0.2, 4.0], "bad_transfer"),
    ("carrying", [0.2, np.nan, 20.0], "not_finite"),
]


@pytest.mark.parametrize(("holding", "values", "reason"), BAD)
def test_a_transfer_that_cannot_be_followed_is_rejected(harness, holding, values, reason):
    node = harness.node(LwrSim, scene="transfers")
    message = JointState(name=["load_share", "weight", "grip_force"], position=values)
    message.header.frame_id = holding
    node.scene._on_transfer(message)
    assert node.diagnostics.rejected(reason) == 1


@pytest.mark.slow
def test_the_persons_hand_is_told_whenever_its_first_pose_came(harness):
    node = harness.node(LwrSim, real_time_factor=5.0, scene="transfers")
    hands = harness.collect(JointState, "coworker/hand", STATE)
    harness.connect(node.scene._hand)
    while node.arm.n_steps % 5 != 3:
        node.arm.step()
    node.scene._on_pose("", PoseStamped())
    harness.spin_until(lambda: hands, what="the force of the hand")
    assert list(hands[0].name) == ["force_x", "force_y", "force_z"]


def test_an_execution_spilled_what_lies_beside_since_it_began(harness, monkeypatch):
    balls = SimpleNamespace(spilled=1)
    world = SimpleNamespace(look=lambda: LiveCounts(39 - balls.spilled, 1, balls.spilled, 0))
    monkeypatch.setattr("sim_bridge.scenarios.pouring.LivePouring", lambda *_: world)
    told = harness.collect(DiagnosticStatus, "intent/feedback", FEEDBACK)
    scene = PouringScene(harness.probe).begin(None, 0, Time)
    harness.spin_until(lambda: scene._feedback.get_subscription_count() > 0, what="a listener")
    for task, now in (("", 1), ("pouring", 1), ("pouring", 3), ("", 4), ("", 5), ("pouring", 5)):
        balls.spilled = now
        scene.set_task(task)
    scene.set_task("")
    harness.spin_until(lambda: len(told) == 2, what="two executions")
    values = [(one.name, one.values[0].key, one.values[0].value) for one in told]
    assert values == [("pouring", "spilled", "3"), ("pouring", "spilled", "0")]
