# SPDX-License-Identifier: Apache-2.0
"""The DMP is the system it claims to be, and conditioning it is conditioning a joint Gaussian."""

import numpy as np
from scipy.integrate import solve_ivp

from experiments.sketches.differentiation import SavitzkyGolay, derivative_operators
from experiments.sketches.interaction_dmp import (
    DmpModel,
    Motion,
    differentiated,
    fit_demonstrations,
)
from experiments.sketches.models import predictor, prior
from intent_recognition.gaussian.normal import condition
from intent_recognition.promp.basis import NormalizedRBFBasis

PHASE = np.linspace(0.0, 1.0, 101)
MODEL = DmpModel(NormalizedRBFBasis(20))


def parameters(rng):
    return np.concatenate([40.0 * rng.normal(size=20), rng.normal(size=2), [3.0 * rng.normal()]])


def test_rollout_is_the_differential_equation_solved(rng):
    theta = parameters(rng)
    spring = MODEL.spring

    def change(z, state):
        force = MODEL.basis.design_matrix(np.array([z]))[0] @ theta[:20]
        pull = spring.stiffness * (theta[20] - state[0]) - spring.alpha * state[1]
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


def test_what_is_observed_is_forcing_and_goal_of_what_is_differentiated(rng):
    theta = parameters(rng)
    expected = MODEL.basis.design_matrix(PHASE) @ theta[:20] + 625.0 / 4.0 * theta[20]
    np.testing.assert_allclose(MODEL.observation_matrix(PHASE) @ theta, expected)
    motion = Motion(*rng.normal(size=(3, 5)))
    difference = MODEL.drive(motion) - MODEL.forcing(motion, 0.7)
    np.testing.assert_allclose(difference, 625.0 / 4.0 * 0.7)
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
