# SPDX-License-Identifier: Apache-2.0
"""The arm's URDF as robot_state_publisher and RViz (urdfdom, KDL) want it."""

from collections import Counter
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from intent_recognition.kinematics.forward import forward_kinematics
from intent_recognition.kinematics.lwr import JOINT_NAMES
from sim_bridge.arm.urdf import HAND_LINK, lwr_urdf
from sim_bridge.scenarios.toolbox.scene import HOME

GEOMETRY = {"box", "cylinder", "sphere", "mesh"}
JOINTS = {"revolute", "continuous", "prismatic", "fixed", "floating", "planar"}


@pytest.fixture(scope="module")
def robot():
    return ET.fromstring(lwr_urdf(world=True))


def numbers(text):
    return np.array([float(word) for word in text.split()])


def transform(element):
    """The frame of an `origin`: roll about x, then pitch about y, then yaw about z, fixed axes."""
    frame = np.eye(4)
    frame[:3, 3] = numbers(element.get("xyz", "0 0 0"))
    for axis, angle in enumerate(numbers(element.get("rpy", "0 0 0"))):
        frame[:3, :3] = turn(axis, angle) @ frame[:3, :3]
    return frame


def turn(axis, angle):
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    rotation = np.eye(3)
    rotation[[i, i, j, j], [i, j, i, j]] = (
        np.cos(angle),
        -np.sin(angle),
        np.sin(angle),
        np.cos(angle),
    )
    return rotation


def test_names_are_unique_and_joints_name_links(robot):
    for kind in ("link", "joint"):
        counts = Counter(element.get("name") for element in robot.findall(kind))
        assert max(counts.values()) == 1
    links = {link.get("name") for link in robot.findall("link")}
    for joint in robot.findall("joint"):
        assert joint.get("type") in JOINTS
        assert {joint.find("parent").get("link"), joint.find("child").get("link")} <= links


def test_it_is_a_tree_from_world_whose_root_has_no_inertia(robot):
    children = Counter(joint.find("child").get("link") for joint in robot.findall("joint"))
    links = {link.get("name") for link in robot.findall("link")}
    assert max(children.values()) == 1
    assert links - set(children) == {"world"}
    (root,) = [link for link in robot.findall("link") if link.get("name") == "world"]
    assert len(root) == 0


def test_moving_joints_have_limits_and_unit_axes(robot):
    moving = [joint for joint in robot.findall("joint") if joint.get("type") == "revolute"]
    assert [joint.get("name") for joint in moving] == list(JOINT_NAMES)
    for joint in moving:
        limit = {key: float(value) for key, value in joint.find("limit").attrib.items()}
        assert limit["lower"] < limit["upper"]
        assert limit["velocity"] > 0.0
        assert limit["effort"] > 0.0
        assert np.linalg.norm(numbers(joint.find("axis").get("xyz"))) == pytest.approx(1.0)


def test_shapes_are_of_known_kinds_and_a_material_has_one_colour(robot):
    colours = {}
    for shape in (*robot.iter("visual"), *robot.iter("collision")):
        (geometry,) = shape.find("geometry")
        assert geometry.tag in GEOMETRY
    for material in robot.iter("material"):
        colour = material.find("color").get("rgba")
        assert colours.setdefault(material.get("name"), colour) == colour
    assert colours


def test_world_is_the_frame_of_the_kinematics(robot):
    joints = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    angles = dict(zip(JOINT_NAMES, HOME, strict=True))
    frame, link = np.eye(4), HAND_LINK
    while link in joints:
        joint = joints[link]
        step = transform(joint.find("origin"))
        step[:3, :3] = step[:3, :3] @ turn(2, angles.get(joint.get("name"), 0.0))
        frame, link = step @ frame, joint.find("parent").get("link")
    np.testing.assert_allclose(frame, forward_kinematics(HOME), atol=1e-9)


def test_the_physics_gets_the_same_arm_without_the_world():
    plain, rooted = (ET.fromstring(lwr_urdf(world=world)) for world in (False, True))
    extra = {"world", "lwr_base_joint"}
    assert [ET.tostring(e) for e in plain if e.tag in ("link", "joint")] == [
        ET.tostring(e) for e in rooted if e.get("name") not in extra
    ]
