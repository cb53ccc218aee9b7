# SPDX-License-Identifier: Apache-2.0
"""What a library derives from what it holds."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library


def test_sizes_and_blocks(rng):
    library = make_library(rng, n_tasks=3, groups=(2, 1), n_controlled=2, n_basis=5)
    assert (library.n_tasks, library.n_observed, library.n_controlled) == (3, 3, 2)
    assert library.n_observed_weights == 15
    assert library.observed_mean.shape == (4, 15)
    assert library.observed_covariance.shape == (4, 15, 15)
    assert np.array_equal(library.observed_mean[-1], library.none_mean)
    assert np.array_equal(library.observed_mean[1], library.weight_mean[1, :15])
    assert np.array_equal(library.observed_covariance[2], library.weight_covariance[2, :15, :15])
    assert library.observed_dofs(0).tolist() == [0, 1]
    assert library.observed_dofs(1).tolist() == [2]
    np.testing.assert_allclose(library.durations_s, 2.0)


def test_recovery_splits_the_joint_covariance_exactly(rng):
    library = make_library(rng, n_tasks=2, groups=(2,), n_controlled=2, n_basis=5)
    split = library.n_observed_weights
    for task, (matrix, offset, rest) in enumerate(library.regressions):
        mean, covariance = library.primitive(task).weights
        s_oo = covariance[:split, :split]
        np.testing.assert_allclose(matrix @ s_oo, covariance[split:, :split], atol=1e-10)
        np.testing.assert_allclose(
            rest + matrix @ s_oo @ matrix.T, covariance[split:, split:], atol=1e-10
        )
        np.testing.assert_allclose(matrix @ mean[:split] + offset, mean[split:], atol=1e-10)


@given(st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
def test_dense_samples_together_are_worth_one_sample_per_correlation_time(correlation, interval):
    """Information per second never exceeds one sample's per correlation time."""
    library = make_library(np.random.default_rng(1), n_basis=4, correlation_time_s=correlation)
    one = library.noise_covariance(np.arange(3), np.inf)
    crowded = library.noise_covariance(np.arange(3), interval)
    np.testing.assert_allclose(one, np.diag(library.noise_variance[:3]))
    rate = 1.0 / (np.diag(crowded) * interval)
    assert np.all(rate <= (1.0 / (np.diag(one) * correlation)) * (1 + 1e-9))
    assert np.all(np.diag(crowded) >= np.diag(one))


def test_two_samples_at_the_same_time_do_not_divide_by_zero(rng):
    library = make_library(rng, n_basis=4, correlation_time_s=0.05)
    assert np.all(np.isfinite(library.noise_covariance(np.arange(3), 0.0)))
