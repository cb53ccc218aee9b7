# SPDX-License-Identifier: Apache-2.0
"""The bank of observed weights against a full-state Kalman filter, and its grid of durations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import t
from simulation import make_library

from intent_recognition.filtering.grid import STUDENT_FREEDOM, make_prior_grid

seeds = st.integers(0, 2**32 - 1)


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
