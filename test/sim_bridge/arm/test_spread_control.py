# SPDX-License-Identifier: Apache-2.0
"""Stiffness from the spread of the prediction, alone and in the node."""

import numpy as np
import pytest
from joint_trajectories import build_joint_trajectory
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, TrajectoryError
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.qos import COMMAND
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.arm.spread_control import HOLD_S, SpreadControl, resting_gains
from sim_bridge.nodes.lwr_sim import LwrSim
from sim_bridge.scenarios.toolbox.scene import HOME

SURE, UNSURE = np.full(7, 0.005), np.full(7, 0.15)


def deflection(control, force_n=8.0):
    """How far a push moves the resting hand [m], and where it is a while later."""
    with SimulatedArm(HOME) as arm:
        if control is not None:
            arm.before_step.append(control.control)
        arm.step(50)
        before = arm.hand_pose().position
        arm.apply_force(np.array([0.0, force_n, 0.0]), n_steps=300)
        farthest = 0.0
        for _ in range(40):
            arm.step(10)
            farthest = max(farthest, np.linalg.norm(arm.hand_pose().position - before))
        arm.step(6000)
        return farthest, np.linalg.norm(arm.hand_pose().position - before)


def taken(std, length_s=20.0):
    control = SpreadControl()
    control.take(0.0, JOINT_NAMES, [0.0, length_s], [std, std])
    return control


@pytest.mark.slow
def test_a_sure_prediction_is_held_firmly_and_an_unsure_one_softly():
    firm, soft = deflection(taken(SURE)), deflection(taken(UNSURE))
    assert firm[0] < 0.5 * soft[0]
    assert firm[1] < 1e-3
    assert soft[1] < 0.01


def test_gains_go_from_point_to_point_and_end_after_a_hold():
    control = SpreadControl()
    control.take(1.0, JOINT_NAMES[::-1], [0.0, 2.0], [np.arange(7) * 0.01 + 0.01, SURE])
    first = resting_gains(np.arange(7)[::-1] * 0.01 + 0.01)
    last = resting_gains(SURE)
    np.testing.assert_allclose(control.gains(0.0), first)
    np.testing.assert_allclose(control.gains(2.0), 0.5 * (np.array(first) + last))
    np.testing.assert_allclose(control.gains(9.0), last)
    assert control.in_force(3.0 + HOLD_S)
    assert not control.in_force(3.1 + HOLD_S)


@pytest.mark.parametrize(
    ("names", "times", "std"),
    [
        (JOINT_NAMES[:6], [0.0], [SURE[:6]]),
        (JOINT_NAMES, [0.0], [[]]),
        (JOINT_NAMES, [], []),
        (JOINT_NAMES, [0.0], [-SURE]),
        (JOINT_NAMES, [0.0], [SURE * np.nan]),
        (JOINT_NAMES, [1.0, 1.0], [SURE, SURE]),
    ],
)
def test_bad_predictions_are_refused_and_the_one_before_stays(names, times, std):
    control = taken(UNSURE)
    before = control.gains(0.0)
    with pytest.raises(TrajectoryError):
        control.take(0.0, names, times, std)
    np.testing.assert_array_equal(control.gains(0.0), before)


def prediction(std):
    times_s = np.array([0.0, 10.0, 20.0])
    return build_joint_trajectory(JOINT_NAMES, times_s, np.tile(HOME, (3, 1)), None, std)


@pytest.mark.slow
def test_the_node_takes_the_spread_of_predictions(harness):
    sender = harness.publisher(JointTrajectory, "intent/robot_trajectory", COMMAND)
    node = harness.node(LwrSim, controller="stochastic_feedback", publish_clock=True)
    harness.connect(sender)
    assert not node.commands.spread.in_force(node.arm.time_s)
    sender.publish(prediction(np.tile(UNSURE, (3, 1))))
    harness.spin_until(lambda: node.commands.spread.in_force(node.arm.time_s))
    expected = resting_gains(UNSURE)
    np.testing.assert_allclose(node.commands.spread.gains(node.arm.time_s), expected)
    sender.publish(prediction(None))
    harness.spin_until(lambda: node.diagnostics.rejected("bad_prediction"))
    assert node.commands.spread.in_force(node.arm.time_s)


def test_low_gains_are_the_default_and_another_name_is_refused(harness):
    assert harness.node(LwrSim).commands.spread is None
    with pytest.raises(ArgumentError, match="controller"):
        harness.node(LwrSim, controller="stiff")
