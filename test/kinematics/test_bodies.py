# SPDX-License-Identifier: Apache-2.0
"""Bodies of an arm among boxes: distances against PyBullet's, nothing missed along a motion."""

import tempfile
from pathlib import Path

import numpy as np
import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Bodies, Box, hand_position, parse_boxes
from sim_bridge.arm.robots import NAMES, find_robot

CRATE = Box("crate", (0.45, 0.2, 0.4), (0.2, 0.1, 0.3), (0.0, 0.0, 0.3826834, 0.9238795))
TABLE = Box("table", (0.5, 0.0, -0.06), (1.6, 1.6, 0.1))


def bodies_of(name, *boxes, clearance_m=0.02):
    robot = find_robot(name)
    return robot, Bodies(
        robot.description, robot.joint_names, boxes or (TABLE, CRATE), clearance_m=clearance_m
    )


def motion(robot, n, seed=0):
    """Samples of a smooth motion to a random posture (n, joints) [rad]."""
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.limits.lower, -1.5), np.minimum(robot.limits.upper, 1.5)
    s = np.linspace(0.0, 1.0, n)[:, None]
    return robot.ready + (0.5 - 0.5 * np.cos(np.pi * s)) * (rng.uniform(low, high) - robot.ready)


@pytest.mark.parametrize("name", ["lwr", "panda"])
def test_distances_to_a_box_are_those_of_pybullet(name):
    """PyBullet takes hulls of meshes too; its cylinders and hulls have margins of their own."""
    robot, bodies = bodies_of(name, CRATE)
    client = BulletClient(pybullet.DIRECT)
    arm = load(client, robot)
    shape = client.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[edge / 2.0 for edge in CRATE.size]
    )
    crate = client.createMultiBody(0.0, shape, -1, CRATE.center, CRATE.quaternion)
    joints, links = {}, {}
    for k in range(client.getNumJoints(arm)):
        info = client.getJointInfo(arm, k)
        joints[info[1].decode()], links[info[12].decode()] = k, k
    for seed in range(10):
        q = motion(robot, 2, seed)[-1]
        for joint, value in zip(robot.joint_names, q, strict=True):
            client.resetJointState(arm, joints[joint], value)
        ours: dict[str, float] = {}
        for pair, (link, other) in enumerate(bodies.pairs):
            if other == CRATE.name:
                ours[link] = min(ours.get(link, np.inf), bodies.distance_m(q, pair))
        assert len(ours) > 5
        for link, distance in ours.items():
            found = client.getClosestPoints(arm, crate, 10.0, linkIndexA=links[link])
            theirs = min(point[8] for point in found)
            if min(distance, theirs) > 0.0:
                assert distance == pytest.approx(theirs, abs=2e-3), link
            else:
                assert max(distance, theirs) < 2e-3, link
    client.disconnect()


def load(client, robot):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(robot.urdf)
        return client.loadURDF(str(path), robot.base_position_m, useFixedBase=True)


@pytest.mark.parametrize("name", NAMES)
def test_no_contact_at_a_sample_is_missed(name):
    robot, bodies = bodies_of(name, TABLE, Box("block", (0.35, 0.1, 0.6), (0.3, 0.3, 0.3)))
    n_found = 0
    for seed in range(3):
        q = motion(robot, 60, seed)
        expected = {
            (sample, pair)
            for sample in range(len(q))
            for pair in range(len(bodies.pairs))
            if bodies.distance_m(q[sample], pair) < 0.02
        }
        found = bodies.contacts(q)
        assert {(c.sample, c.pair) for c in found} == expected
        assert [c.sample for c in found] == sorted(c.sample for c in found)
        (first,) = bodies.contacts(q, first_only=True) if found else [None]
        assert not found or first[:2] == found[0][:2]
        n_found += len(found)
    assert n_found


def test_nothing_touches_between_samples_that_are_as_dense_as_asked_for():
    """A thin plate that a coarse motion steps over is seen at the steps that `steps` asks for."""
    robot = find_robot("lwr")
    q = motion(robot, 4, 3)
    middle = 0.5 * (q[1] + q[2])
    thin = Box("plate", tuple(hand_position(middle)), (0.004, 0.004, 0.004))
    _, bodies = bodies_of("lwr", thin, clearance_m=0.005)
    assert bodies.contacts(q) == []
    n = bodies.steps(np.abs(np.diff(q, axis=0)))
    s = np.linspace(0.0, 3.0, 3 * n + 1)
    dense = np.column_stack([np.interp(s, range(4), column) for column in q.T])
    assert any(c.distance_m < 0.0 for c in bodies.contacts(dense))


