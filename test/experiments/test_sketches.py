# SPDX-License-Identifier: Apache-2.0
"""Sparse and noisy sketches: filters, the DMP, their parts, and that the experiments run."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_smoothing_spline

from experiments.noise import experiment as noise
from experiments.noise.study import DMP, DMP_CARRIED, PROMP
from experiments.settings import Settings
from experiments.sketches.curves import PHASE, sketch_pairs
from experiments.sketches.differentiation import (
    Butterworth,
    SavitzkyGolay,
    derivative_operators,
    spline_operators,
)
from experiments.sketches.interaction_dmp import (
    ALPHA,
    STIFFNESS,
    DmpModel,
    differentiated,
    fit_demonstrations,
)
from experiments.sketches.models import (
    ModelChoice,
    learn_dmp,
    learn_promp,
    observation,
    predictor,
    prior,
    squared_errors,
)
from experiments.sparse import experiment as sparse
from experiments.sparse.conditioning import promp_curves
from intent_recognition.gaussian.normal import condition
from intent_recognition.promp.basis import NormalizedRBFBasis

EVEN = np.linspace(0.0, 1.0, 81)
STEP = float(EVEN[1])
SMOOTHERS = (SavitzkyGolay(0.05, 2), SavitzkyGolay(0.2), Butterworth(6.0), Butterworth(20.0))


@given(
    st.lists(st.floats(-3, 3), min_size=4, max_size=4),
    st.sampled_from([0.04, 0.1, 0.5, 3.0]),
    st.integers(6, 81),
)
def test_savitzky_golay_is_exact_on_cubics_up_to_the_ends(coefficients, width, n_samples):
    cubic = np.polynomial.Polynomial(coefficients)
    phase = EVEN[:n_samples]
    found = derivative_operators(SavitzkyGolay(width), n_samples, STEP) @ cubic(phase)
    for order, values in enumerate(found):
        expected = cubic.deriv(order)(phase) if order else cubic(phase)
        np.testing.assert_allclose(
            values, expected, atol=1e-6 * max(map(abs, coefficients), default=1) + 1e-9
        )


@pytest.mark.parametrize("smoother", SMOOTHERS)
def test_filters_keep_lines_and_do_not_lag(smoother):
    position, velocity, acceleration = derivative_operators(smoother, 81, STEP) @ (3.0 * EVEN - 1)
    np.testing.assert_allclose(position, 3.0 * EVEN - 1.0, atol=1e-3)
    np.testing.assert_allclose(velocity, 3.0, atol=0.05)
    np.testing.assert_allclose(acceleration[8:-8], 0.0, atol=1.0)
    bump = np.exp(-0.5 * ((EVEN - 0.5) / 0.1) ** 2)
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


MODEL = DmpModel(NormalizedRBFBasis(20))


def parameters(rng):
    return np.concatenate([40.0 * rng.normal(size=20), rng.normal(size=2), [3.0 * rng.normal()]])


def test_rollout_is_the_differential_equation_solved(rng):
    theta = parameters(rng)

    def change(z, state):
        force = MODEL.basis.design_matrix(np.array([z]))[0] @ theta[:20]
        pull = STIFFNESS * (theta[20] - state[0]) - ALPHA * state[1]
        return state[1], pull + force

    found = solve_ivp(change, (0, 1), theta[21:], t_eval=PHASE, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(MODEL.rollout_matrix(PHASE) @ theta, found.y[0], atol=2e-4)


def test_weights_are_recovered_from_a_rollout(rng):
    theta = parameters(rng)
    theta[:20] = 40.0 * np.sin(np.linspace(0.0, 4.0, 20))  # smooth weights: the penalty is small
    grid = np.linspace(0.0, 1.0, 801)
    curve = MODEL.rollout_matrix(grid) @ theta
    motion = differentiated(SavitzkyGolay(0.01), curve[:, None], float(grid[1]))
    fitted = MODEL.fit(grid, motion, ridge=1e-9)[0]
    forced = MODEL.observation_matrix(PHASE)
    np.testing.assert_allclose(forced @ fitted, forced @ theta, rtol=0.01, atol=5.0)
    np.testing.assert_allclose(MODEL.rollout_matrix(PHASE) @ fitted, curve[::8], atol=0.01)


def test_conditioning_equals_the_joint_gaussian(rng):
    demonstrations = [
        np.stack([a * np.sin(3.0 * PHASE) + b * PHASE, b * np.cos(4.0 * PHASE)], axis=1)
        for a, b in rng.normal(size=(30, 2))
    ]
    distribution = prior(fit_demonstrations(MODEL, demonstrations, SavitzkyGolay(0.1)), 0.1)
    rows = np.hstack([MODEL.observation_matrix(PHASE[:40]), np.zeros((40, 23))])
    output = np.hstack([np.zeros((101, 23)), MODEL.rollout_matrix(PHASE)])
    noise, seen = 4.0 * np.eye(40), 100.0 * rng.normal(size=40)

    stacked = np.vstack([rows, output])
    joint = stacked @ distribution.covariance @ stacked.T
    mean = stacked @ distribution.mean
    gain = joint[40:, :40] @ np.linalg.inv(joint[:40, :40] + noise)
    expected = mean[40:] + gain @ (seen - mean[:40])

    posterior, _ = condition(distribution, rows, seen, noise)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(output @ posterior.mean, expected, atol=1e-6 * scale)
    matrix, offset = predictor(distribution, rows, noise, output)
    np.testing.assert_allclose(matrix @ seen + offset, expected, atol=1e-6 * scale)


@pytest.fixture(scope="module")
def pairs():
    return sketch_pairs(np.random.default_rng(6), 40)


@pytest.mark.slow
def test_white_noise_keeps_the_variances_of_the_derivatives(pairs):
    smoother = SavitzkyGolay(0.2)
    learned = learn_dmp(pairs, smoother)
    _, white, _ = observation(learned, ModelChoice(0.1, 0.01, smoother), 30)
    _, carried, _ = observation(learned, ModelChoice(0.1, 0.01, smoother, white=False), 30)
    np.testing.assert_allclose(np.diag(white), np.diag(carried))
    assert np.count_nonzero(white - np.diag(np.diag(white))) == 0
    assert np.count_nonzero(carried) > 30 * 30


@pytest.mark.slow
def test_errors_are_those_of_single_predictions(pairs):
    candidate = ModelChoice(0.03, 0.01)
    learned = learn_promp(pairs[:30])
    held = pairs[30:]
    found = squared_errors(pairs[:30], held[..., 1], held[None, ..., 0], [candidate], [40])
    squares = []
    for pair in held:
        curves, _ = promp_curves(learned, 0.03, PHASE[:40], pair[:40, 0], 0.01)
        squares.append(np.mean((curves[1] - pair[:, 1]) ** 2))
    np.testing.assert_allclose(found[0, 0, 0], np.mean(squares), rtol=1e-6)


@pytest.mark.slow
def test_bands_hold_about_what_they_should_and_positions_say_more_than_splines():
    numbers = sparse.run(Settings(quick=True)).numbers
    inside, rmse = np.array(numbers["inside_two_sigma"]), numbers["rmse"]
    assert np.all((inside > 0.85) & (inside < 1.0))
    assert rmse["ProMP"][0] < rmse["DMP, best smoothing spline"][0] < rmse["no observation"][0]


@pytest.mark.slow
def test_the_dmp_is_no_straw_man():
    numbers = noise.run(Settings(quick=True)).numbers
    rmse = {method: np.array(values) for method, values in numbers["rmse"].items()}
    assert rmse[DMP][0, -1] < 1.25 * rmse[PROMP][0, -1]
    assert np.all(rmse[PROMP][1] <= 1.02 * rmse[DMP][1])
    assert np.all(rmse[DMP_CARRIED] < 1.1 * rmse[PROMP])
    assert rmse["DMP without a filter"][1, -1] > 2.0 * rmse[DMP][1, -1]
