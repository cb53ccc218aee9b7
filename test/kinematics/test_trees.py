# SPDX-License-Identifier: Apache-2.0
"""The arm in the trees of robots that people have: its hand, its joints, what is held."""

import numpy as np
import pytest
from kinematics.trees import LIMITS, TREES, row, urdf

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import DEFAULT_EFFORT, DEFAULT_SPEED, Arm, Bodies
from sim_bridge.arm import SimulatedArm, find_robot
from sim_bridge.arm.urdf_loading import MOST_LINKS

ONE = [name for name, tree in TREES.items() if tree.joints]
SEVERAL = [name for name in TREES if name not in ONE]


@pytest.mark.parametrize("name", ONE)
def test_the_hand_and_the_joints_of_an_arm_are_found(name):
    tree = TREES[name]
    arm = Arm.from_urdf(urdf(tree.branches), base=tree.base or None, tip=tree.asked or None)
    assert (arm.tip, " ".join(arm.joint_names)) == (tree.tip, tree.joints)
    assert np.isfinite(arm.forward_kinematics(arm.rest)).all()


def test_a_link_is_meant_where_a_joint_has_its_name_and_fingers_are_no_arms():
    arm = Arm.from_urdf(urdf(TREES["five_fingers"].branches), tip="palm", beyond=True)
    assert " ".join(arm.joint_names) == TREES["five_fingers"].joints
    arm = Arm.from_urdf(urdf(TREES["one_name"].branches, length_m=0.2), tip="hand")
    np.testing.assert_allclose(arm.forward_kinematics(np.zeros(6))[2, 3], 6 * 0.2 + 0.02)


@pytest.mark.parametrize("name", SEVERAL)
def test_of_two_arms_the_hands_are_named(name):
    with pytest.raises(ArgumentError, match=f"tip: expected {TREES[name].tip}, as .*--tip"):
        Arm.from_urdf(urdf(TREES[name].branches))


@pytest.mark.parametrize("name", ONE)
def test_only_the_arm_and_its_gripper_move_in_the_simulation(name, tmp_path):
    tree, path = TREES[name], tmp_path / "robot.urdf"
    path.write_text(urdf(tree.branches))
    robot = find_robot(str(path), base=tree.base, tip=tree.asked)
    path.write_text(robot.source)
    again = find_robot(str(path), tip=robot.tip)
    assert again.joint_names == robot.joint_names == tuple(tree.joints.split())
    with SimulatedArm(robot=again) as arm:
        assert not [j for j in arm.others.names if any(w in j for w in ("head", "wheel", "l_j"))]
        arm.step(50)
        expected = Arm.from_urdf(again.description, base="world", tip=again.tip)
        pose = expected.forward_kinematics(arm.state().q)
        np.testing.assert_allclose(arm.hand_pose().position, pose[:3, 3], atol=1e-5)


@pytest.mark.parametrize("count", [MOST_LINKS - 7, MOST_LINKS - 6])
def test_more_links_than_the_simulation_takes_are_refused(count, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf((row("base", "", 6), *(f"base f frame{k}" for k in range(count)))))
    robot = find_robot(str(path))
    if robot.urdf.count("<link ") > MOST_LINKS:
        with pytest.raises(ArgumentError, match="at most 128 links, got 129"):
            SimulatedArm(robot=robot)
    else:
        with SimulatedArm(robot=robot) as arm:
            arm.step(1)


@pytest.mark.parametrize(
    "limits",
    [
        LIMITS | {"r": '<limit lower="-3" upper="3"/>', "c": ""},
        LIMITS | {"r": '<limit lower="-3" upper="3" velocity="0" effort="0"/>'},
    ],
)
def test_missing_limits_of_speed_and_effort_take_the_stated_defaults(limits, tmp_path):
    text = urdf((row("base", "", 5, after=" c:roll hand"),), limits)
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    robot = find_robot(str(path))
    assumed = ("j1", "j2", "j3", "j4", "j5", *(("roll",) if not limits["c"] else ()))
    assert robot.assumed == assumed
    np.testing.assert_array_equal(robot.limits.velocity[:5], DEFAULT_SPEED["revolute"])
    np.testing.assert_array_equal(robot.limits.torque[:5], DEFAULT_EFFORT["revolute"])
    assert Bodies(text, robot.joint_names, clearance_m=0.02).pairs == ()


def test_a_lift_that_delays_the_arm_is_held(tmp_path):
    path, tree = tmp_path / "robot.urdf", TREES["tiago"]
    slow = LIMITS | {"p": LIMITS["p"].replace("0.2", "0.07")}
    for limits, base in ((slow, ""), (slow, "torso"), (slow, "footprint"), (LIMITS, "")):
        path.write_text(urdf(tree.branches, limits))
        robot = find_robot(str(path), base=base)
        is_held = limits is slow and not base
        assert robot.held == ("torso_lift",) * is_held
        assert ("torso_lift: slow, and held at zero" in robot.note) == is_held
        is_whole = limits is LIMITS or base == "footprint"
        assert robot.joint_names == tuple(tree.joints.split())[not is_whole :]
        path.write_text(robot.source)
        assert find_robot(str(path)).joint_names == robot.joint_names
    path.write_text(urdf((row("base p:lift torso", "", 5),), slow))  # an arm that needs its lift
    robot = find_robot(str(path))
    assert "lift is slow and delays the arm: --base" in robot.note and not robot.held


