# SPDX-License-Identifier: Apache-2.0
"""Pouring with the arm: where cup and hand are, and one pour in physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.pouring.pour import pour
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics.lwr import forward_kinematics
from intent_recognition.promp import minimum_jerk
from sim_bridge.containers.generate import make_container
from sim_bridge.scenarios.pouring import OPENING_M, PourPath, SideGrasp, plan_joints, seen_path

LIP = np.array([0.04, 0.0, 0.09])


def random_path(seed, count=20):
    rng = np.random.default_rng(seed)
    offset = rng.uniform(-0.1, 0.1, (count, 3))
    return PourPath(np.arange(count) * 0.1, offset, rng.uniform(-0.5, 2.2, count))


def short_pour(end_deg):
    """Over the second container, lowered and tilted, held and most of the way back, at rest."""
    times = np.linspace(0.0, 4.6, 93)
    over = minimum_jerk(times / 1.8) - 0.7 * minimum_jerk((times - 3.0) / 1.6)
    offset = np.array([-0.02, 0.0, 0.15]) + over[:, None] * [0.0, 0.0, -0.12]
    return PourPath(times, offset, np.deg2rad(end_deg) * over)


@given(st.integers(0, 1000))
def test_path_and_poses_say_the_same_and_the_hand_points_at_the_cup_from_the_side(seed):
    path = random_path(seed)
    poses = SideGrasp(LIP, 0.09).cup_poses(path, OPENING_M)
    back = seen_path(path.times_s, poses, LIP, OPENING_M)
    np.testing.assert_allclose(back.offset_m, path.offset_m, atol=1e-12)
    np.testing.assert_allclose(back.tilt_rad, path.tilt_rad, atol=1e-12)
    path, grasp = random_path(seed), SideGrasp(LIP, 0.09)
    hand, cup = grasp.hand_poses(path, OPENING_M), grasp.cup_poses(path, OPENING_M)
    np.testing.assert_allclose(hand @ grasp.cup_in_hand, cup, atol=1e-12)
    # Away from the base, whatever the tilt: tilting turns the hand about its own axis.
    np.testing.assert_allclose(hand[:, :3, 2], np.tile([1.0, 0.0, 0.0], (len(hand), 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(hand[:, :3, :3]), 1.0)


def test_an_upright_cup_stands_upright_and_pours_along():
    grasp = SideGrasp(LIP, 0.09)
    tilts = np.array([0.0, np.pi / 2.0])
    poses = grasp.cup_poses(PourPath(np.arange(2.0), np.zeros((2, 3)), tilts), OPENING_M)
    np.testing.assert_allclose(poses[0, :3, 2], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(poses[1, :3, 2], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[:, :3, :3] @ LIP + poses[:, :3, 3], [OPENING_M] * 2)


def test_joints_carry_the_hand_along_the_path():
    cup = make_container("mug")
    grasp, path = SideGrasp(cup.lip_point, cup.height_m), short_pour(100.0)
    joints = plan_joints(path, grasp)
    found = forward_kinematics(joints(path.times_s))
    wanted = grasp.hand_poses(path, OPENING_M)
    assert np.abs(found[:, :3, 3] - wanted[:, :3, 3]).max() < 1e-3
    far = PourPath(path.times_s, path.offset_m + [1.0, 0.0, 0.0], path.tilt_rad)
    with pytest.raises(KinematicsError):
        plan_joints(far, grasp)


@pytest.mark.slow
def test_a_pour_loses_no_ball():
    """Led by hand; the arm's own: test_pouring.py."""
    cup, second = make_container("tumbler"), make_container("round_bowl")
    result = pour(
        short_pour(130.0),
        cup,
        second,
        ball_radius_m=0.008,
        n_balls=5,
        rng=np.random.default_rng(1),
        led=True,
    )
    assert (result.n_balls, result.caught, result.kept, result.spilled) == (5, 5, 0, 0)
    assert result.through_wall == 0
    assert result.touched_s == result.strongest_touch_n == 0.0
    assert result.in_cup[0] == 5
    assert np.all(np.diff(result.in_cup) <= 0)
    assert result.strongest_pull_n > 0.0
    asked = np.interp(result.times_s, short_pour(130.0).times_s, short_pour(130.0).tilt_rad)
    assert np.degrees(np.abs(result.path.tilt_rad - asked).max()) < 6.0
