# SPDX-License-Identifier: Apache-2.0
"""The covariance that deviations of timing add: against movements that are early or late."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.learning.timing import (
    mean_timing_covariance,
    timing_covariance,
    unshown_timing_covariance,
)
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.phase_deviation import STEADY, PhaseDeviation

BASIS = NormalizedRBFBasis(20)
PHASE = np.linspace(0.05, 0.95, 19)


def smooth_weights(rng) -> np.ndarray:
    """Weights of two DOFs that move as people do, (2 N,)."""
    amplitude = rng.normal(size=(2, 3))
    paths = amplitude @ np.sin(np.pi * np.outer([0.5, 1.0, 1.5], np.linspace(0.0, 1.0, 101)))
    design = BASIS.design_matrix(np.linspace(0.0, 1.0, 101))
    return np.linalg.lstsq(design, paths.T, rcond=None)[0].T.ravel()


@given(st.integers(0, 2**32 - 1), st.floats(0.001, 0.2), st.floats(0.05, 2.0))
def test_it_is_symmetric_and_positive_semidefinite(seed, deviation_std, correlation):
    mean = smooth_weights(np.random.default_rng(seed))
    phase_deviation = PhaseDeviation(np.full(5, deviation_std), correlation, 1.0)
    found = timing_covariance(BASIS, mean, phase_deviation)
    assert found.shape == (40, 40)
    assert found == pytest.approx(found.T, abs=1e-12 * np.abs(found).max())
    eigenvalues = np.linalg.eigvalsh(found)
    assert eigenvalues.min() > -1e-9 * eigenvalues.max()


def test_it_is_the_spread_of_movements_that_are_early_or_late():
    rng = np.random.default_rng(5)
    mean, deviation_std = smooth_weights(rng), 0.01
    deviation = deviation_std * rng.normal(size=4000)
    shifted = BASIS.design_matrix(PHASE + deviation[:, None])
    for dof in (0, 1):
        block = slice(20 * dof, 20 * dof + 20)
        phase_deviation = PhaseDeviation(np.full(2, deviation_std), 1e9, 1.0)
        covariance = timing_covariance(BASIS, mean, phase_deviation)[block, block]
        design = BASIS.design_matrix(PHASE)
        found = design @ covariance @ design.T
        expected = np.cov((shifted @ mean[block]).T)
        assert found == pytest.approx(expected, abs=0.1 * np.abs(expected).max())


def test_steady_progress_adds_nothing():
    mean = smooth_weights(np.random.default_rng(1))
    assert not np.any(timing_covariance(BASIS, mean, STEADY))


def test_deviations_far_apart_have_little_to_do_with_each_other():
    mean = smooth_weights(np.random.default_rng(2))
    found = timing_covariance(BASIS, mean, PhaseDeviation(np.full(2, 0.1), 0.4, 1.0))
    spread = np.sqrt(np.diag(found))
    correlation = np.abs(found / np.outer(spread, spread))
    assert correlation[3, 11] == pytest.approx(np.exp(-8.0 / 19.0 / 0.4))
    assert correlation[3, 23] == pytest.approx(1.0)


def test_half_of_each_deviation_is_added_half_the_tasks_own_and_half_of_all():
    rng = np.random.default_rng(3)
    means = [smooth_weights(rng) for _ in range(3)]
    full, half = (
        PhaseDeviation(np.full(2, deviation_std), 0.4, 1.0) for deviation_std in (0.02, 0.01)
    )
    shared = mean_timing_covariance(BASIS, means, full)
    found = [
        unshown_timing_covariance(timing_covariance(BASIS, mean, full), shared) for mean in means
    ]
    own = [timing_covariance(BASIS, mean, half) for mean in means]
    expected = [0.5 * one + 0.5 * (own[0] + own[1] + own[2]) / 3.0 for one in own]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)
