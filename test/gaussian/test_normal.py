# SPDX-License-Identifier: Apache-2.0
"""Conditioning, marginals and regression against textbook formulas and scipy densities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_triangular
from scipy.stats import multivariate_normal, multivariate_t

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import (
    Gaussian,
    cholesky,
    condition,
    covariance_root,
    expected_distance,
    half_log_det,
    log_density,
    log_sum,
    marginal,
    product,
    regression,
    solve_lower,
    student_log_density,
)

seeds = st.integers(0, 2**32 - 1)


def random_gaussian(rng: np.random.Generator, d: int) -> Gaussian:
    root = rng.normal(size=(d, d))
    return Gaussian(rng.normal(size=d), root @ root.T + 0.1 * np.eye(d))


def random_observation(rng: np.random.Generator, d: int, m: int):
    """H (m, d), y (m,) and a full noise covariance (m, m)."""
    root = rng.normal(size=(m, m))
    return rng.normal(size=(m, d)), rng.normal(size=m), root @ root.T + 0.1 * np.eye(m)


def textbook(prior: Gaussian, H, y, R) -> Gaussian:
    """Information form with explicit inverses: another route to the same posterior."""
    precision = np.linalg.inv(prior.covariance) + H.T @ np.linalg.inv(R) @ H
    covariance = np.linalg.inv(precision)
    shift = H.T @ np.linalg.inv(R) @ (y - H @ prior.mean)
    return Gaussian(prior.mean + covariance @ shift, covariance)


@given(seeds, st.integers(1, 8), st.integers(1, 5))
def test_conditioning_is_the_information_form_and_the_density_of_the_observation(seed, d, m):
    rng = np.random.default_rng(seed)
    prior, (H, y, R) = random_gaussian(rng, d), random_observation(rng, d, m)
    posterior, log_evidence = condition(prior, H, y, R)
    expected = textbook(prior, H, y, R)
    np.testing.assert_allclose(posterior.mean, expected.mean, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(posterior.covariance, expected.covariance, rtol=1e-6, atol=1e-6)
    assert np.array_equal(posterior.covariance, posterior.covariance.T)
    assert np.linalg.eigvalsh(prior.covariance - posterior.covariance).min() > -1e-9
    assert np.linalg.eigvalsh(posterior.covariance).min() > 0
    density = multivariate_normal(H @ prior.mean, H @ prior.covariance @ H.T + R).logpdf(y)
    assert log_evidence == pytest.approx(density, rel=1e-9, abs=1e-9)


@given(seeds, st.integers(1, 8))
def test_log_density_equals_scipy(seed, d):
    rng = np.random.default_rng(seed)
    distribution, value = random_gaussian(rng, d), rng.normal(size=d)
    expected = multivariate_normal(*distribution).logpdf(value)
    assert log_density(distribution, value) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(seeds, st.integers(2, 8), st.data())
def test_marginal_takes_the_elements_in_the_order_asked_for(seed, d, data):
    rng = np.random.default_rng(seed)
    distribution = random_gaussian(rng, d)
    index = data.draw(st.permutations(range(d)))[: data.draw(st.integers(1, d))]
    part = marginal(distribution, index)
    selection = np.eye(d)[index]
    assert np.array_equal(part.mean, selection @ distribution.mean)
    np.testing.assert_allclose(part.covariance, selection @ distribution.covariance @ selection.T)


@given(seeds, st.integers(1, 5), st.integers(1, 5))
def test_density_factors_into_marginal_and_regression(seed, n_source, n_target):
    rng = np.random.default_rng(seed)
    joint = random_gaussian(rng, n_source + n_target)
    value = rng.normal(size=n_source + n_target)
    matrix, offset, covariance = regression(joint, n_source)
    source = marginal(joint, np.arange(n_source))
    conditional = Gaussian(offset + matrix @ value[:n_source], covariance)
    total = log_density(source, value[:n_source]) + log_density(conditional, value[n_source:])
    assert total == pytest.approx(log_density(joint, value), rel=1e-7, abs=1e-7)


def test_the_product_of_densities_is_the_density_of_the_product(rng):
    factors = []
    for _ in range(3):
        root = rng.normal(size=(4, 4))
        factors.append(Gaussian(rng.normal(size=4), root @ root.T + np.eye(4)))
    powers = [0.5, 2.0, 0.03]
    found = product(factors, powers)
    points = rng.normal(size=(20, 4))
    summed = sum(a * log_density(f, points) for f, a in zip(factors, powers, strict=True))
    gap = summed - log_density(found, points)
    np.testing.assert_allclose(gap, gap[0], atol=1e-9)
    assert product(factors, [0.0, 1.0, 0.0]) is factors[1]


def test_a_root_and_an_expected_square_are_those_of_the_covariance(rng):
    """Of a singular one, too, and of one with a negative eigenvalue from rounding."""
    root, mean, weight = rng.normal(size=(4, 2)), rng.normal(size=4), rng.normal(size=(4, 4))
    covariance = root @ root.T - 1e-14 * np.eye(4)
    found = covariance_root(covariance)
    np.testing.assert_allclose(found @ found.T, covariance, atol=1e-12)
    square = np.trace(weight @ (covariance + np.outer(mean, mean)))
    assert expected_distance(weight, mean, covariance) == pytest.approx(square, rel=1e-12)


@pytest.mark.parametrize(
    ("H", "y", "R"),
    [
        (np.ones((1, 3)), np.ones(1), np.eye(1)),
        (np.ones((2, 2)), np.ones(1), np.eye(2)),
        (np.ones((2, 2)), np.ones(2), np.eye(1)),
        (np.ones((1, 2)), np.ones((1, 1)), np.eye(1)),
    ],
)
def test_condition_refuses_shapes_that_do_not_fit(H, y, R):
    with pytest.raises(ShapeError, match=r"observation: expected .*got .*one row per observed"):
        condition(Gaussian(np.zeros(2), np.eye(2)), H, y, R)


def test_condition_refuses_a_noise_that_is_not_positive_definite():
    H = np.array([[1.0, 0.0], [1.0, 0.0]])
    with pytest.raises(ArgumentError, match=r"innovation covariance: .*raise the noise variance"):
        condition(Gaussian(np.zeros(2), np.eye(2)), H, np.zeros(2), np.zeros((2, 2)))


def positive_definite(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Random positive definite matrices (..., d, d)."""
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2) + np.eye(shape[-1])


