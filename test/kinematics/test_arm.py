# SPDX-License-Identifier: Apache-2.0
"""Any arm from its URDF: against products of exponentials, differences and closed forms."""

import sys
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from kinematics.robots import lwr_urdf
from kinematics.test_forward import twist
from kinematics.test_inverse import BRANCHES
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from intent_recognition.errors import (
    ArgumentError,
    KinematicsError,
    MissingPackageError,
    ShapeError,
)
from intent_recognition.kinematics import (
    JOINT_NAMES,
    LWR_LIMITS,
    Arm,
    forward_kinematics,
    jacobian,
    solve,
)
from intent_recognition.kinematics.limits import PRISMATIC_SCALE_M, within_position_limits

DATA = Path(pybullet_data.getDataPath())
ROBOTS = {
    "lwr": lwr_urdf(),
    "panda": DATA / "franka_panda/panda.urdf",
    "iiwa": DATA / "kuka_iiwa/model.urdf",
    "xarm": DATA / "xarm/xarm6_robot.urdf",
}
"""Name to a URDF's path or text."""
LIMIT = '<limit lower="-2" upper="1" velocity="2" effort="9"/>'
N_POSES = 200


def joint(name, kind, parent, child, extra=LIMIT, axis="0 0 1", xyz="0 0 0.3", rpy="0 0 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{extra}</joint>'
    )


def robot(*joints, links="abcdef"):
    return (
        "<robot name='r'>" + "".join(f"<link name='{link}'/>" for link in links) + "".join(joints)
    ) + "</robot>"


TURN = joint("turn", "continuous", "a", "b", '<limit velocity="3" effort="5"/>')
LIFT = joint("lift", "prismatic", "b", "c", axis="1 0 0", rpy="0.3 0 0", xyz="0 0.1 0.2")
TOOL = joint("tool", "fixed", "c", "d", "", xyz="0 0 0.1", rpy="0 1.2 0")
BEND = joint("bend", "revolute", "d", "e", axis="0 1 0", xyz="0.4 0 0")
COPY = joint(
    "copy", "revolute", "e", "f", LIMIT + '<mimic joint="bend" multiplier="-2" offset="0.5"/>'
)
XACRO = '<x:include xmlns:x="http://www.ros.org/wiki/xacro" filename="arm.xacro"/>'
MIXED = robot(TURN, LIFT, TOOL, BEND, COPY)


@cache
def arm_of(name: str) -> Arm:
    return Arm.from_urdf(ROBOTS[name])


def homogeneous(xyz, rpy):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    pose[:3, 3] = xyz
    return pose


def test_every_kind_of_joint_is_a_product_of_exponentials():
    arm = Arm.from_urdf(MIXED)
    assert arm.joint_names == ("turn", "lift", "bend")
    assert arm.limits.tolerance_scale.tolist() == [1.0, PRISMATIC_SCALE_M, 1.0]
    assert (arm.base, arm.tip) == ("a", "f")
    again = LIMIT + '<mimic joint="copy" multiplier="0.5" offset="0.1"/>'
    again = joint("again", "revolute", "f", "g", again)
    of_a_copy = Arm.from_urdf(robot(TURN, LIFT, TOOL, BEND, COPY, again, links="abcdefg"))
    assert of_a_copy.joint_names == arm.joint_names
    for turn, lift, bend in np.random.default_rng(0).uniform(-1, 0.5, (5, 3)):
        expected = (
            homogeneous((0, 0, 0.3), (0, 0, 0))
            @ expm(twist((0, 0, turn), (0, 0, 0)))
            @ homogeneous((0, 0.1, 0.2), (0.3, 0, 0))
            @ expm(twist((0, 0, 0), (lift, 0, 0)))
            @ homogeneous((0, 0, 0.1), (0, 1.2, 0))
            @ homogeneous((0.4, 0, 0), (0, 0, 0))
            @ expm(twist((0, bend, 0), (0, 0, 0)))
            @ homogeneous((0, 0, 0.3), (0, 0, 0))
            @ expm(twist((0, 0, 0.5 - 2.0 * bend), (0, 0, 0)))
        )
        np.testing.assert_allclose(arm.forward_kinematics([turn, lift, bend]), expected, atol=1e-12)
        copied = homogeneous((0, 0, 0.3), (0, 0, 0)) @ expm(twist((0, 0, 0.35 - bend), (0, 0, 0)))
        found = of_a_copy.forward_kinematics([turn, lift, bend])
        np.testing.assert_allclose(found, expected @ copied, atol=1e-12)


