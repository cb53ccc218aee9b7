# SPDX-License-Identifier: Apache-2.0
"""A mixture as a value: density, responsibilities, conditioning, moments, and fitting one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import Gaussian, GaussianMixture, condition, fit_gaussian_mixture


def random_mixture(rng, n_components=3, d=4):
    components = []
    for _ in range(n_components):
        root = rng.normal(size=(d, d))
        components.append(Gaussian(rng.normal(size=d), root @ root.T + 0.1 * np.eye(d)))
    return GaussianMixture(rng.dirichlet(np.ones(n_components)), tuple(components))


def density_of(mixture, points):
    return np.stack(
        [
            w * np.atleast_1d(multivariate_normal(c.mean, c.covariance).pdf(points))
            for w, c in zip(mixture.weights, mixture.components, strict=True)
        ],
        axis=1,
    )


@given(seed=st.integers(0, 1000))
def test_an_observation_weighs_and_conditions_every_component(seed):
    rng = np.random.default_rng(seed)
    mixture = random_mixture(rng)
    matrix, value, noise = rng.normal(size=(2, 4)), rng.normal(size=2), 0.3 * np.eye(2)
    found, log_evidence = mixture.condition(matrix, value, noise)
    evidence = [
        multivariate_normal(matrix @ c.mean, matrix @ c.covariance @ matrix.T + noise).pdf(value)
        for c in mixture.components
    ]
    total = np.sum(mixture.weights * evidence)
    np.testing.assert_allclose(found.weights, mixture.weights * evidence / total, atol=1e-10)
    assert log_evidence == pytest.approx(np.log(total), abs=1e-9)
    for component, conditioned in zip(mixture.components, found.components, strict=True):
        alone, _ = condition(component, matrix, value, noise)
        np.testing.assert_allclose(conditioned.mean, alone.mean, atol=1e-12)
    assert found.most_probable is found.components[int(np.argmax(found.weights))]
    second = sum(
        p * (c.covariance + np.outer(c.mean, c.mean))
        for p, c in zip(found.weights, found.components, strict=True)
    )
    mean = found.moments.mean
    np.testing.assert_allclose(found.moments.covariance, second - np.outer(mean, mean), atol=1e-9)


def test_a_component_without_weight_takes_no_part():
    near, far = Gaussian(np.zeros(1), np.eye(1)), Gaussian(np.ones(1), np.eye(1))
    mixture = GaussianMixture([0.0, 1.0], (near, far))
    found, _ = mixture.condition(np.eye(1), np.zeros(1), np.eye(1))
    np.testing.assert_array_equal(found.weights, [0.0, 1.0])


@given(seed=st.integers(0, 1000))
def test_density_and_responsibilities_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    mixture, points = random_mixture(rng), rng.normal(size=(5, 4))
    joint = density_of(mixture, points)
    np.testing.assert_allclose(mixture.log_density(points), np.log(joint.sum(axis=1)), atol=1e-9)
    expected = joint / joint.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(mixture.responsibilities(points), expected, atol=1e-9)


def test_a_fit_is_a_fixed_point_of_the_textbook_step():
    """One more E and M step, as printed in Eq. 7-10, changes nothing."""
    rng = np.random.default_rng(4)
    points = np.concatenate([rng.normal(size=(40, 2)), rng.normal(size=(30, 2)) + [4.0, 1.0]])
    found = fit_gaussian_mixture(points, 2, rng, variance_floor=1e-9)
    share = found.responsibilities(points)
    count = share.sum(axis=0)
    np.testing.assert_allclose(count / len(points), found.weights, atol=1e-4)
    for k, component in enumerate(found.components):
        mean = share[:, k] @ points / count[k]
        errors = points - mean
        np.testing.assert_allclose(component.mean, mean, atol=1e-3)
        covariance = (share[:, k, None] * errors).T @ errors / count[k]
        np.testing.assert_allclose(component.covariance, covariance, atol=1e-3)


@pytest.mark.parametrize(
    ("points", "n_components", "error"),
    [
        (np.zeros(5), 1, ShapeError),
        (np.full((5, 2), np.nan), 1, ArgumentError),
        (np.zeros((5, 2)), 6, ArgumentError),
        (np.zeros((5, 2)), 0, ArgumentError),
    ],
)
def test_unusable_points_are_refused(points, n_components, error):
    with pytest.raises(error):
        fit_gaussian_mixture(points, n_components, np.random.default_rng(1))
    for floor in (0.0, np.inf):
        with pytest.raises(ArgumentError, match="variance_floor"):
            fit_gaussian_mixture(np.eye(2), 1, np.random.default_rng(1), variance_floor=floor)


def test_weights_must_be_probabilities():
    one = Gaussian(np.zeros(1), np.eye(1))
    with pytest.raises(ArgumentError, match="sum to one"):
        GaussianMixture([0.4, 0.4], (one, one))
    with pytest.raises(ShapeError):
        GaussianMixture([1.0], (one, one))


def test_points_of_another_dimension_are_refused():
    mixture = random_mixture(np.random.default_rng(1))
    with pytest.raises(ShapeError, match=r"\(n, 4\)"):
        mixture.log_density(np.zeros((3, 2)))
