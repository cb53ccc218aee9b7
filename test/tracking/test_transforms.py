# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms against scipy, and their algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.tracking.transforms import (
    RigidTransform,
    multiply_quaternions,
    normalise_quaternions,
)

coordinates = st.floats(-100.0, 100.0)
points = arrays(np.float64, 3, elements=coordinates)
quaternions = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(
    lambda q: np.max(np.abs(q)) > 1e-3
)
transforms = st.builds(RigidTransform, points, quaternions)


@given(transforms, arrays(np.float64, (5, 3), elements=coordinates))
def test_inverse_undoes(transform, cloud):
    np.testing.assert_allclose(transform.inverse().apply(transform.apply(cloud)), cloud, atol=1e-9)


@given(transforms)
def test_rotation_is_scipys(transform):
    np.testing.assert_allclose(
        transform.rotation, Rotation.from_quat(transform.quaternion).as_matrix(), atol=1e-12
    )


@given(quaternions, quaternions)
def test_product_is_scipys(left, right):
    left, right = normalise_quaternions(left), normalise_quaternions(right)
    expected = (Rotation.from_quat(left) * Rotation.from_quat(right)).as_quat()
    product = multiply_quaternions(left, right)
    assert abs(product @ expected) == pytest.approx(1.0, abs=1e-12)


def test_huge_quaternion_is_normalised():
    unit = normalise_quaternions(np.array([0.0, 0.0, 1e300, 1e300]))
    np.testing.assert_allclose(unit, [0.0, 0.0, 0.5**0.5, 0.5**0.5])


def test_zero_quaternion_is_none():
    assert np.isnan(normalise_quaternions(np.zeros(4))).all()


@pytest.mark.parametrize(
    ("translation", "quaternion", "error"),
    [
        ([0, 0], [0, 0, 0, 1], ShapeError),
        ([0, 0, 0], [0, 0, 1], ShapeError),
        ([0, 0, np.nan], [0, 0, 0, 1], ArgumentError),
        ([0, 0, 0], [0, 0, 0, 0], ArgumentError),
    ],
)
def test_malformed_is_refused(translation, quaternion, error):
    with pytest.raises(error):
        RigidTransform(translation, quaternion)


def test_arrays_are_copied_and_frozen():
    translation = np.zeros(3)
    transform = RigidTransform(translation, [0, 0, 0, 1])
    translation[0] = 5.0
    assert transform.translation[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        transform.translation[0] = 1.0