@pytest.mark.parametrize("source", [MIXED, ROBOTS["lwr"]], ids=["mixed", "lwr"])
def test_points_and_their_speeds_are_within_what_any_posture_allows(source):
    """Speeds are differences of positions; neither they nor jerks exceed the bounds."""
    arm, rng, h = Arm.from_urdf(source), np.random.default_rng(0), 1e-3
    q = rng.uniform(-0.5, 0.5, (50, arm.n_joints))
    v, a, j = rng.normal(size=(3, *q.shape))
    twice_before, before, after, twice_after = (
        arm.skeleton(q + s * h * v + (s * h) ** 2 * a / 2.0 + (s * h) ** 3 * j / 6.0)
        for s in (-2, -1, 1, 2)
    )
    now = arm.skeleton(q)
    np.testing.assert_allclose(now[:, -1], arm.forward_kinematics(q)[:, :3, 3], atol=1e-12)
    speed = np.linalg.norm(after - before, axis=2).max(axis=1) / (2.0 * h)
    np.testing.assert_allclose(arm.moving_skeleton(q, v)[1].max(axis=1), speed, rtol=1e-4)
    third = twice_after - 2.0 * after + 2.0 * before - twice_before
    bent = np.linalg.norm(third, axis=2).max(axis=1) / (2.0 * h**3)
    most_speed, most_jerk = arm.most_motion(v, a, j)
    assert np.all(speed <= most_speed * (1 + 1e-6)) and np.all(bent <= most_jerk)
    one = np.eye(arm.n_joints)[:1]  # the base's joint alone, evenly: a circle of its lever at most
    levers, circle = arm.most_motion(one, 0.0 * one, 0.0 * one)
    np.testing.assert_allclose(circle, levers)


def test_base_and_tip_by_name_and_limits_of_what_copies():
    part = Arm.from_urdf(MIXED, base="c", tip="e")
    assert part.joint_names == ("bend",)
    q = np.array([0.4, 0.1, -0.6])
    base = Arm.from_urdf(MIXED, tip="c").forward_kinematics(q[:2])
    tip = Arm.from_urdf(MIXED, tip="e").forward_kinematics(q)
    np.testing.assert_allclose(
        part.forward_kinematics(q[2:]), np.linalg.inv(base) @ tip, atol=1e-12
    )
    limits = Arm.from_urdf(MIXED, acceleration_rad_s2=7.0).limits
    np.testing.assert_allclose(limits.lower, [-1e6, -2.0, -0.25])  # -2 <= 0.5 - 2 bend <= 1
    np.testing.assert_allclose(limits.upper, [1e6, 1.0, 1.0])
    np.testing.assert_allclose(limits.velocity, [3.0, 2.0, 1.0])  # 2 bend as fast as 2 rad/s
    np.testing.assert_allclose(limits.torque, [5.0, 9.0, 9.0])
    np.testing.assert_allclose(limits.acceleration, 7.0)


@pytest.mark.parametrize("name", ["mixed", *ROBOTS])
def test_the_jacobian_is_that_of_differences(name):
    arm = Arm.from_urdf(MIXED, base="b") if name == "mixed" else arm_of(name)
    rng = np.random.default_rng(2)
    q = arm.rest + 0.1 * rng.normal(size=arm.n_joints)
    J = arm.jacobian(q)
    for k, step in enumerate(1e-6 * np.eye(arm.n_joints)):
        after, before = arm.forward_kinematics(q + step), arm.forward_kinematics(q - step)
        np.testing.assert_allclose((after - before)[:3, 3] / 2e-6, J[:3, k], atol=1e-8)
        turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec()
        np.testing.assert_allclose(turn / 2e-6, J[3:, k], atol=1e-8)


