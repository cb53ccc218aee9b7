# SPDX-License-Identifier: Apache-2.0
"""Positions and poses of the hand along the chain, against independent formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from intent_recognition.errors import ShapeError
from intent_recognition.kinematics import forward_kinematics
from intent_recognition.kinematics.links import Chain, tip_poses
from intent_recognition.kinematics.lwr import hand_position, jacobian


def test_a_batch_equals_single_postures_of_seven_joints():
    rng = np.random.default_rng(1)
    q = rng.uniform(-2.0, 2.0, (4, 3, 7))
    assert forward_kinematics(q).shape == (4, 3, 4, 4)
    assert jacobian(q).shape == (4, 3, 6, 7)
    assert np.array_equal(forward_kinematics(q)[2, 1], forward_kinematics(q[2, 1]))
    assert np.allclose(jacobian(q)[2, 1], jacobian(q[2, 1]), atol=1e-15)
    assert hand_position(q).shape == (4, 3, 3)


@pytest.mark.parametrize("bad", [0.0, np.zeros(6), np.zeros((7, 2))])
def test_wrong_shape(bad):
    with pytest.raises(ShapeError, match="seven"):
        forward_kinematics(bad)


def random_pose(rng) -> np.ndarray:
    return expm(twist(rng.normal(size=3), rng.normal(size=3)))


def twist(turn, shift) -> np.ndarray:
    """Generator of the motion that turns about one axis and shifts along another, (4, 4)."""
    x, y, z = turn
    return np.array([[0, -z, y, shift[0]], [z, 0, -x, shift[1]], [-y, x, 0, shift[2]], [0] * 4])


@given(st.integers(0, 2**32 - 1))
def test_it_is_the_product_of_exponentials(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    kind = rng.integers(0, 3, size=n)  # fixed, revolute, prismatic
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    chain = Chain(
        np.array([random_pose(rng) for _ in range(n)]),
        axes * (kind == 1)[:, None],
        axes * (kind == 2)[:, None],
    )
    values = rng.normal(size=(4, n))
    expected = []
    for row in values:
        pose = np.eye(4)
        for joint, value in enumerate(row):
            moved = twist(value * chain.turns[joint], value * chain.shifts[joint])
            pose = pose @ chain.origins[joint] @ expm(moved)
        expected.append(pose[:3, 3])
    np.testing.assert_allclose(tip_poses(chain, values)[:, :3, 3], expected, atol=1e-9)