def test_descriptions_with_a_mark_a_namespace_in_degrees_or_none():
    limits = LIMITS | {"r": '<limit lower="-170" upper="170" velocity="2" effort="60"/>'}
    said = r"j1: expected lower in radians, got -170. Likely degrees for radians .*57.3"
    with pytest.raises(ArgumentError, match=said):
        Arm.from_urdf(urdf((row("base", "", 6),), limits))
    (tree, *_) = TREES.values()
    text = urdf(tree.branches)
    kept = {"tip": tree.asked or None, "base": tree.base or None}
    head = "<?xml version='1.0'?>"
    spaced = text.replace("<robot", "<robot xmlns='http://a.b/c' xmlns:xacro='http://d.e/f'", 1)
    for one in (f"\ufeff\n {head}{text}", f"{head}<!DOCTYPE robot SYSTEM 'a.dtd'>\n{text}", spaced):
        assert Arm.from_urdf(one, **kept).joint_names == Arm.from_urdf(text, **kept).joint_names
    with pytest.raises(ArgumentError, match="expected a URDF, got broken XML"):
        Arm.from_urdf("<!DOCTYPE" * 400_000)  # at once: it may come from a topic
    with pytest.raises(ArgumentError, match="robot: expected a path, got one of type NoneType"):
        Arm.from_urdf(None)


@pytest.mark.parametrize("reach_m", [0.3, 0.85, 3.5])
def test_lengths_in_millimetres_are_refused(reach_m):
    text = urdf((row("base", "", 6),), length_m=1000 * reach_m / 5)
    said = f"an arm in metres, got {1000 * reach_m:g} m from joint j1 to .* of 1000"
    with pytest.raises(ArgumentError, match=said):
        Arm.from_urdf(text)


@pytest.mark.parametrize("reach_m", [0.15, 3.5])
def test_small_large_and_far_arms_are_taken(reach_m):
    arm = Arm.from_urdf(urdf((row("base", "", 6),), length_m=reach_m / 5))
    height_m = arm.forward_kinematics(np.zeros(6))[2, 3]
    np.testing.assert_allclose(height_m, 6 * reach_m / 5)
    text = urdf((row("base", "", 6),)).replace('xyz="0 0 0.16"', 'xyz="0 0 90"', 1)
    assert Arm.from_urdf(text).n_joints == 6


def test_a_xacro_file_is_expanded(tmp_path):
    text = urdf((row("base", "", 6),)).replace('velocity="2"', 'velocity="${2 * speed}"')
    head = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    text = text.replace('<robot name="tree">', head + '<xacro:property name="speed" value="0.4"/>')
    path = tmp_path / "robot.urdf.xacro"
    path.write_text(text)
    np.testing.assert_allclose(find_robot(str(path)).limits.velocity, 0.8)
    path.write_text(text.replace("speed}", "pace}"))
    with pytest.raises(ArgumentError, match=r"a xacro file, got .*pace.* xacro FILE"):
        find_robot(str(path))


def test_packages_that_a_description_speaks_of_may_stand_beside_it_as_source(tmp_path):
    arm, parts = tmp_path / "Arms" / "an_arm", tmp_path / "Arms" / "clone_of_parts"
    for folder, name in ((arm, "an_arm"), (parts, "parts")):
        (folder / "urdf").mkdir(parents=True)
        (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    head = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    inside = urdf((row("base", "", 6),)).removeprefix('<robot name="tree">')
    (parts / "urdf" / "chain.xacro").write_text(head + inside)
    path = arm / "urdf" / "arm.urdf.xacro"
    include = '<xacro:include filename="$(find {})/urdf/chain.xacro"/></robot>'
    path.write_text(head + include.format("parts"))
    assert Arm.from_urdf(path).n_joints == 6
    for name in ("", "../../escaped"):  # which are none of a package
        (tmp_path / "Arms" / "odd").mkdir(exist_ok=True)
        odd = f"<package><name>{name}</name></package>"
        (tmp_path / "Arms" / "odd" / "package.xml").write_text(odd)
        assert Arm.from_urdf(path).n_joints == 6
    mesh = '<link name="base"><visual><geometry><mesh filename="file://$(find parts)/a.stl"/>'
    (parts / "a.stl").touch()
    path.write_text(head + inside.replace('<link name="base">', f"{mesh}</geometry></visual>", 1))
    assert str(parts.resolve() / "a.stl") in find_robot(str(path)).urdf
    path.write_text(head + include.format("others"))
    with pytest.raises(ArgumentError, match="finds the package others, which is nowhere"):
        Arm.from_urdf(path)
