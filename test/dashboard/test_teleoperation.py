# SPDX-License-Identifier: Apache-2.0
"""What is shown from the page: the arm goes along as long as it is the arm that was asked."""

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.synthetic_demonstration import SyntheticDemonstration
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.nodes import qos
from sim_bridge.arm import find_robot

SHOWN = SyntheticDemonstration(np.zeros(3), np.full(3, 0.1), np.zeros(3), 0.1, rest_s=0.05)
PANDA = find_robot("panda")


def stays(state):
    """Nothing happens."""


def another_comes(state):
    """Another arm with as many joints is there."""
    state.take_joints(JOINT_NAMES, np.zeros(7))


def goes(state):
    """No joint states and no description any more."""
    state.joints.clear()
    state.description = ""


@pytest.mark.parametrize(("happens", "commands"), [(stays, 1), (another_comes, 0), (goes, 0)])
def test_a_demonstration_ends_whatever_becomes_of_the_arm(harness, happens, commands):
    state = CellState(description=PANDA.description)
    state.take_joints(PANDA.joint_names, PANDA.ready)
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
