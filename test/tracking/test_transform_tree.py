# SPDX-License-Identifier: Apache-2.0
"""The tree of moving frames against matrices and scipy's own interpolation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from intent_recognition.tracking import NoTransformError, RigidTransform, TransformTree

SECOND = 1_000_000_000


def random_pose(rng):
    return RigidTransform(rng.normal(size=3), Rotation.random(random_state=rng).as_quat())


def matrix(pose):
    return np.block([[pose.rotation, pose.translation[:, None]], [np.zeros(3), 1.0]])


def test_a_lookup_is_the_product_along_the_tree(rng):
    """world - base - tool - camera and world - tracker; any two of them, both ways."""
    tree, in_world = TransformTree(), {"world": np.eye(4)}
    for parent, child, fixed in (
        ("world", "base", True),
        ("/base", "tool", False),
        ("tool", "camera", True),
        ("world", "tracker", False),
    ):
        pose = random_pose(rng)
        tree.add(parent, child, SECOND, pose, fixed=fixed)
        in_world[child] = in_world[parent.removeprefix("/")] @ matrix(pose)
    for target in in_world:
        for source in in_world:
            expected = np.linalg.inv(in_world[target]) @ in_world[source]
            found = matrix(tree.lookup(target, source, SECOND))
            np.testing.assert_allclose(found, expected, atol=1e-12)


def test_between_two_times_a_pose_is_interpolated_and_never_beyond_them(rng):
    tree, poses = TransformTree(), [random_pose(rng) for _ in range(3)]
    for stamp, pose in zip((3, 1, 2), (poses[2], poses[0], poses[1]), strict=True):  # out of order
        tree.add("world", "tool", stamp * SECOND, pose)
    times = np.array([1.0, 1.3, 2.0, 2.75, 3.0])
    turns = Slerp([1, 2, 3], Rotation.from_quat([pose.quaternion for pose in poses]))(times)
    for time, turn in zip(times, turns, strict=True):
        found = tree.lookup("world", "tool", round(time * SECOND))
        expected = [np.interp(time, [1, 2, 3], [p.translation[k] for p in poses]) for k in range(3)]
        np.testing.assert_allclose(found.translation, expected, atol=1e-9)
        np.testing.assert_allclose(found.rotation, turn.as_matrix(), atol=1e-9)
    for stamp_ns, reason, may_come in (
        (SECOND - 1, "before_transforms", False),
        (3 * SECOND + 1, "after_transforms", True),
    ):
        with pytest.raises(NoTransformError) as error:
            tree.lookup("world", "tool", stamp_ns)
        assert (error.value.reason, error.value.may_come) == (reason, may_come)


def test_frames_that_are_not_there_and_loops_are_named(rng):
    tree = TransformTree()
    tree.add("a", "b", 0, random_pose(rng), fixed=True)
    tree.add("c", "d", 0, random_pose(rng), fixed=True)
    for target, source, reason in (("a", "x", "unknown_frame"), ("a", "d", "not_connected")):
        with pytest.raises(NoTransformError) as error:
            tree.lookup(target, source, 0)
        assert error.value.reason == reason
    tree.add("b", "a", 0, random_pose(rng), fixed=True)  # a loop
    with pytest.raises(NoTransformError):
        tree.lookup("c", "a", 0)


def test_a_frame_moves_to_another_parent_and_old_times_are_forgotten(rng):
    tree, pose = TransformTree(), random_pose(rng)
    tree.add("a", "tool", SECOND, random_pose(rng))
    tree.add("b", "tool", 2 * SECOND, pose)
    np.testing.assert_array_equal(matrix(tree.lookup("b", "tool", 2 * SECOND)), matrix(pose))
    with pytest.raises(NoTransformError):
        tree.lookup("a", "tool", SECOND)
    tree.add("b", "tool", 60 * SECOND, pose)
    with pytest.raises(NoTransformError, match="first published 58"):
        tree.lookup("b", "tool", 2 * SECOND)
    tree.add("b", "tool", 3 * SECOND, pose)  # the clock went back
    np.testing.assert_array_equal(matrix(tree.lookup("b", "tool", 3 * SECOND)), matrix(pose))
    with pytest.raises(NoTransformError, match="last published"):
        tree.lookup("b", "tool", 4 * SECOND)
