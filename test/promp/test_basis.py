# SPDX-License-Identifier: Apache-2.0
"""The basis is a partition of unity and its derivative is its derivative."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.promp.basis import NormalizedRBFBasis

bases = st.builds(NormalizedRBFBasis, st.integers(3, 40), st.floats(0.3, 3.0))
phases = st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=20).map(np.array)


@given(bases, phases)
def test_partition_of_unity_with_no_negative_part(basis, phase):
    values = basis.design_matrix(phase)
    assert values.shape == (len(phase), basis.n_basis)
    assert values.min() >= 0.0
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-13)


@given(bases, st.lists(st.floats(0.001, 0.999), min_size=1, max_size=20).map(np.array))
def test_derivative_equals_finite_differences(basis, phase):
    h = 1e-6
    numeric = (basis.design_matrix(phase + h) - basis.design_matrix(phase - h)) / (2 * h)
    scale = max(1.0, np.abs(numeric).max())
    np.testing.assert_allclose(basis.derivative_matrix(phase), numeric, atol=1e-6 * scale)


@given(bases, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_scaling_keeps_the_start_and_multiplies_what_leads_away_from_it(basis, factor, other):
    design = basis.design_matrix(np.linspace(0.0, 1.0, 7))
    weights = np.cos(np.arange(basis.n_basis))
    course, scaled = design @ weights, design @ basis.scaling(factor) @ weights
    np.testing.assert_allclose(scaled, course[0] + factor * (course - course[0]), atol=1e-12)
    twice = basis.scaling(np.array([factor, 1.0])) @ basis.scaling(other)
    np.testing.assert_allclose(twice, basis.scaling(np.array([factor * other, other])), atol=1e-12)


@pytest.mark.parametrize(("n_basis", "width"), [(20, 1.0), (20, 1.5), (40, 1.5), (20, 2.0)])
def test_shifting_moves_a_course_and_holds_its_ends(n_basis, width):
    basis, phase = NormalizedRBFBasis(n_basis, width), np.linspace(0, 1, 50)
    by = np.array([0.03, -0.02])
    weights = np.sin(4.0 * basis.centers)
    shifted = basis.design_matrix(phase) @ basis.shifting(by) @ weights
    expected = basis.design_matrix(phase - by[:, None]) @ weights
    np.testing.assert_allclose(shifted, expected, atol=0.01)
    assert np.abs(basis.shifting(by)).sum(axis=2).max() < 9.0  # of errors
    np.testing.assert_allclose(basis.shifting(by) @ np.ones(n_basis), 1.0, atol=1e-12)
    assert np.array_equal(basis.shifting(np.zeros(2)), [np.eye(n_basis)] * 2)


@given(bases, st.floats(-5.0, 0.0), st.floats(1.0, 5.0))
def test_outside_the_movement_the_value_is_held_and_the_velocity_zero(basis, before, after):
    ends = basis.design_matrix(np.array([0.0, 1.0]))
    assert np.array_equal(basis.design_matrix(np.array([before, after])), ends)
    beyond = np.array([before - 1e-3, after + 1e-3])
    assert not basis.derivative_matrix(beyond).any()


def test_leading_dimensions_are_kept():
    basis = NormalizedRBFBasis(5)
    phase = np.linspace(0, 1, 12).reshape(3, 4)
    assert basis.design_matrix(phase).shape == (3, 4, 5)
    assert np.array_equal(basis.design_matrix(phase)[1, 2], basis.design_matrix(phase[1, 2]))
    assert np.array_equal(
        basis.derivative_matrix(phase)[1, 2], basis.derivative_matrix(phase[1, 2])
    )


@pytest.mark.parametrize(("n", "width"), [(2, 1.0), (10, 0.0), (10, -1.0), (10, float("nan"))])
def test_a_basis_that_cannot_be_is_refused(n, width):
    with pytest.raises(ArgumentError, match=r"n_basis, width: expected 3 basis.*Try 20"):
        NormalizedRBFBasis(n, width)


def test_narrow_functions_do_not_underflow_between_their_centres():
    basis = NormalizedRBFBasis(5, 0.01)
    values = basis.design_matrix(np.array([0.0, 0.1249, 0.1251, 1.0]))
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-12)
    assert np.argmax(values, axis=1).tolist() == [0, 0, 1, 4]
