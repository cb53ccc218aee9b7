# SPDX-License-Identifier: Apache-2.0
"""Factors, solves and log determinants against numpy and scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_triangular
from scipy.stats import multivariate_normal, multivariate_t

from intent_recognition.errors import ArgumentError
from intent_recognition.gaussian.linalg import (
    cholesky,
    half_log_det,
    solve_lower,
    student_log_density,
    symmetrize,
)

seeds = st.integers(0, 2**32 - 1)


def positive_definite(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Random positive definite matrices (..., d, d)."""
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2) + np.eye(shape[-1])


@given(seeds, st.integers(1, 6))
def test_symmetrize_is_exact_and_idempotent(seed, d):
    matrix = np.random.default_rng(seed).normal(size=(3, d, d))
    once = symmetrize(matrix)
    assert np.array_equal(once, np.swapaxes(once, -1, -2))
    assert np.array_equal(symmetrize(once), once)
    np.testing.assert_allclose(np.trace(once, axis1=1, axis2=2), np.trace(matrix, axis1=1, axis2=2))


@given(seeds, st.integers(1, 6))
def test_cholesky_factor_multiplies_back_and_adds_no_jitter(seed, d):
    matrix = positive_definite(np.random.default_rng(seed), 4, d)
    factor = cholesky(matrix)
    np.testing.assert_allclose(factor @ np.swapaxes(factor, -1, -2), matrix, rtol=1e-12, atol=1e-12)
    assert np.array_equal(np.triu(factor, 1), np.zeros_like(factor))


def test_cholesky_refuses_an_indefinite_matrix_and_says_how_far_off_it_is():
    with pytest.raises(ArgumentError, match=r"innovation: .*positive definite.*-1.*noise variance"):
        cholesky(np.diag([1.0, -1.0]), name="innovation")


def test_cholesky_refuses_one_bad_matrix_in_a_batch():
    with pytest.raises(ArgumentError):
        cholesky(np.stack([np.eye(2), np.zeros((2, 2)), np.eye(2)]))


@pytest.mark.parametrize("d", [1, 2, 3, 7])
def test_cholesky_refuses_nan(d):
    matrix = np.eye(d)
    matrix[-1, -1] = np.nan
    with pytest.raises(ArgumentError):
        cholesky(matrix)


@given(seeds, st.integers(1, 6), st.integers(1, 5))
def test_solve_lower_equals_scipy_on_a_batch(seed, d, k):
    rng = np.random.default_rng(seed)
    factor = np.linalg.cholesky(positive_definite(rng, 5, d))
    right = rng.normal(size=(5, d, k))
    expected = [solve_triangular(one, b, lower=True) for one, b in zip(factor, right, strict=True)]
    np.testing.assert_allclose(solve_lower(factor, right), expected, rtol=1e-9, atol=1e-9)


def test_solve_lower_broadcasts_one_factor_over_many_right_sides(rng):
    factor = np.linalg.cholesky(positive_definite(rng, 3))
    right = rng.normal(size=(6, 3, 2))
    np.testing.assert_allclose(factor @ solve_lower(factor, right), right, atol=1e-12)


def test_solve_lower_reads_only_the_lower_triangle(rng):
    factor = np.linalg.cholesky(positive_definite(rng, 4))
    right = rng.normal(size=(4, 2))
    spoiled = factor + np.triu(np.full((4, 4), np.nan), 1)
    assert np.array_equal(solve_lower(spoiled, right), solve_lower(factor, right))


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
