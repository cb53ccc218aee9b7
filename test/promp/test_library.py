# SPDX-License-Identifier: Apache-2.0
"""What a library derives from what it holds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library

from intent_recognition.gaussian.normal import regression
from intent_recognition.promp.coupling import residual_weights
from intent_recognition.promp.regressions import N_KEPT


@given(st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
def test_dense_samples_are_worth_one_sample_per_correlation_time(correlation, interval):
    """Information per second never exceeds one sample's per correlation time."""
    library = make_library(np.random.default_rng(1), n_basis=4, correlation_time_s=correlation)
    one = library.noise_covariance(np.arange(3), np.inf)
    crowded = library.noise_covariance(np.arange(3), interval)
    np.testing.assert_allclose(one, np.diag(library.noise_variance[:3]))
    rate = 1.0 / (np.diag(crowded) * interval)
    assert np.all(rate <= (1.0 / (np.diag(one) * correlation)) * (1 + 1e-9))
    assert np.all(np.diag(crowded) >= np.diag(one))
    assert np.all(np.isfinite(library.noise_covariance(np.arange(3), 0.0)))


def test_uncertain_coefficients_widen_what_is_far_from_the_demonstrations(rng):
    """Against draws of the coefficients, and of observed weights that are known by and large."""
    library = replace(make_library(rng, n_basis=4, groups=(2,)), regression_variance=0.08)
    matrix, _, left = library.regressions[1]
    size, n = library.n_observed_weights, 200_000
    usual, joint = library.weight_mean[1, :size], library.weight_covariance[1, :size, :size]
    spread = 0.3 * joint
    place = usual + 2.0 * np.linalg.cholesky(joint) @ rng.normal(size=size)
    apart = rng.multivariate_normal(place - usual, spread, size=n)
    coefficients = rng.normal(size=(n, *matrix.shape))
    coefficients = np.linalg.cholesky(left) @ coefficients
    coefficients = coefficients @ np.linalg.cholesky(0.08 * np.linalg.inv(joint)).T
    residuals = np.einsum("nqp,np->nq", coefficients, apart)
    residuals += rng.multivariate_normal(np.zeros(len(left)), left, size=n)
    found = library.regressions.uncertainty(1, place, spread)
    np.testing.assert_allclose(residuals.var(axis=0), found * np.diag(left), rtol=0.02)
    certain = replace(library, regression_variance=0.0).regressions
    np.testing.assert_array_equal(certain.uncertainty(1, place, spread), 1.0)


def test_every_task_s_regression_is_there_and_few_stay_in_memory(rng):
    library = make_library(rng, n_tasks=3 * N_KEPT, n_basis=4)
    regressions = library.regressions
    for task in range(library.n_tasks):
        found = regressions[task]
        expected = regression(library.primitive(task).weights, library.n_observed_weights)
        for a, b in zip(found, expected, strict=True):
            assert np.array_equal(a, b)
        assert regressions[task] is found
        regressions[0]  # one that is asked for again and again stays
    assert len(regressions._kept) == N_KEPT
    assert 0 in regressions._kept


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_expected_residual_is_the_conditional_mean_of_the_process(rng, n):
    seen = np.sort(rng.uniform(0.0, 2.0, size=n))
    times = np.r_[-0.3, rng.uniform(0.0, 2.0, size=9), seen, 2.4, 90.0]
    covariance = np.exp(-np.abs(seen[:, None] - seen) / 0.3)
    cross = np.exp(-np.abs(times[:, None] - seen) / 0.3)
    expected = np.linalg.solve(covariance, cross.T).T
    weights, known = residual_weights(seen, times, 0.3)
    np.testing.assert_allclose(weights, expected, atol=1e-9)
    np.testing.assert_allclose(known, np.sum(expected * cross, axis=1), atol=1e-9)
