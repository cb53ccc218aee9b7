# SPDX-License-Identifier: Apache-2.0
"""Slopes from demonstrations alone: penalised least squares, in a joint covariance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.gaussian import Gaussian, regression
from intent_recognition.promp import Scatter, TargetSettings, predictive_covariance, weight_floor
from intent_recognition.promp.ridge import MOST_SPENT, ridge_slopes, with_slopes

N_BASIS = 6
SIZE = 2 * N_BASIS
"""Weights of two observed DOFs."""


def deviations(rng: np.random.Generator, n: int, noise: float = 0.0) -> tuple[np.ndarray, ...]:
    """Observed weights, those that follow them, and the slopes."""
    observed = rng.normal(size=(n, SIZE)) * rng.uniform(0.1, 2.0, SIZE)
    slopes = rng.normal(size=(N_BASIS, SIZE))
    return observed, observed @ slopes.T + noise * rng.normal(size=(n, N_BASIS)), slopes


def covariance_of(*parts: np.ndarray) -> np.ndarray:
    both = np.hstack(parts)
    return both.T @ both / len(both)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(5, 40), st.floats(1e-4, 10.0))
def test_slopes_are_penalised_least_squares(seed, n, chance):
    rng = np.random.default_rng(seed)
    observed, followed, _ = deviations(rng, n, noise=0.5)
    variance = chance * rng.uniform(0.5, 2.0, SIZE)
    slopes, spent = ridge_slopes(covariance_of(observed, followed), variance, n)
    rows = np.vstack([observed, np.diag(np.sqrt(n * variance))])
    penalised, *_ = np.linalg.lstsq(rows, np.vstack([followed, np.zeros((SIZE, N_BASIS))]))
    np.testing.assert_allclose(slopes, penalised.T, rtol=1e-6, atol=1e-9)
    fitted = observed @ np.linalg.pinv(rows)[:, :n]
    assert spent == pytest.approx(min(np.trace(fitted) / n, MOST_SPENT))


def test_slopes_are_found_exactly_and_are_those_of_the_joint_covariance(rng):
    observed, followed, truth = deviations(rng, 60)
    slopes, _ = ridge_slopes(covariance_of(observed, followed), np.full(SIZE, 1e-12), 60)
    np.testing.assert_allclose(slopes, truth, atol=1e-6)
    observed, _, slopes = deviations(rng, 30)
    root = rng.normal(size=(N_BASIS, N_BASIS))
    known, left = covariance_of(observed), root @ root.T
    joint = with_slopes(known, slopes, left)
    found = regression(Gaussian(np.zeros(len(joint)), joint), SIZE)
    np.testing.assert_allclose(found.matrix, slopes, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.covariance, left, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(joint[:SIZE, :SIZE], known)


def of_people(rng: np.random.Generator, places: np.ndarray) -> np.ndarray:
    """Reaches of one person each from a place to nearby ends, which the robot copies, (n, 2, N)."""
    ahead = np.linspace(0.0, 1.0, N_BASIS)
    ends = places + 0.05 * rng.normal(size=len(places))
    human = places[:, None] + ahead * (ends - places)[:, None]
    robot = np.outer(ends, ahead)
    return np.stack([human, robot], axis=1) + 0.001 * rng.normal(size=(len(places), 2, N_BASIS))


@pytest.mark.parametrize("seed", range(5))
def test_a_person_far_away_is_followed_by_slopes_of_the_demonstrations(seed):
    rng = np.random.default_rng(seed)
    weights = of_people(rng, np.repeat(0.06 * rng.normal(size=3), 6))
    mean = weights.mean(axis=0)
    flat = (weights - mean).reshape(len(weights), -1)
    scatter, floor = Scatter(flat.T @ flat, len(weights) - 1), weight_floor(weights)
    far = of_people(rng, np.full(20, 0.3)) - mean
    errors = []
    for ridge in (0.0, 1e-3):
        assumed = TargetSettings(n_observed=1, ridge=ridge)
        joint = predictive_covariance(scatter, scatter, len(weights), floor, 100.0, assumed)
        rule = regression(Gaussian(np.zeros(len(joint)), joint), N_BASIS)
        errors.append(np.std(far[:, 1] - far[:, 0] @ rule.matrix.T))
        assert np.linalg.eigvalsh(joint).min() > 0.0
    assert errors[1] < 0.5 * errors[0]


def test_what_slopes_leave_unexplained_is_what_was_put_in():
    """Of many demonstrations, with noise of the robot alone."""
    rng = np.random.default_rng(3)
    observed, followed, truth = deviations(rng, 4000, noise=0.3)
    flat = np.hstack([observed, followed])
    flat -= flat.mean(axis=0)
    scatter = Scatter(flat.T @ flat, len(flat) - 1)
    assumed = TargetSettings(n_observed=2, ridge=1e-6)
    floor = weight_floor(flat.reshape(len(flat), 3, N_BASIS))
    joint = predictive_covariance(scatter, scatter, len(flat), floor, 4.0, assumed)
    found = regression(Gaussian(np.zeros(len(joint)), joint), SIZE)
    np.testing.assert_allclose(found.matrix, truth, atol=0.2)
    np.testing.assert_allclose(found.covariance, 0.3**2 * np.eye(N_BASIS), atol=0.02)