def test_cholesky_refuses_an_indefinite_matrix_and_says_how_far_off_it_is():
    with pytest.raises(ArgumentError, match=r"innovation: .*positive definite.*-1.*noise variance"):
        cholesky(np.diag([1.0, -1.0]), name="innovation")


@pytest.mark.parametrize("d", [1, 2, 3, 7])
def test_cholesky_refuses_nan(d):
    matrix = np.eye(d)
    matrix[-1, -1] = np.nan
    with pytest.raises(ArgumentError):
        cholesky(matrix)


def test_solve_lower_reads_only_the_lower_triangle(rng):
    factor = np.linalg.cholesky(positive_definite(rng, 4))
    right = rng.normal(size=(4, 2))
    spoiled = factor + np.triu(np.full((4, 4), np.nan), 1)
    assert np.array_equal(solve_lower(spoiled, right), solve_lower(factor, right))


def test_the_log_of_a_sum_is_that_of_numpy_where_terms_vanish_or_are_large():
    terms = np.array([[-1e4, -1e4 - 1.0], [-np.inf, 0.5], [-np.inf, -np.inf], [800.0, 1.0]])
    np.testing.assert_allclose(log_sum(terms), np.logaddexp.reduce(terms, axis=-1), rtol=1e-12)


@pytest.mark.slow
@given(seeds, st.integers(1, 6), st.one_of(st.floats(0.5, 200.0), st.just(np.inf)))
def test_student_density_is_scipy_s_and_the_normal_one_for_infinite_freedom(seed, d, freedom):
    rng = np.random.default_rng(seed)
    scale, mean = positive_definite(rng, d), rng.normal(size=d)
    values = 5.0 * rng.normal(size=(4, d))
    factor = np.linalg.cholesky(scale)
    whitened = solve_triangular(factor, (values - mean).T, lower=True)
    squares = np.sum(whitened**2, axis=0)
    found = student_log_density(squares, half_log_det(factor), d, freedom)
    normal = multivariate_normal(mean, scale)
    expected = normal if np.isinf(freedom) else multivariate_t(mean, scale, df=freedom)
    np.testing.assert_allclose(found, expected.logpdf(values), rtol=1e-9, atol=1e-9)
