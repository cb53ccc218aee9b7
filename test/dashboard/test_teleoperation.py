# SPDX-License-Identifier: Apache-2.0
"""What is shown from the page: the arm goes along as long as it is the arm that was asked."""

import time
from unittest.mock import Mock

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.dashboard.cell import CellState, PersonState
from intent_recognition.dashboard.synthetic_demonstration import SyntheticDemonstration
from intent_recognition.dashboard.teleoperation import SILENT_ARM, Teleoperation
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.nodes import qos
from sim_bridge.arm import find_robot

SHOWN = SyntheticDemonstration(np.zeros(3), np.full(3, 0.1), np.zeros(3), 0.1, rest_s=0.05)
PANDA = find_robot("panda")


def stays(state):
    """Nothing happens."""


def another_comes(state):
    """Another arm with as many joints is there."""
    state.take_joints(JOINT_NAMES, np.zeros(7), np.inf)


def goes(state):
    """No joint states and no description any more."""
    state.joints.clear()
    state.description = ""


def dies(state):
    """Its last joint states were long ago."""
    state.take_joints(PANDA.joint_names, PANDA.ready, time.monotonic() - 1.1)


CASES = [(stays, 1), (another_comes, 0), (goes, 0), (dies, 0)]


@pytest.mark.parametrize(("happens", "commands"), CASES)
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
    for stamp_s, published in ((100.0, 1), (100.0, 1), (99.9, 1), (2.0, 2), (2.1, 3)):
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
