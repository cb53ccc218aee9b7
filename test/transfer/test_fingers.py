# SPDX-License-Identifier: Apache-2.0
"""Fingers that hold by force."""

import pytest
from kinematics.trees import TREES, urdf

from intent_recognition.errors import ArgumentError
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import NAMES, SimulatedArm, find_robot
from sim_bridge.handover import Fingers, finger_joints, with_fingers
from sim_bridge.physics import pybullet

HALF_M, FRICTION = 0.02, 0.6


@pytest.mark.parametrize("name", NAMES)
def test_every_arm_has_two_that_open_and_close(name):
    robot = with_fingers(find_robot(name))
    assert with_fingers(robot) is robot
    with SimulatedArm(robot=robot) as arm:
        fingers = Fingers(arm)
        opened = fingers.half_opening_m()
        fingers.press(10.0)
        arm.step(800)
        assert fingers.half_opening_m() < 0.002 < 0.035 < opened
        for _ in range(80):
            fingers.press(0.0)
            arm.step(10)
        assert fingers.half_opening_m() == pytest.approx(opened, abs=0.003)


@pytest.mark.parametrize("tree", ["fetch", "fetch_without_lift", "ur_robotiq"])
def test_an_arm_of_a_file_keeps_its_two_fingers_or_is_given_two(tree, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf(TREES[tree].branches))
    robot = with_fingers(find_robot(str(path)))
    assert with_fingers(robot) is robot and len(finger_joints(robot)) == 2
    with SimulatedArm(robot=robot) as arm:
        fingers = Fingers(arm)
        fingers.press(10.0)
        before_m = fingers.half_opening_m()
        arm.step(100)
        assert fingers.half_opening_m() < before_m


@pytest.mark.parametrize("name", ["lwr", "panda"])
@pytest.mark.parametrize(("share", "holds"), [(1.4, True), (0.6, False)])
def test_friction_holds_what_the_force_is_enough_for(name, share, holds):
    """Coulomb: two pads hold 2 mu N; the hand's fingers close across gravity."""
    mass_kg = 0.4
    robot = with_fingers(find_robot(name))
    with SimulatedArm(robot=robot) as arm:
        fingers, client = Fingers(arm), arm.client
        client.setPhysicsEngineParameter(numSolverIterations=100)
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[HALF_M] * 3)
        pose = arm.hand_pose()
        body = client.createMultiBody(
            mass_kg, shape, -1, pose.position.tolist(), pose.orientation.tolist()
        )
        client.changeDynamics(body, -1, lateralFriction=FRICTION)
        hang = client.createConstraint(
            body, -1, -1, -1, pybullet.JOINT_FIXED, [0] * 3, [0] * 3,
            pose.position.tolist(), [0, 0, 0, 1], pose.orientation.tolist(),
        )  # fmt: skip
        fingers.press(share * mass_kg * GRAVITY_M_S2 / (2.0 * FRICTION))
        arm.set_payload(mass_kg)
        arm.step(700)
        assert fingers.touching(body) == 2
        client.removeConstraint(hang)
        arm.step(400)
        assert (fingers.touching(body) == 2) is holds


def test_an_arm_without_fingers_is_told():
    with SimulatedArm() as arm, pytest.raises(ArgumentError, match="with_fingers"):
        Fingers(arm)
