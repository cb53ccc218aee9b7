# SPDX-License-Identifier: Apache-2.0
"""Orientations as rotation vectors: against scipy's rotations, and by identities."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals import LARGEST_ANGLE_RAD, from_tangent, mean_orientation, to_tangent
from intent_recognition.signals.orientation import (
    quaternion_rates,
    right_jacobian,
    rotation_matrix,
    to_tangent_covariance,
)


def drawn(seed, n=50, spread=0.8):
    """Orientations about a random one, and that one."""
    rng = np.random.default_rng(seed)
    reference = Rotation.random(random_state=seed)
    vectors = rng.normal(size=(n, 3)) * spread
    vectors *= np.minimum(1.0, 2.9 / np.linalg.norm(vectors, axis=1))[:, None]
    return reference, vectors, reference * Rotation.from_rotvec(vectors)


@given(st.integers(0, 10_000), st.sampled_from([1e-9, 1e-5, 1e-3, 0.3, 2.0]))
@settings(max_examples=60)
def test_they_are_scipy_s_rotation_vectors_and_lead_back(seed, spread):
    reference, vectors, rotations = drawn(seed, spread=spread)
    found = to_tangent(rotations.as_quat(), reference.as_quat())
    np.testing.assert_allclose(found, vectors, rtol=1e-7, atol=1e-14)
    back = Rotation.from_quat(from_tangent(found, reference.as_quat()))
    np.testing.assert_allclose((back.inv() * rotations).magnitude(), 0.0, atol=1e-14)


@given(st.integers(0, 10_000))
@settings(max_examples=30)
def test_neither_sign_nor_norm_of_a_quaternion_matters(seed):
    reference, _, rotations = drawn(seed)
    quaternions, rng = rotations.as_quat(), np.random.default_rng(seed)
    signs = rng.choice([-1.0, 1.0], (50, 1))
    np.testing.assert_array_equal(
        to_tangent(signs * quaternions, reference.as_quat()),
        to_tangent(quaternions, -reference.as_quat()),
    )
    assert np.array_equal(mean_orientation(signs * quaternions), mean_orientation(quaternions))
    np.testing.assert_allclose(
        to_tangent(rng.uniform(0.1, 9.0, (50, 1)) * quaternions, reference.as_quat()),
        to_tangent(quaternions, reference.as_quat()),
        atol=1e-13,
    )


@given(st.integers(0, 10_000))
@settings(max_examples=30)
def test_in_a_turned_world_the_vectors_about_the_mean_are_the_same(seed):
    _, _, rotations = drawn(seed, spread=0.4)
    turned = Rotation.random(random_state=seed + 1) * rotations
    means = [mean_orientation(r.as_quat()) for r in (rotations, turned)]
    vectors = [to_tangent(r.as_quat(), m) for r, m in zip((rotations, turned), means, strict=True)]
    np.testing.assert_allclose(vectors[0], vectors[1], atol=1e-12)
    np.testing.assert_allclose(means[0], Rotation.mean(rotations).as_quat(True), atol=1e-12)


def test_what_was_not_measured_is_nan_and_signs_of_a_path_are_continuous():
    quaternions = [[0, 0, 0, 0], [np.nan, 0, 0, 1], [0, 0, np.inf, 1], [1, 0, 0, 0], [0, 0, 0, 1]]
    found = np.isnan(to_tangent(quaternions, [0, 0, 0, 1])).all(axis=1)
    assert found.tolist() == [True, True, True, True, False]
    for angle in (0.999, 1.001):
        far = from_tangent([angle * LARGEST_ANGLE_RAD, 0, 0], [0, 0, 0, 1])
        assert np.isnan(to_tangent(far, [0, 0, 0, 1])).any() == (angle > 1.0)
    with pytest.raises(ArgumentError, match="at least one that is measured"):
        mean_orientation(np.zeros((3, 4)))
    path = from_tangent(np.linspace([0, 0, 0], [0, 0, 6.0], 50), [0.6, 0, 0, 0.8])
    assert np.all(np.sum(path[1:] * path[:-1], axis=1) > 0.99)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_jacobian_and_rates_are_differences(seed):
    reference, vectors, rotations = drawn(seed, n=1)
    (vector,), rate, h = vectors, np.random.default_rng(seed).normal(size=3), 1e-6
    ahead, behind = (
        reference * Rotation.from_rotvec(vector + sign * h * rate) for sign in (1.0, -1.0)
    )
    turn = (behind.inv() * ahead).as_rotvec() / (2 * h)
    np.testing.assert_allclose(right_jacobian(vector) @ rate, turn, atol=1e-8)
    path = [from_tangent(vector + s * h * rate, reference.as_quat()) for s in (-1.0, 0.0, 1.0)]
    expected = (path[2] - path[0]) / (2 * h)
    np.testing.assert_allclose(quaternion_rates(path[1], vector, rate), expected, atol=1e-8)
    np.testing.assert_allclose(rotation_matrix(path[1]), rotations.as_matrix()[0], atol=1e-14)


def test_a_covariance_about_the_world_s_axes_is_that_of_the_vectors():
    reference, vectors, rotations = drawn(5, n=1)
    root = np.random.default_rng(5).normal(size=(3, 3)) * 1e-3
    small = np.random.default_rng(6).normal(size=(200_000, 3)) @ root.T
    moved = to_tangent((Rotation.from_rotvec(small) * rotations[0]).as_quat(), reference.as_quat())
    found = to_tangent_covariance(root @ root.T, vectors[0], reference.as_quat())
    np.testing.assert_allclose(np.cov(moved.T), found, atol=0.01 * np.abs(found).max())


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: to_tangent([0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), r"quaternions: .* got \(3,\)"),
        (lambda: to_tangent([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0]), r"reference: .* got \(3,\)"),
        (lambda: from_tangent([0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), r"vectors: .* got \(2,\)"),
        (lambda: mean_orientation([[0.0, 0.0, 1.0]]), r"quaternions: .* got \(1, 3\)"),
    ],
)
def test_vectors_of_another_size_are_named(call, says):
    with pytest.raises(ShapeError, match=says):
        call()
