# SPDX-License-Identifier: Apache-2.0
"""The DMP is the system it claims to be, and conditioning it is conditioning a joint Gaussian."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from experiments.sketches.differentiation import Butterworth, SavitzkyGolay, derivative_operators
from experiments.sketches.interaction_dmp import (
    DmpModel,
    Motion,
    SpringDamper,
    differentiated,
    fit_demonstrations,
)
from experiments.sketches.models import predictor, prior
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian.normal import condition
from intent_recognition.promp.basis import NormalizedRBFBasis

PHASE = np.linspace(0.0, 1.0, 101)
MODEL = DmpModel(NormalizedRBFBasis(20))
MANY = np.linspace(0.0, 1.0, 4001)


def parameters(rng):
    return np.concatenate([40.0 * rng.normal(size=20), rng.normal(size=2), [3.0 * rng.normal()]])


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-20, 20), st.floats(25, 80))
def test_without_forcing_it_converges_to_the_goal_and_does_not_overshoot(goal, start, speed, alpha):
    model = DmpModel(NormalizedRBFBasis(8), SpringDamper(alpha))
    curve = model.rollout_matrix(PHASE) @ np.array([*np.zeros(8), goal, start, speed])
    rate = 0.5 * alpha  # both eigenvalues: x(z) = (a + b z) exp(-rate z)
    away = start - goal
    expected = goal + (away + (speed + rate * away) * PHASE) * np.exp(-rate * PHASE)
    np.testing.assert_allclose(curve, expected, atol=1e-4 * (1 + abs(speed) + alpha * abs(away)))
    assert abs(curve[-1] - goal) < 1e-2 * (1.0 + abs(away) + abs(speed))


def test_rollout_is_the_differential_equation_solved(rng):
    theta = parameters(rng)
    spring = MODEL.spring

    def change(z, state):
        force = MODEL.basis.design_matrix(np.array([z]))[0] @ theta[:20]
        pull = spring.stiffness * (theta[20] - state[0]) - spring.alpha * state[1]
        return state[1], pull + force

    found = solve_ivp(change, (0, 1), theta[21:], t_eval=PHASE, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(MODEL.rollout_matrix(PHASE) @ theta, found.y[0], atol=2e-4)


def test_second_derivative_of_a_rollout_is_what_the_attractor_says(rng):
    theta = parameters(rng)
    curve = MODEL.rollout_matrix(MANY) @ theta
    velocity = np.gradient(curve, MANY)
    motion = Motion(curve, velocity, np.gradient(velocity, MANY))
    found = MODEL.forcing(motion, theta[20])[20:-20]
    expected = (MODEL.basis.design_matrix(MANY) @ theta[:20])[20:-20]
    assert np.abs(found - expected).max() < 0.03 * np.abs(expected).max()


@pytest.mark.parametrize("smoother", [SavitzkyGolay(0.08), Butterworth(20.0)])
def test_a_demonstration_is_reproduced_by_its_own_weights(smoother):
    values = np.stack([np.sin(5.0 * PHASE) + PHASE**2, 2.0 * np.cos(3.0 * PHASE)], axis=1)
    theta = fit_demonstrations(MODEL, [values], smoother)[0].reshape(2, -1)
    curves = MODEL.rollout_matrix(PHASE) @ theta.T
    assert np.abs(curves - values).max() < 2e-3


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


def test_what_is_observed_is_forcing_and_goal(rng):
    theta = parameters(rng)
    expected = MODEL.basis.design_matrix(PHASE) @ theta[:20] + 625.0 / 4.0 * theta[20]
    np.testing.assert_allclose(MODEL.observation_matrix(PHASE) @ theta, expected)
    motion = Motion(*rng.normal(size=(3, 5)))
    difference = MODEL.drive(motion) - MODEL.forcing(motion, 0.7)
    np.testing.assert_allclose(difference, 625.0 / 4.0 * 0.7)


def test_drive_operator_is_differentiation_and_sum(rng):
    values = rng.normal(size=(101, 1))
    smoother = SavitzkyGolay(0.2)
    operators = derivative_operators(smoother, 101, 0.01)
    found = MODEL.drive(Motion(*operators)) @ values
    np.testing.assert_allclose(
        found, MODEL.drive(differentiated(smoother, values, 0.01)), rtol=1e-9
    )


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


def test_bad_input_is_named():
    with pytest.raises(ArgumentError):
        SpringDamper(0.0)
    with pytest.raises(ShapeError):
        MODEL.fit(PHASE, Motion(*np.zeros((3, 100, 2))))
    with pytest.raises(ArgumentError):
        fit_demonstrations(MODEL, [np.zeros((4, 2))], SavitzkyGolay(0.1))


def test_drives_and_start_tell_as_much_as_positions(rng):
    """Rows of drive and start span those of the positions: what one determines, so does the other.

    The drive of a rollout by exact derivatives, at as many phases as there are weights.
    """
    phase = np.linspace(0.0, 1.0, 60)
    drives = np.vstack([MODEL.observation_matrix(phase), MODEL.start_matrix()])
    positions = MODEL.rollout_matrix(np.linspace(0.0, 1.0, 400))
    without_start = np.linalg.lstsq(drives[:60].T, positions.T, rcond=None)[0]
    with_start = np.linalg.lstsq(drives.T, positions.T, rcond=None)[0]
    np.testing.assert_allclose(drives.T @ with_start, positions.T, atol=1e-6)
    assert np.abs(drives[:60].T @ without_start - positions.T).max() > 0.5
