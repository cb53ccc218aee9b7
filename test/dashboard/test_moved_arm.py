# SPDX-License-Identifier: Apache-2.0
"""Arms and the figure are drawn, and moved, by independent kinematics."""

import io

import numpy as np
import pytest
import yourdfpy
from scipy.spatial.transform import Rotation

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.figure import (
    HIP,
    MOST_LEAN_RAD,
    SHOULDER,
    SHOULDER_HALF_WIDTH,
    Stance,
    bend,
    bone_axes,
    lean_toward,
    reach,
)
from intent_recognition.dashboard.moved_arm import LWR, ArmFinder, describe_arm
from intent_recognition.dashboard.robot_view import chain_of, chain_to, joint_values, load_urdf
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import JOINT_NAMES, joint_poses, tip_poses
from sim_bridge.arm import NAMES, describe_robot, find_robot

GOALS_M = np.array([0.6, 0.2, 0.42]) + 0.05 * np.random.default_rng(2).normal(size=(5, 3))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_hand_comes_where_it_is_dragged_and_is_drawn_there(name):
    robot = find_robot(name)
    arm = LWR if name == "lwr" else describe_arm(robot.description, robot.tip)
    urdf = load_urdf(robot.description)
    chain = chain_to(urdf, robot.tip)
    assert arm.joint_names == robot.joint_names
    q = np.array(robot.ready)
    for goal in GOALS_M:
        q = arm.posture_at(goal, q)
        np.testing.assert_allclose(arm.hand(q), goal, atol=1e-6)
        shown = tip_poses(chain_of(chain), joint_values(chain, arm.joint_names, q[None])[0])
        np.testing.assert_allclose(shown[:3, 3], goal, atol=1e-6)
    with pytest.raises(KinematicsError):
        arm.posture_at(np.array([9.0, 0.0, 0.0]), q)


@pytest.mark.slow
def test_every_arm_is_drawn_with_its_meshes():
    for name in NAMES:
        drawn = load_urdf(find_robot(name).description).scene.geometry
        assert sum(len(mesh.faces) for mesh in drawn.values()) > 500


def test_an_arm_is_found_by_its_description_once_its_joints_are_there():
    robot = find_robot("panda")
    finder, state = ArmFinder(robot.tip), CellState(description=robot.description)
    assert finder.find(state) is None
    state.take_joints(robot.joint_names, robot.ready, 0.0)
    found = finder.find(state)
    assert found is not None and found.joint_names == robot.joint_names
    assert finder.find(state) is found
    state.take_joints(JOINT_NAMES, [0.0] * 7, 0.0)
    assert finder.find(state) is LWR


@pytest.mark.parametrize("description", ["", "no xml", '<robot name="r"><link name="a"/></robot>'])
def test_what_is_wrong_with_a_description_is_one_line(description):
    finder = ArmFinder("hand")
    assert finder.find(CellState(description=description)) is None
    assert "\n" not in finder.problem
    assert bool(finder.problem) == bool(description)


FINGERS = """<robot name="fingers">
  <link name="base"/><link name="rail"/><link name="left"/><link name="tip"/><link name="right"/>
  <joint name="along" type="prismatic"><parent link="base"/><child link="rail"/>
    <origin xyz="0.1 0 0.2" rpy="0 0.3 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="open" type="revolute"><parent link="rail"/><child link="left"/>
    <origin xyz="0 0 0.1" rpy="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="left"/><child link="tip"/>
    <origin xyz="0 0.2 0"/><axis xyz="1 0 0"/><mimic joint="open" multiplier="-0.5" offset="0.1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="held" type="fixed"><parent link="rail"/><child link="right"/></joint>
</robot>"""


@pytest.mark.parametrize("description", [describe_robot(), FINGERS], ids=["lwr", "fingers"])
def test_each_joint_is_where_yourdfpy_has_it(description):
    urdf = yourdfpy.URDF.load(io.StringIO(description), load_meshes=False)
    names, joints = urdf.actuated_joint_names, tuple(urdf.joint_map.values())
    q = np.random.default_rng(4).uniform(-0.8, 0.8, size=len(names))
    poses = joint_poses(chain_of(joints), joint_values(joints, names, q[None])[0])
    urdf.update_cfg(q)
    for joint, pose in zip(joints, poses, strict=True):
        np.testing.assert_allclose(pose, urdf.get_transform(joint.child, joint.parent), atol=1e-9)


