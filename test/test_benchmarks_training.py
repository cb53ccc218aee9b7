# SPDX-License-Identifier: Apache-2.0
"""What is timed against movement_primitives does the same work."""

import numpy as np
import pytest

pytest.importorskip("movement_primitives")

from benchmarks import training
from intent_recognition.promp.basis import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(8, 1.0)
PHASE = np.linspace(0.0, 1.0, 30)


def test_moments_are_those_that_training_keeps():
    values = training.aligned_trajectories(BASIS, PHASE)
    mean, covariance = training.weight_moments(BASIS, PHASE, values)
    kept = training._statistics(BASIS, [training._demonstration(PHASE, each) for each in values])
    np.testing.assert_allclose(kept.mean.ravel(), mean, atol=1e-6)
    np.testing.assert_allclose(kept.scatter / (kept.n - 1), covariance, atol=1e-6)


def test_both_find_the_mean_trajectory():
    values = training.aligned_trajectories(BASIS, PHASE)[:6]
    mean, _ = training.weight_moments(BASIS, PHASE, values)
    ours = BASIS.design_matrix(PHASE) @ mean.reshape(training.N_DOFS, -1).T
    peer = training._imitate(8, np.repeat(PHASE[None], 6, axis=0), values)
    theirs = peer.mean_trajectory(PHASE)
    spread = values.std()
    assert np.abs(ours - values.mean(axis=0)).max() < 0.1 * spread
    assert np.abs(theirs - values.mean(axis=0)).max() < 0.3 * spread
