# SPDX-License-Identifier: Apache-2.0
"""Filters are exact where they must be, linear, without lag, and refuse what they cannot do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, make_smoothing_spline

from experiments.sketches.differentiation import (
    Butterworth,
    SavitzkyGolay,
    derivative_operators,
    spline_operators,
)

PHASE = np.linspace(0.0, 1.0, 81)
STEP = float(PHASE[1])
SMOOTHERS = (SavitzkyGolay(0.05, 2), SavitzkyGolay(0.2), Butterworth(6.0), Butterworth(20.0))


@given(
    st.lists(st.floats(-3, 3), min_size=4, max_size=4),
    st.sampled_from([0.04, 0.1, 0.5, 3.0]),
    st.integers(6, 81),
)
def test_savitzky_golay_is_exact_on_cubics_up_to_the_ends(coefficients, width, n_samples):
    cubic = np.polynomial.Polynomial(coefficients)
    phase = PHASE[:n_samples]
    found = derivative_operators(SavitzkyGolay(width), n_samples, STEP) @ cubic(phase)
    for order, values in enumerate(found):
        expected = cubic.deriv(order)(phase) if order else cubic(phase)
        np.testing.assert_allclose(
            values, expected, atol=1e-6 * max(map(abs, coefficients), default=1) + 1e-9
        )


@pytest.mark.parametrize("smoother", SMOOTHERS)
def test_filters_keep_lines_and_do_not_lag(smoother):
    position, velocity, acceleration = derivative_operators(smoother, 81, STEP) @ (3.0 * PHASE - 1)
    np.testing.assert_allclose(position, 3.0 * PHASE - 1.0, atol=1e-3)
    np.testing.assert_allclose(velocity, 3.0, atol=0.05)
    np.testing.assert_allclose(acceleration[8:-8], 0.0, atol=1.0)
    bump = np.exp(-0.5 * ((PHASE - 0.5) / 0.1) ** 2)
    position = derivative_operators(smoother, 81, STEP)[0] @ bump
    np.testing.assert_allclose(position, position[::-1], atol=1e-3)
    assert np.argmax(position) == 40


@pytest.mark.slow
def test_butterworth_halves_the_amplitude_at_its_cutoff():
    phase = np.linspace(0.0, 8.0, 1601)
    wave = np.sin(2.0 * np.pi * 5.0 * phase)
    position = derivative_operators(Butterworth(5.0), 1601, float(phase[1]))[0] @ wave
    np.testing.assert_allclose(np.abs(position[400:1200]).max(), 0.5, atol=0.01)


@pytest.mark.parametrize("roughness", [0.0, 1e-4])
def test_spline_is_scipys(rng, roughness):
    phase = np.sort(rng.uniform(0.0, 1.0, 9))
    values = rng.normal(size=9)
    at = np.linspace(phase[0], phase[-1], 30)
    if roughness:
        expected = make_smoothing_spline(phase, values, lam=roughness)
    else:
        expected = CubicSpline(phase, values, bc_type="natural")
    found = spline_operators(phase, at, roughness) @ values
    for order in range(3):
        scale = np.abs(expected(at, order)).max()
        np.testing.assert_allclose(found[order], expected(at, order), atol=1e-6 * scale)