def test_what_has_a_colour_is_not_taken_for_metal():
    """That would be black without the light of an environment; the colour stays."""
    description = describe_robot()
    before = yourdfpy.URDF.load(io.StringIO(description)).scene.geometry
    for name, shape in load_urdf(description).scene.geometry.items():
        material = shape.visual.material
        assert material.metallicFactor == 0.0
        np.testing.assert_array_equal(material.main_color, before[name].visual.main_color)


STANCES = [
    Stance(np.array([1.4, 0.1, -0.85]), np.pi, left=False),
    Stance(np.array([0.2, -0.5, 0.0]), 0.4, 1.6, left=True),
]


stances = pytest.mark.parametrize("stance", STANCES, ids=["right", "left"])


def hip_of(stance):
    """Where the middle of the hips is unless the figure is moved."""
    return stance.ground_m + [0.0, 0.0, HIP * stance.height_m]


def wrists(stance, count=300, spread_m=0.8):
    """Points all around the shoulder, near and far beyond the arm's reach."""
    middle = stance.ground_m + [0.0, 0.0, 0.7 * stance.height_m]
    return middle + spread_m * np.random.default_rng(5).normal(size=(count, 3))


@stances
def test_the_wrist_is_reached_and_bones_keep_their_lengths(stance):
    upper, fore = stance.arm_m
    for wrist in wrists(stance):
        posture = reach(stance, wrist)
        lengths = [np.linalg.norm(posture.elbow - at) for at in (posture.shoulder, wrist)]
        np.testing.assert_allclose(lengths, [upper, fore], atol=1e-12)
        own = posture.upper_body.T @ (posture.shoulder - posture.hip)
        across = stance.side * SHOULDER_HALF_WIDTH * stance.height_m
        np.testing.assert_allclose(
            own, [0.0, across, (SHOULDER - HIP) * stance.height_m], atol=1e-12
        )


@stances
def test_the_posture_changes_no_more_than_the_wrist_does(stance):
    """Along random straight ways a step that is a tenth as long changes a tenth as much."""
    rng = np.random.default_rng(6)
    for wrist in wrists(stance, 40, 0.5):
        step = rng.normal(size=3)
        step *= 1e-5 / np.linalg.norm(step)
        before = np.concatenate([np.ravel(part) for part in reach(stance, wrist)])
        after = np.concatenate([np.ravel(part) for part in reach(stance, wrist + step)])
        assert np.abs(after - before).max() < 1e-3


def test_within_reach_nobody_leans_and_nobody_is_moved():
    stance = STANCES[0]
    posture = reach(stance, np.array([1.1, 0.3, 0.27]))
    np.testing.assert_array_equal(posture.hip, hip_of(stance))
    np.testing.assert_allclose(posture.upper_body, stance.rotation, atol=1e-15)


def test_a_little_out_of_reach_he_leans_as_little_as_is_needed():
    stance = STANCES[0]
    wrist = np.array([0.75, 0.3, 0.3])
    posture = reach(stance, wrist)
    np.testing.assert_allclose(posture.hip, hip_of(stance), atol=1e-12)
    lean = np.arccos((np.trace(posture.upper_body @ stance.rotation.T) - 1.0) / 2.0)
    assert 0.01 < lean < MOST_LEAN_RAD
    reached = np.linalg.norm(wrist - posture.shoulder)
    assert reached == pytest.approx(0.98 * sum(stance.arm_m))


def test_the_smallest_rotation_is_the_one_found_by_search():
    arm, target, wanted = np.array([0.1, 0.2, 0.5]), np.array([0.7, -0.1, 0.4]), 0.45
    lean = lean_toward(arm, target, wanted)
    axis = np.cross(arm, target) / np.linalg.norm(np.cross(arm, target))
    angles = np.linspace(0.0, 1.5, 15_001)
    ends = Rotation.from_rotvec(angles[:, None] * axis).apply(arm)
    first = angles[np.argmax(np.linalg.norm(ends - target, axis=1) <= wanted)]
    assert np.arccos((np.trace(lean) - 1) / 2) == pytest.approx(first, abs=2e-4)


def test_the_elbow_lies_on_the_side_of_its_pole():
    elbow = bend(np.zeros(3), np.array([0.4, 0.0, 0.0]), 0.3, 0.25, np.array([0.5, 0.0, -1.0]))
    assert elbow[1] == 0.0
    assert elbow[2] < 0.0


def test_axes_of_a_bone_are_a_rotation_along_it():
    axes = bone_axes(np.array([0.3, -0.2, 0.1]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(np.cross(axes[:, 2], [0.3, -0.2, 0.1]), 0.0, atol=1e-15)
