# SPDX-License-Identifier: Apache-2.0
"""Kinesthetic teaching in physics, the demonstrator's rule, and the objects' way."""

import itertools
from functools import cache

import numpy as np
import pytest

from experiments.teaching.gripper import ToolboxGripper
from experiments.teaching.objects import ObjectHolder, ToolboxObjects
from experiments.teaching.recordings import ToolboxOrder, demonstrate
from intent_recognition.kinematics.inverse import branch_of
from intent_recognition.kinematics.lwr import LWR_LIMITS, forward_kinematics, hand_position
from intent_recognition.signals import homogeneous
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.coworker.styles import HOLD, PLATE, SCREW, STYLES, TASKS
from sim_bridge.scenarios.toolbox import HOME, handover_point, handover_rotation
from sim_bridge.scenarios.toolbox.scene import ARM_BRANCH, arm_posture, home_pose, stand_pose

demonstrate_once = cache(demonstrate)


def shown(task):
    return demonstrate_once(ToolboxOrder(1, "train", task, 0))


@pytest.mark.parametrize("task", TASKS)
def test_every_goal_is_reached_on_one_branch_with_margin(task):
    style = STYLES[task]
    for signs in itertools.product((-1, 0, 1), repeat=3):
        goal = style.goal_centre_m + style.goal_half_width_m * np.array(signs)
        target = homogeneous(handover_rotation(task), handover_point(task, goal))
        q = arm_posture(target)
        np.testing.assert_allclose(forward_kinematics(q), target, atol=1e-9)
        assert branch_of(q) == ARM_BRANCH
        assert np.min(LWR_LIMITS.upper - np.abs(q)) > np.radians(7.0)


@pytest.mark.slow
def test_places_and_ends_of_the_arm_are_those_of_the_rule():
    a, b = np.array([0.8, 0.1, 0.3]), np.array([0.7, -0.1, 0.25])
    np.testing.assert_array_equal(handover_point(SCREW, a), handover_point(SCREW, b))
    for task in (PLATE, HOLD):
        np.testing.assert_allclose(handover_point(task, a) - handover_point(task, b), a - b)
    assert 0.001 < np.mean([shown(task).teaching_error_m for task in TASKS]) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_the_arm_is_taught_within_limits_and_carries_the_object_to_where_the_rule_says(task):
    arm = shown(task).arm
    assert np.all(np.abs(arm.positions_rad) < LWR_LIMITS.upper - 0.1)
    assert np.all(np.abs(arm.velocities_rad_s) < LWR_LIMITS.velocity)
    assert np.abs(arm.positions_rad[0] - HOME).max() < 0.03
    assert arm.strongest_pull_n < 40.0
    assert np.linalg.norm(arm.hand_m[-1] - arm.hand_m[-11]) < 0.1 * 0.02
    arm = shown(task).arm
    order = [holder for holder, _ in itertools.groupby(arm.holders)]
    if task == HOLD:
        assert order == [ObjectHolder.WORKER, ObjectHolder.ROBOT]
    else:
        assert order == [ObjectHolder.STAND, ObjectHolder.ROBOT, ObjectHolder.WORKER]
        assert np.ptp(arm.object_m[:20], axis=0).max() < 1e-3
    held = np.array([holder is ObjectHolder.ROBOT for holder in arm.holders])
    distance = np.linalg.norm(arm.object_m - arm.hand_m, axis=1)[held]
    assert np.ptp(distance) < 0.01


@pytest.mark.slow
def test_gripper_takes_on_passing_slowly_and_releases_at_rest():
    q_home, q_stand = HOME, arm_posture(stand_pose(PLATE))
    there_m = handover_point(PLATE, STYLES[PLATE].goal_centre_m)
    away = arm_posture(homogeneous(handover_rotation(PLATE), there_m))
    with SimulatedArm(q_home) as arm:
        gripper = ToolboxGripper(arm)
        gripper.set_task(PLATE)
        arm.before_step.append(lambda _: gripper.update())
        seen = [gripper.held]
        for q, steps in ((q_home, 100), (q_stand, 1500), (away, 2500)):
            origin = arm.reference.position
            for n in range(steps):
                s = min(1.0, n / 900)
                arm.set_reference(origin + (q - origin) * s * s * (3 - 2 * s))
                arm.step()
                if gripper.held != seen[-1]:
                    seen.append(gripper.held)
        assert seen == ["", PLATE, ""]
        assert gripper.objects.holders[PLATE] is ObjectHolder.WORKER
        gripper.set_task("")
        gripper.set_task(PLATE)
        assert gripper.objects.holders[PLATE] is ObjectHolder.STAND
        gripper.set_task("unheard of")
        assert gripper.held == ""


def test_a_held_plate_weighs_on_the_arm_and_is_compensated():
    with SimulatedArm(HOME) as arm:
        objects = ToolboxObjects(arm)
        arm.step(200)
        before = arm.state().torque
        objects.give_to_robot(PLATE)
        arm.step(1500)
        loaded = arm.state().torque
        assert abs(loaded[1] - before[1]) > 1.0
        assert np.linalg.norm(hand_position(arm.state().q) - home_pose()[:3, 3]) < 0.002
        objects.give_to_worker(PLATE)
        arm.step(1500)
        np.testing.assert_allclose(arm.state().torque, before, atol=0.05)
