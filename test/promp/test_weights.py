# SPDX-License-Identifier: Apache-2.0
"""Ridge regression recovers what a trajectory was made of."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import minimum_jerk

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.promp import NormalizedRBFBasis, fit_weights

BASIS = NormalizedRBFBasis(12, 1.0)
PHASE = np.linspace(0.0, 1.0, 200)


def test_weights_of_a_noiseless_trajectory_are_recovered():
    """One basis function each: the fit is linear in the values, so this holds for any weights."""
    fit = fit_weights(BASIS, PHASE, BASIS.design_matrix(PHASE), ridge=1e-9)
    np.testing.assert_allclose(fit.weights, np.eye(12), atol=1e-4)
    assert fit.residual_variance.max() < 1e-10


def test_residual_variance_is_the_noise_variance(rng):
    true = rng.normal(size=(1, 12))
    phase = rng.uniform(size=20_000)
    std = np.array([0.1])
    values = BASIS.design_matrix(phase) @ true.T + rng.normal(size=(20_000, 1)) * std
    fit = fit_weights(BASIS, phase, values, ridge=1e-6)
    np.testing.assert_allclose(np.sqrt(fit.residual_variance), std, rtol=0.02)
    error = BASIS.design_matrix(PHASE) @ (fit.weights - true).T
    assert np.sqrt(np.mean(error**2)) < 3 * 0.1 * np.sqrt(12 / 20_000)


def test_gaps_are_bridged_and_a_start_continued_along_a_line(rng):
    values = np.stack([minimum_jerk(PHASE), PHASE], axis=1)
    seen = (PHASE < 0.35) | (PHASE > 0.6)
    fit = fit_weights(BASIS, PHASE[seen], values[seen], ridge=1e-4)
    error = BASIS.design_matrix(PHASE) @ fit.weights.T - values
    assert np.abs(error[:, 0]).max() < 0.03
    assert np.abs(error[:, 1]).max() < 0.01
    seen = PHASE < 0.5
    fit = fit_weights(BASIS, PHASE[seen], 5.0 + 2.0 * PHASE[seen, None], ridge=1e-4)
    end = float(BASIS.design_matrix(np.ones(1))[0] @ fit.weights[0])
    assert end == pytest.approx(7.0, abs=0.2)


@pytest.mark.parametrize("ridge", [1e-4, 1e-2, 1.0])
def test_ridge_means_the_same_at_any_sampling_rate(ridge):
    def weights(n: int) -> np.ndarray:
        phase = (np.arange(n) + 0.5) / n
        return fit_weights(BASIS, phase, np.sin(9 * phase)[:, None], ridge).weights

    np.testing.assert_allclose(weights(300), weights(6000), atol=2e-3)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_adding_a_constant_or_scaling_the_unit_does_the_same_to_the_weights(offset, factor):
    values = np.sin(7 * PHASE)[:, None]
    base = fit_weights(BASIS, PHASE, values)
    moved = fit_weights(BASIS, PHASE, factor * values + offset)
    np.testing.assert_allclose(moved.weights, factor * base.weights + offset, atol=1e-5)


def test_coordinates_far_from_their_origin_lose_nothing():
    """Such as those of a map, 5000 km away: the fit is that of the same movement at the origin."""
    values = 0.4 * minimum_jerk(PHASE)[:, None]
    near, far = fit_weights(BASIS, PHASE, values), fit_weights(BASIS, PHASE, values + 5e6)
    np.testing.assert_allclose(far.weights - 5e6, near.weights, atol=1e-8)
    np.testing.assert_allclose(far.residual_variance, near.residual_variance, atol=1e-15)


def test_bad_arguments_are_named():
    with pytest.raises(ArgumentError, match="ridge: expected a positive number, got 0"):
        fit_weights(BASIS, PHASE, np.zeros((200, 1)), ridge=0)
    with pytest.raises(TrainingError, match="at least 4 samples of every DOF, got 3"):
        fit_weights(BASIS, PHASE[:3], np.zeros((3, 1)))
