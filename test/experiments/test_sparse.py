# SPDX-License-Identifier: Apache-2.0
"""The experiments on sparse and noisy observations: their parts, and that they run and repeat."""

import numpy as np
import pytest

from experiments.noise import experiment as noise
from experiments.noise.study import DMP, DMP_CARRIED, PROMP
from experiments.settings import Settings
from experiments.sketches.curves import PHASE, sketch_pairs
from experiments.sketches.differentiation import SavitzkyGolay
from experiments.sketches.models import (
    ModelChoice,
    learn_dmp,
    learn_promp,
    observation,
    prior,
    squared_errors,
)
from experiments.sparse import experiment as sparse
from experiments.sparse.conditioning import promp_curves

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture(scope="module")
def pairs():
    return sketch_pairs(np.random.default_rng(6), 40)


@pytest.fixture(scope="module")
def sparse_outcome():
    return sparse.run(Settings(quick=True))


@pytest.fixture(scope="module")
def noise_outcome():
    return noise.run(Settings(quick=True))


def test_white_noise_keeps_the_variances_of_the_derivatives(pairs):
    smoother = SavitzkyGolay(0.2)
    learned = learn_dmp(pairs, smoother)
    _, white, _ = observation(learned, ModelChoice(0.1, 0.01, smoother), 30)
    _, carried, _ = observation(learned, ModelChoice(0.1, 0.01, smoother, white=False), 30)
    np.testing.assert_allclose(np.diag(white), np.diag(carried))
    assert np.count_nonzero(white - np.diag(np.diag(white))) == 0
    assert np.count_nonzero(carried) > 30 * 30


def test_noise_carried_through_an_invertible_filter_loses_nothing(pairs, rng):
    """Any invertible linear map of the observations leaves the posterior as it is."""
    learned = learn_promp(pairs)
    distribution = prior(learned.parameters, 0.1)
    rows, noise_covariance, _ = observation(learned, ModelChoice(0.1, 0.01), 30)
    seen = rows @ distribution.mean + 0.1 * rng.normal(size=30)
    mixed = rng.normal(size=(30, 30)) + 5.0 * np.eye(30)
    from experiments.sketches.models import predictor

    matrix, offset = predictor(distribution, rows, noise_covariance, learned.controlled)
    other, shift = predictor(
        distribution, mixed @ rows, mixed @ noise_covariance @ mixed.T, learned.controlled
    )
    np.testing.assert_allclose(other @ mixed @ seen + shift, matrix @ seen + offset, atol=1e-6)


def test_errors_are_those_of_single_predictions(pairs):
    candidate = ModelChoice(0.03, 0.01)
    learned = learn_promp(pairs[:30])
    held = pairs[30:]
    found = squared_errors(pairs[:30], held[..., 1], held[None, ..., 0], [candidate], [40])
    squares = [np.mean((_curves(learned, pair, 40)[1] - pair[:, 1]) ** 2) for pair in held]
    np.testing.assert_allclose(found[0, 0, 0], np.mean(squares), rtol=1e-6)


def _curves(learned, pair, n_seen):
    curves, _ = promp_curves(learned, 0.03, PHASE[:n_seen], pair[:n_seen, 0], 0.01)
    return curves


def test_bands_hold_about_what_they_should(sparse_outcome):
    inside = np.array(sparse_outcome.numbers["inside_two_sigma"])
    assert np.all((inside > 0.85) & (inside < 1.0))


def test_positions_say_more_than_splines(sparse_outcome):
    rmse = sparse_outcome.numbers["rmse"]
    assert rmse["ProMP"][0] < rmse["DMP, best smoothing spline"][0] < rmse["no observation"][0]


def test_the_dmp_is_no_straw_man(noise_outcome):
    rmse = {method: np.array(values) for method, values in noise_outcome.numbers["rmse"].items()}
    assert rmse[DMP][0, -1] < 1.25 * rmse[PROMP][0, -1]
    assert np.all(rmse[PROMP][1] <= 1.02 * rmse[DMP][1])
    assert np.all(rmse[DMP_CARRIED] < 1.1 * rmse[PROMP])
    assert rmse["DMP without a filter"][1, -1] > 2.0 * rmse[DMP][1, -1]
