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
    predictor,
    prior,
    squared_errors,
)
from experiments.sparse import experiment as sparse
from experiments.sparse.conditioning import promp_curves

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


@pytest.fixture(scope="module")
def pairs():
    return sketch_pairs(np.random.default_rng(6), 40)


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
    squares = []
    for pair in held:
        curves, _ = promp_curves(learned, 0.03, PHASE[:40], pair[:40, 0], 0.01)
        squares.append(np.mean((curves[1] - pair[:, 1]) ** 2))
    np.testing.assert_allclose(found[0, 0, 0], np.mean(squares), rtol=1e-6)


def test_bands_hold_about_what_they_should_and_positions_say_more_than_splines():
    numbers = sparse.run(Settings(quick=True)).numbers
    inside, rmse = np.array(numbers["inside_two_sigma"]), numbers["rmse"]
    assert np.all((inside > 0.85) & (inside < 1.0))
    assert rmse["ProMP"][0] < rmse["DMP, best smoothing spline"][0] < rmse["no observation"][0]


def test_the_dmp_is_no_straw_man():
    numbers = noise.run(Settings(quick=True)).numbers
    rmse = {method: np.array(values) for method, values in numbers["rmse"].items()}
    assert rmse[DMP][0, -1] < 1.25 * rmse[PROMP][0, -1]
    assert np.all(rmse[PROMP][1] <= 1.02 * rmse[DMP][1])
    assert np.all(rmse[DMP_CARRIED] < 1.1 * rmse[PROMP])
    assert rmse["DMP without a filter"][1, -1] > 2.0 * rmse[DMP][1, -1]
