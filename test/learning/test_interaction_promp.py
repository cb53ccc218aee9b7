# SPDX-License-Identifier: Apache-2.0
"""The interaction primitive fitted to demonstrations of one task."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import make_library, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.learning import accumulate, fit_interaction_promp, library_from_statistics
from intent_recognition.learning.hyperparameters import REGRESSION_STRENGTHS, Hyperparameters
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.promp.basis import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(8, 1.0)


@pytest.fixture
def truth(rng):
    return make_library(rng, n_tasks=2, n_basis=8, noise_std=0.002)


def test_it_is_what_learning_makes_of_one_task(truth, rng):
    recordings = [simulate(truth, 0, rng, name=f"demo_{k}") for k in range(6)]
    settings = TrainingSettings(n_basis=8, segmentation="recording")
    data = accumulate(recordings, settings)
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters())
    found = fit_interaction_promp(recordings, basis=BASIS, strength=REGRESSION_STRENGTHS[0])
    expected = library.primitive(0)
    np.testing.assert_allclose(found.weights.mean, expected.weights.mean, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        found.weights.covariance, expected.weights.covariance, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(found.noise_variance, expected.noise_variance, rtol=1e-12)
    assert found.duration_s == pytest.approx(expected.duration_s)
    assert (found.n_observed, found.basis) == (expected.n_observed, expected.basis)


def test_what_cannot_be_fitted(truth, rng):
    one, other = simulate(truth, 0, rng), simulate(truth, 1, rng)
    with pytest.raises(TrainingError, match="two or more"):
        fit_interaction_promp([one], basis=BASIS)
    with pytest.raises(ArgumentError, match="task of demo"):
        fit_interaction_promp([one, other], basis=BASIS)
    with pytest.raises(ArgumentError, match="strength"):
        fit_interaction_promp([one, one], basis=BASIS, strength=0.0)
    with pytest.raises(TrainingError, match="signals of both agents, got signals of one agent"):
        fit_interaction_promp([replace(one, controlled=())] * 2, basis=BASIS)
    fewer = make_library(rng, n_controlled=1, n_basis=8)
    with pytest.raises(ArgumentError, match="controlled DOFs"):
        fit_interaction_promp([one, simulate(fewer, 0, rng)], basis=BASIS)
