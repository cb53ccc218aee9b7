# SPDX-License-Identifier: Apache-2.0
"""A predicted hand path as joints: on the path, within the limits, refused where out of reach."""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics.limits import within_position_limits
from intent_recognition.motion.hand_path import N_POSES, is_hand, joints_along
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
    np.testing.assert_allclose(made.hand(made.home), HOME_HAND_M, atol=1e-6)
    path = smooth_path()
    times_s, joints = joints_along(made._arm, TIMES_S, path, made.home)
    assert len(times_s) == N_POSES
    assert (times_s[0], times_s[-1]) == (0.0, 3.0)
    assert np.all(within_position_limits(joints, made.robot.limits))
    np.testing.assert_allclose(joints[0], made.home, atol=0.1)
    # Between the poses that were solved, the spline through the joints is on the path too.
    hand = made.hand(CubicSpline(times_s, joints)(TIMES_S))
    np.testing.assert_allclose(hand, path, atol=5e-4)


def test_fingers_come_last_in_the_measured_joints():
    made = toolbox_arm("panda")
    with_fingers = np.concatenate([made.home, [0.04, 0.04]])
    np.testing.assert_array_equal(made.hand(with_fingers), made.hand(made.home))


def test_what_is_out_of_reach_is_refused_with_where_and_when():
    """The line leaves the LWR's reach of 0.868 m about its shoulder 2/3 of the way."""
    made = toolbox_arm("lwr")
    way = np.linspace(0.0, 1.0, 50)[:, None]
    path = np.array([0.668, 0.0, 0.3105]) + way * [0.3, 0.0, 0.0]
    with pytest.raises(TrajectoryError, match=r"0\.100 m too far at \[0\.968.*2\.\d\d to 3\.00 s"):
        joints_along(made._arm, TIMES_S, path, made.home)


def test_a_hair_out_of_reach_is_executed():
    made = toolbox_arm("lwr")
    way = np.linspace(0.0, 1.0, 50)[:, None]
    path = np.array([0.5, 0.0, 0.3105]) + way * [0.37, 0.0, 0.0]
    _, joints = joints_along(made._arm, TIMES_S, path, made.home)
    assert np.linalg.norm(made.hand(joints[-1]) - path[-1]) < 0.005


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([f"hand/pose.pose.position.{axis}" for axis in "xyz"], True),
        ([f"hand/pose.pose.position.{axis}" for axis in "xzy"], False),
        (["a", "b", "c"], False),
        ([f"hand/pose.pose.position.{axis}" for axis in "xyzx"], False),
    ],
)
def test_a_hand_is_known_by_its_names(names, expected):
    assert is_hand(names) is expected