@pytest.mark.parametrize("name", NAMES)
def test_a_distance_changes_no_faster_than_the_joints_can_move_it(name):
    robot, bodies = bodies_of(name)
    rng = np.random.default_rng(1)
    for seed in range(5):
        q = motion(robot, 2, seed)[-1]
        step = rng.normal(0.0, 0.05, q.size)
        for pair in range(len(bodies.pairs)):
            change = abs(bodies.distance_m(q + step, pair) - bodies.distance_m(q, pair))
            assert change <= np.abs(step) @ bodies._reach[:, pair] + 1e-4


@pytest.mark.parametrize("name", ["lwr", "xarm"])
def test_gradients_are_those_of_finite_differences(name):
    robot, bodies = bodies_of(name)
    q, eye = motion(robot, 2, 5)[-1], np.eye(robot.n_joints)
    for pair in range(0, len(bodies.pairs), 5):
        _, gradient = bodies.gap(q, pair)
        ends = [[bodies.gap(q + s * e, pair)[0] for e in eye] for s in (1e-5, -1e-5)]
        numeric = np.subtract(*ends) / 2e-5
        np.testing.assert_allclose(gradient, numeric, atol=1e-3)


def test_joints_are_taken_in_the_order_given_and_what_cannot_part_is_left_out():
    """Neighbours, and the first link over the table it stands on; not the hand."""
    robot = find_robot("lwr")
    near = Box("table", (0.5, 0.0, 0.05), (1.6, 1.6, 0.1))
    bodies = Bodies(robot.description, robot.joint_names, [near], clearance_m=0.1)
    assert ("lwr_a1_link", "table") not in bodies.pairs
    assert ("lwr_a7_link", "table") in bodies.pairs
    assert not {("lwr_a1_link", "lwr_a2_link"), ("lwr_a5_link", "lwr_a6_link")} & {*bodies.pairs}
    assert ("lwr_a2_link", "lwr_a7_link") in bodies.pairs
    robot, bodies = bodies_of("lwr")
    other = Bodies(robot.description, robot.joint_names[::-1], (TABLE, CRATE), clearance_m=0.02)
    q = motion(robot, 2, 5)[-1]
    for pair in range(len(bodies.pairs)):
        assert other.distance_m(q[::-1], pair) == bodies.distance_m(q, pair)


def test_boxes_of_strings():
    assert parse_boxes(["a 1 2 3 0.1 0.2 0.3", "b 0 0 0 1 1 1 0 0 1 0", ""]) == (
        Box("a", (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)),
        Box("b", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.0, 0.0, 1.0, 0.0)),
    )


@pytest.mark.parametrize(
    "text", ["a", "a 1 2 3 0.1 0.2", "a 1 2 3 1 1 0", "a 1 2 3 1 1 x", "a 0 0 0 1 1 1 0 0 0 0.5"]
)
def test_what_is_no_box_is_named(text):
    with pytest.raises(ArgumentError, match="boxes: expected 'name x y z"):
        parse_boxes([text])
    with pytest.raises(ArgumentError, match="different names"):
        parse_boxes(["a 0 0 0 1 1 1", "a 0 0 1 1 1 1"])


def test_descriptions_that_cannot_be_used_are_named():
    robot = find_robot("panda")
    missing = robot.description.replace("link3.obj", "link33.obj").replace("link3.stl", "no.stl")
    assert missing != robot.description
    with pytest.raises(ArgumentError, match="robot: expected a URDF with shapes"):
        Bodies(missing, robot.joint_names, clearance_m=0.02)
    with pytest.raises(ArgumentError, match="robot: expected the joints"):
        Bodies(robot.description, ["elbow"], clearance_m=0.02)
    with pytest.raises(ArgumentError, match="clearance"):
        Bodies(robot.description, robot.joint_names, clearance_m=0.0)
