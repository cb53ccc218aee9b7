# SPDX-License-Identifier: Apache-2.0
"""A predicted hand path as joints: on the path, within the limits, refused where out of reach."""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics.arm import Arm
from intent_recognition.kinematics.limits import within_position_limits
from intent_recognition.motion.hand_path import N_POSES, hand_targets, is_hand, joints_along
from intent_recognition.signals import POSE_FIELDS
from sim_bridge.arm.robots import NAMES, find_robot
from sim_bridge.scenarios.toolbox.other_arms import ToolboxArm
from sim_bridge.scenarios.toolbox.scene import HOME_HAND_M, SCREW_HANDOVER_M, STANDS_M

TIMES_S = np.linspace(0.0, 3.0, 50)


@cache
def toolbox_arm(name):
    return ToolboxArm(find_robot(name))


def smooth_path():
    """From home over the screw's stand to its handover, (50, 3)."""
    ways = np.array([HOME_HAND_M, STANDS_M["screw_handover"], SCREW_HANDOVER_M])
    return CubicSpline([0.0, 1.2, 3.0], ways, bc_type="clamped")(TIMES_S)


@pytest.mark.parametrize("name", NAMES)
def test_the_hand_of_every_arm_follows_the_path(name):
    made = toolbox_arm(name)
    with_fingers = np.append(made.home, [0.04, 0.04])  # they come last in what is measured
    np.testing.assert_allclose(made.hand(with_fingers), HOME_HAND_M, atol=1e-6)
    path = smooth_path()
    times_s, joints = joints_along(made._arm, TIMES_S, path, made.home)
    assert len(times_s) == N_POSES
    assert (times_s[0], times_s[-1]) == (0.0, 3.0)
    assert np.all(within_position_limits(joints, made.robot.limits))
    np.testing.assert_allclose(joints[0], made.home, atol=0.1)
    # Between the poses that were solved, the spline through the joints is on the path too.
    hand = made.hand(CubicSpline(times_s, joints)(TIMES_S))
    np.testing.assert_allclose(hand, path, atol=5e-4)


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_pose_is_followed_with_its_orientation(name):
    """The hand turns by half a radian about an axis of its own; positions alone would not."""
    made = toolbox_arm(name)
    begin = Rotation.from_matrix(made._arm.forward_kinematics(made.home)[:3, :3])
    share = (TIMES_S / TIMES_S[-1])[:, None]
    turns = begin * Rotation.from_rotvec(share * [0.1, -0.2, 0.45])
    place = HOME_HAND_M + share * [0.03, 0.1, -0.1]
    quaternions = 2.0 * turns.as_quat()  # of any norm
    one = hand_targets(np.append(place[9], quaternions[9]))
    np.testing.assert_allclose(one[:3, :3], turns[9].as_matrix())
    assert np.array_equal(one[:3, 3], place[9]) and np.array_equal(hand_targets(place[9]), place[9])
    times_s, joints = joints_along(made._arm, TIMES_S, np.hstack([place, quaternions]), made.home)
    assert np.all(within_position_limits(joints, made.robot.limits))
    hand = made._arm.forward_kinematics(CubicSpline(times_s, joints)(TIMES_S))
    np.testing.assert_allclose(hand[:, :3, 3], place, atol=5e-4)
    left = Rotation.from_matrix(hand[:, :3, :3]).inv() * turns
    assert left.magnitude().max() < 2e-3
    _, free = joints_along(made._arm, TIMES_S, place, made.home)
    turned = Rotation.from_matrix(made._arm.forward_kinematics(free[-1])[:3, :3])
    assert (turned.inv() * turns[-1]).magnitude() > 0.1


def test_what_is_out_of_reach_also_as_the_hand_is_turned_is_refused_with_where_and_when():
    """The LWR reaches 0.868 m from its shoulder, but with the fingers down only 0.79 m.

    Of the reach 5 mm may be missing. A quaternion of zeros is refused, too.
    """
    made = toolbox_arm("lwr")
    begin = made._arm.forward_kinematics(made.robot.ready)
    share = (TIMES_S / TIMES_S[-1])[:, None]
    line = np.array([0.668, 0.0, 0.3105]) + share * [0.3, 0.0, 0.0]
    with pytest.raises(TrajectoryError, match=r"0\.100 m too far at \[0\.968.*2\.\d\d to 3\.00 s"):
        joints_along(made._arm, TIMES_S, line, made.home)  # it leaves the reach after 2/3
    for x in (0.8731, 0.8729, 0.81):
        goal = np.array([x, 0.0, 0.3105])
        place = begin[:3, 3] + share * (goal - begin[:3, 3])
        if x > 0.873:
            with pytest.raises(TrajectoryError, match="m too far"):
                joints_along(made._arm, TIMES_S, place, made.robot.ready)
            continue
        _, free = joints_along(made._arm, TIMES_S, place, made.robot.ready)
        missing_m = np.linalg.norm(made.hand(free[-1]) - goal)
        assert missing_m == pytest.approx(max(x - 0.868, 0.0), abs=1e-6)
    turn = np.tile(Rotation.from_matrix(begin[:3, :3]).as_quat(), (50, 1))
    with pytest.raises(TrajectoryError, match=r"m and \d\.\d\d rad too far at .* to 3\.00 s"):
        joints_along(made._arm, TIMES_S, np.hstack([place, turn]), made.robot.ready)
    with pytest.raises(TrajectoryError, match="unit quaternions"):
        joints_along(made._arm, TIMES_S, np.zeros((50, 7)), made.home)


def test_a_path_that_jumps_is_refused():
    made, ends = toolbox_arm("lwr"), np.array([[0.4, -0.4, 0.5], [0.4, 0.4, 0.5]])
    with pytest.raises(TrajectoryError, match=r"a joint jumps by \d\.\d\d rad"):
        joints_along(made._arm, TIMES_S, np.repeat(ends, 25, axis=0), made.home)


def test_joints_beyond_the_link_stay_and_are_commanded():
    made = toolbox_arm("lwr")
    arm = Arm.from_urdf(made.robot.description, base="world", tip="lwr_a6_link", beyond=True)
    assert arm.joint_names == made.robot.joint_names
    begin = arm.forward_kinematics(made.home)
    place = begin[:3, 3] + (TIMES_S / TIMES_S[-1])[:, None] * [0.05, 0.1, -0.1]
    turn = np.tile(Rotation.from_matrix(begin[:3, :3]).as_quat(), (50, 1))
    _, joints = joints_along(arm, TIMES_S, np.hstack([place, turn]), made.home)
    np.testing.assert_allclose(joints[:, 6], made.home[6], atol=1e-9)
    end = begin.copy()
    end[:3, 3] = place[-1]
    np.testing.assert_allclose(arm.forward_kinematics(joints[-1]), end, atol=1e-6)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([f"hand/pose.pose.position.{axis}" for axis in "xyz"], True),
        ([f"hand/pose.pose.position.{axis}" for axis in "xzy"], False),
        (["a", "b", "c"], False),
        ([f"hand/pose.pose.position.{axis}" for axis in "xyzx"], False),
        ([f"hand/pose.pose.{field}" for field in POSE_FIELDS], True),
        ([f"hand/pose.pose.{field}" for field in reversed(POSE_FIELDS)], False),
    ],
)
def test_a_hand_is_known_by_its_names(names, expected):
    assert is_hand(names) is expected
