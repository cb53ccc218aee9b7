# SPDX-License-Identifier: Apache-2.0
"""The bank of observed weights against a full-state Kalman filter, and its grid of durations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import Bank, condition_bank, start_bank
from scipy.stats import t
from simulation import make_library

from intent_recognition.errors import ShapeError
from intent_recognition.filtering.grid import STUDENT_FREEDOM, fixed_prior_grid, make_prior_grid

seeds = st.integers(0, 2**32 - 1)


def test_observed_block_and_regression_equal_a_full_state_kalman_filter(rng):
    """The reduction of Maeda et al. 2014 to P N states loses nothing of the (P + Q) N."""
    library = make_library(rng, n_tasks=2, groups=(2,), n_controlled=2, n_basis=8)
    hypotheses = fixed_prior_grid(library, 2.0)
    bank = start_bank(library, hypotheses)
    split, total = library.n_observed_weights, library.weight_mean.shape[1]
    mean, covariance = library.weight_mean.copy(), library.weight_covariance.copy()
    noise = np.diag(library.noise_variance[:2])
    for phase in np.sort(rng.uniform(size=12)):
        row = library.basis.design_matrix(np.array([phase]))
        y = rng.normal(size=2) * 0.1
        H = np.zeros((2, total))
        H[0, :8] = H[1, 8:16] = row[0]
        for task in range(2):
            P = covariance[task]
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + noise)
            mean[task] += K @ (y - H @ mean[task])
            # The Joseph form, another algebra than the one under test.
            left = np.eye(total) - K @ H
            covariance[task] = left @ P @ left.T + K @ noise @ K.T
        bank = condition_bank(bank, np.arange(2), row[None], y, noise)
    for task in range(2):
        matrix, offset, rest = library.regressions[task]
        np.testing.assert_allclose(bank.mean[task], mean[task, :split], atol=1e-8)
        np.testing.assert_allclose(
            bank.covariance[task], covariance[task, :split, :split], atol=1e-8
        )
        recovered = matrix @ bank.mean[task] + offset
        np.testing.assert_allclose(recovered, mean[task, split:], atol=1e-8)
        spread = rest + matrix @ bank.covariance[task] @ matrix.T
        np.testing.assert_allclose(spread, covariance[task, split:, split:], atol=1e-8)


@pytest.mark.parametrize(
    ("values", "noise"), [(np.zeros(3), np.eye(2)), (np.zeros(2), np.eye(3)), (0.0, np.eye(2))]
)
def test_shapes_that_do_not_fit_are_named(values, noise):
    bank = Bank(np.zeros((4, 6)), np.tile(np.eye(6), (4, 1, 1)), np.zeros(4))
    with pytest.raises(ShapeError, match=r"values, noise_covariance: expected shapes \(2,\).*Pass"):
        condition_bank(bank, np.arange(2), np.ones((4, 1, 3)), values, noise)


@given(seeds, st.integers(1, 20))
@settings(max_examples=10)
def test_grid_of_durations_covers_the_timing_prior(seed, n_scales):
    library = make_library(np.random.default_rng(seed), n_basis=4)
    hypotheses = make_prior_grid(library, n_scales=n_scales)
    logs = np.log(hypotheses.duration_s).reshape(-1, n_scales)
    weight = np.exp(hypotheses.log_prior).reshape(-1, n_scales)
    assert np.exp(hypotheses.log_prior).sum() == pytest.approx(1.0, abs=1e-12)
    prior = np.r_[library.task_prior * (1 - library.none_prior), library.none_prior]
    np.testing.assert_allclose(weight.sum(axis=1), prior, atol=1e-12)
    spread = library.log_duration_mean[0], library.log_duration_std[0]
    density = t(STUDENT_FREEDOM, *spread).pdf(logs[0])
    np.testing.assert_allclose(weight[0] / weight[0].sum(), density / density.sum(), atol=1e-12)
    mean = (weight * logs).sum(axis=1) / prior
    np.testing.assert_allclose(mean[:-1], library.log_duration_mean, atol=1e-12)
    np.testing.assert_allclose(np.exp(hypotheses.log_task_prior), prior, atol=1e-12)


def test_an_excluded_task_keeps_probability_zero(rng):
    library = make_library(rng, n_basis=4)
    with np.errstate(all="raise"):
        hypotheses = make_prior_grid(library, np.array([0.0, 0.5, 0.5]))
    assert np.all(np.isneginf(hypotheses.log_prior[: hypotheses.n_scales]))
