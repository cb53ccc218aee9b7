# SPDX-License-Identifier: Apache-2.0
"""The node arm_sim with an arm that is not the LWR: its joints, its fingers, its description."""

import numpy as np
import pytest
from joint_trajectories import build_joint_trajectory
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, KinematicsError
from intent_recognition.kinematics import hand_position
from intent_recognition.nodes.qos import COMMAND, LATCHED, STATE
from sim_bridge.arm.robots import find_robot
from sim_bridge.nodes.arm_sim import ArmSim


def make(harness, **parameters):
    return harness.node(ArmSim, **parameters)


def test_a_panda_follows_a_trajectory_and_shows_its_fingers(harness):
    robot = find_robot("panda")
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = make(harness, robot="panda", real_time_factor=5.0)
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


def test_of_commands_sent_at_once_each_is_counted(harness):
    """Simulated time would wait in vain for one that a newer one had replaced unseen."""
    robot = find_robot("panda")
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = make(harness, robot="panda")
    harness.connect(sender)
    ways, rest = np.stack([robot.ready, robot.ready]), np.zeros((2, 7))
    for _ in range(3):
        sender.publish(build_joint_trajectory(robot.joint_names, np.array([0, 1.0]), ways, rest))
    assert sender.wait_for_all_acked(Duration(seconds=30))
    harness.spin_until(lambda: node.diagnostics._totals["joint_trajectory"] == 3)


@pytest.mark.slow
def test_a_box_in_the_way_stops_it_and_is_in_the_diagnostics(harness):
    robot = find_robot("lwr")
    goal = robot.ready + [0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    place = hand_position(robot.ready + 0.7 * (goal - robot.ready))
    crate = "crate " + " ".join(f"{x:.3f}" for x in place) + " 0.1 0.04 0.4"
    start = robot.ready.tolist()
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = make(harness, boxes=[crate], initial_position=start, real_time_factor=5.0, scene="none")
    harness.spin_until(lambda: states and sender.get_subscription_count())
    ways, rest = np.stack([robot.ready, goal]), np.zeros((2, 7))
    sender.publish(build_joint_trajectory(robot.joint_names, np.array([0.0, 1.0]), ways, rest))
    harness.spin_until(lambda: node.surroundings.touches and node.arm.time_s > 2.0)
    assert states[-1].position[0] < 0.6 - 0.1
    node._report()
    status = node.diagnostics.report()
    told = {item.key: item.value for item in status.values}
    assert int(told["contacts"]) >= 1 and told["last contact"].endswith(" and crate")


def test_where_it_stands_and_begins_can_be_told(harness):
    start = (find_robot("iiwa").ready + 0.1).tolist()
    node = make(harness, robot="iiwa", base_position=[0.2, 0.0, 0.1], initial_position=start)
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
        make(harness, **parameters)