def test_the_lwr_is_its_denavit_hartenberg_chain():
    arm = arm_of("lwr")
    assert arm.joint_names == JOINT_NAMES
    np.testing.assert_array_equal(arm.limits.upper, LWR_LIMITS.upper)
    q = np.random.default_rng(3).uniform(-2.0, 2.0, (20, 7))
    np.testing.assert_allclose(arm.forward_kinematics(q), forward_kinematics(q), atol=1e-12)
    np.testing.assert_allclose(arm.jacobian(q[0]), jacobian(q[0]), atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("free", [False, True], ids=["poses", "positions"])
def test_random_reachable_poses_are_reached_within_limits(name, free):
    arm = arm_of(name)
    rng = np.random.default_rng(4)
    poses = arm.forward_kinematics(
        rng.uniform(arm.limits.lower, arm.limits.upper, (N_POSES, arm.n_joints))
    )
    targets = poses[:, :3, 3] if free else poses
    found = np.array([arm.nearest(target).q for target in targets])
    assert np.all(within_position_limits(found, arm.limits, 0.0))
    there = arm.forward_kinematics(found)
    wrong = np.linalg.norm((there - poses)[:, :3, 3], axis=1)
    if not free:
        wrong += np.linalg.norm((there - poses)[:, :3, :3], axis=(1, 2))
    assert np.mean(wrong < 1e-6) >= 0.995


def test_redundancy_comes_to_rest_where_the_closed_form_is_nearest():
    """The self-motion ends within 0.1 rad of the nearest of all swivels of all branches."""
    arm = arm_of("lwr")
    rng = np.random.default_rng(5)
    for _ in range(10):
        q = rng.uniform(0.2, 0.7, 7) * LWR_LIMITS.upper * [1, -1, 1, 1, 1, -1, 1]
        pose = forward_kinematics(q)
        rest = q + 0.3 * rng.normal(size=7)
        swivels = np.linspace(-np.pi, np.pi, 721)
        every = np.concatenate([solve(pose, swivels, branch) for branch in BRANCHES])
        every = every[within_position_limits(every, LWR_LIMITS)]
        nearest = np.linalg.norm(every - rest, axis=1).min()
        found = arm.inverse_kinematics(pose, seed=q, rest=np.clip(rest, *LIMITS))
        assert np.linalg.norm(found - rest) < nearest + 0.1


LIMITS = LWR_LIMITS.lower, LWR_LIMITS.upper


@pytest.mark.parametrize("name", ROBOTS)
def test_a_path_is_followed_from_another_branch_where_that_of_the_seed_ends(name):
    """Paths of which a solution is known; the branch nearest to `rest` leads through some only."""
    arm = arm_of(name)
    rng = np.random.default_rng(3)
    lower, upper = np.maximum(arm.limits.lower, -3), np.minimum(arm.limits.upper, 3)
    for _ in range(6):
        start, aim = lower + (upper - lower) * rng.uniform(0.1, 0.9, (2, arm.n_joints))
        poses = arm.forward_kinematics(np.linspace(start, 0.5 * (start + aim), 25))
        path = arm.follow(poses)
        assert path.reached.all() and path.largest_jump_rad < 0.5
        assert np.all(within_position_limits(path.positions, arm.limits, 0.0))
        np.testing.assert_allclose(arm.forward_kinematics(path.positions), poses, atol=1e-6)


def test_what_is_out_of_reach_is_named_with_the_distance():
    """A line away from the shoulder, of which the stretched arm's length is known."""
    arm = arm_of("lwr")
    positions = np.array([0.0, 0.0, 0.3105]) + np.linspace(0.7, 1.0, 31)[:, None] * [1.0, 0, 0]
    path = arm.follow(positions)
    reach = 0.4 + 0.39 + 0.078
    expected = np.maximum(np.linspace(0.7, 1.0, 31) - reach, 0.0)
    np.testing.assert_allclose(path.distance_m, expected, atol=1e-4)
    np.testing.assert_array_equal(path.reached, expected == 0.0)
    with pytest.raises(KinematicsError, match=r"0\.1320 m"):
        arm.inverse_kinematics(positions[-1])


def test_what_no_posture_reaches_is_looked_for_once(monkeypatch):
    """A path that leaves the workspace takes little more work than one that does not."""
    arm, n = arm_of("panda"), Counter()
    arm.nearest(np.array([3.0, 0.0, 0.0]))  # makes the table of starts
    chain = arm._search._chain
    for length_m in (0.1, 0.8):

        def counted(q, length_m=length_m):
            n[length_m] += 1
            return chain(q)

        monkeypatch.setattr(arm._search, "_chain", counted)
        poses = np.tile(arm.forward_kinematics(arm.rest), (25, 1, 1))
        poses[:, 0, 3] += np.linspace(0.0, length_m, 25)
        assert arm.follow(poses).reached[-1] == (length_m < 0.5)
    assert n[0.8] < 4 * n[0.1]


def test_a_continuous_joint_turns_on():
    """Two turns about the vertical, which no limited joint could follow."""
    arm = Arm.from_urdf(
        robot(TURN, joint("out", "fixed", "b", "c", "", xyz="0.5 0 0"), links="abc")
    )
    angles = np.linspace(0.0, 4.0 * np.pi, 200)
    positions = np.stack([0.5 * np.cos(angles), 0.5 * np.sin(angles), np.full(200, 0.3)], axis=1)
    path = arm.follow(positions)
    assert path.reached.all()
    # The glide toward rest is no self-motion of this arm.
    np.testing.assert_allclose(path.positions[:, 0], angles, atol=1e-6)


STUCK = '<limit lower="0" upper="0" velocity="1" effort="9"/>'
LIGHT = '<inertial><mass value="-1"/></inertial>'


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        ("/no/such.urdf", {}, "robot: .*no/such.urdf.* Give the path"),
        (__file__, {}, "robot: .*test_arm.py: another kind of file"),
        ("<robot", {}, "robot: expected a URDF.*xacro"),
        ("<sdf><link/></sdf>", {}, "got <sdf>"),
        (robot(XACRO, links="a"), {}, "a xacro file that is not expanded. Name it FILE.xacro"),
        (MIXED, {"tip": "hand"}, "tip: expected a link of a, b, c, d, e, f, got hand"),
        (MIXED, {"base": "f", "tip": "b"}, "tip: expected a link below f"),
        (MIXED, {"tip": "a"}, "tip: expected a link beyond a moving joint"),
        (robot(joint("j", "revolute", "a", "b", ""), links="ab"), {}, "j: expected a finite lower"),
        (
            robot(joint("j", "revolute", "a", "b", LIMIT.replace('"9"', '"x"')), links="ab"),
            {},
            "j: expected a finite effort, got x",
        ),
        (robot(joint("j", "floating", "a", "b"), links="ab"), {}, "j: expected revolute"),
        (robot(joint("j", "prismatic", "a", "b", STUCK), links="ab"), {}, "j: .* one, 0, got 0"),
        (robot(TURN, links="abc"), {}, "base: expected one root link"),
        (robot(TURN, links="ab").replace("'b'/>", f"'b'>{LIGHT}</link>", 1), {}, "b: .*below 0"),
        (
            robot(joint("j", "revolute", "a", "b", LIMIT + '<mimic joint="k"/>'), links="ab"),
            {},
            "mimic: expected a joint of the URDF, got k",
        ),
        (MIXED, {"rest": [0, 0]}, "rest: expected .*turn, lift, bend"),
        (MIXED, {"rest": [0, 0, 2.0]}, "rest: expected bend in"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(source, options, message):
    with pytest.raises((ArgumentError, KinematicsError), match=message) as caught:
        Arm.from_urdf(source, **options)
    assert "\n" not in str(caught.value)


def test_wrong_targets_and_a_missing_package_are_named(monkeypatch):
    arm = arm_of("xarm")
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    for target in (np.eye(3), np.full(3, np.nan), mirrored):
        with pytest.raises(ShapeError):
            arm.inverse_kinematics(target)
    with pytest.raises(ShapeError, match=r"seed.*joint1"):
        arm.inverse_kinematics(np.zeros(3), seed=np.zeros(5))
    with pytest.raises(ShapeError, match="targets"):
        arm.follow(np.zeros((0, 3)))
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(MissingPackageError, match=r"pip install pin, or \.\[arms\]"):
        Arm.from_urdf(MIXED)
