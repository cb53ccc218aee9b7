# SPDX-License-Identifier: Apache-2.0
"""Arms that are moved from the page: the hand comes where it is dragged, whichever arm it is."""

import numpy as np
import pytest

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.moved_arm import LWR, ArmFinder, describe_arm
from intent_recognition.dashboard.robot_view import chain_of, chain_to, joint_values, load_urdf
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics.links import tip_pose
from intent_recognition.kinematics.lwr import JOINT_NAMES
from sim_bridge.arm import NAMES, find_robot

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
        shown = tip_pose(chain_of(chain), joint_values(chain, arm.joint_names, q[None])[0])
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
