# SPDX-License-Identifier: Apache-2.0
"""Positions along any chain of joints, beside homogeneous transforms and the LWR's own frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from intent_recognition.errors import ShapeError
from intent_recognition.kinematics.chain import Chain, tip_positions
from intent_recognition.kinematics.forward import hand_position
from intent_recognition.kinematics.lwr import DH


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
    np.testing.assert_allclose(tip_positions(chain, values), expected, atol=1e-9)


def test_the_hand_of_the_lwr():
    """A Denavit-Hartenberg frame: turn about z, then a fixed shift along z and turn about x."""
    after = [
        expm(twist((0, 0, 0), (0, 0, d))) @ expm(twist((a, 0, 0), (0, 0, 0)))
        for d, a in zip(DH.d_m, DH.alpha_rad, strict=True)
    ]
    origins = np.array([np.eye(4), *after])
    turns = np.array([[0.0, 0.0, 1.0]] * 7 + [[0.0, 0.0, 0.0]])
    q = np.random.default_rng(1).uniform(-2.0, 2.0, size=(10, 7))
    tips = tip_positions(Chain(origins, turns, np.zeros((8, 3))), np.c_[q, np.zeros(10)])
    np.testing.assert_allclose(tips, hand_position(q), atol=1e-12)


def test_a_wrong_number_of_values_is_named():
    chain = Chain(np.array([np.eye(4)]), np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(ShapeError, match=r"values.*\(T, 1\)"):
        tip_positions(chain, np.zeros((3, 2)))
