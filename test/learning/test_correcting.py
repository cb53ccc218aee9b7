# SPDX-License-Identifier: Apache-2.0
"""How much a kept correction counts, and what it changes."""

from dataclasses import replace

import numpy as np
import pytest
from model_builder import make_dofs, perform, true_library
from simulation import gathered, make_library

from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.learning import (
    TrainingSettings,
    inferred_weights,
    keep_correction,
    sample_phases,
    summarize,
)
from intent_recognition.learning.correcting import (
    DRIFT,
    OFFSET_VARIANCE,
    SLOPE_VARIANCE,
    correction_gain,
    place_scale,
)
from intent_recognition.promp import PoseRegression

TRUTH = true_library(make_dofs())


def test_the_gain_is_that_of_one_regression_on_all_corrections():
    """Against the joint Gaussian of all corrections at once."""
    rng = np.random.default_rng(0)
    places = rng.normal(size=(4, 3))
    offset = OFFSET_VARIANCE + DRIFT * np.minimum.outer(np.arange(4), np.arange(4))
    covariance = offset + SLOPE_VARIANCE * places @ places.T + np.eye(4)
    last = np.vstack([offset[3], SLOPE_VARIANCE * places.T])  # of the last offset and slopes
    residuals = rng.normal(size=4)
    drift = np.zeros(4)
    for k in range(4):
        x = np.r_[1.0, places[k]]
        drift += correction_gain(places[: k + 1]) * (residuals[k] - x @ drift)
    np.testing.assert_allclose(drift, last @ np.linalg.solve(covariance, residuals), rtol=1e-9)


def test_each_kind_of_unit_counts_in_proportion_to_its_dofs(rng):
    library = replace(make_library(rng, groups=(2, 1)), observed_units=("m", "m", "px"))
    variance = np.diag(library.weight_covariance[1])[: library.n_observed_weights]
    scaled = (variance / place_scale(library, 1) ** 2).reshape(3, -1)
    assert scaled[:2].sum() == pytest.approx(2 / 3) and scaled[2].sum() == pytest.approx(1 / 3)


@pytest.fixture(scope="module")
def trained():
    recordings = [perform(TRUTH, task, 10 * task + k) for k in range(6) for task in (0, 1)]
    settings = TrainingSettings(n_basis=10, n_aligned_basis=12)
    trained = gathered(recordings, settings)
    return replace(trained, library=replace(trained.library, none_margin=3.0))


def test_weights_are_inferred_with_the_noise_of_the_samples_that_the_filter_uses(trained):
    library, example = trained.library, [*trained.tasks.values()][1].examples[0]
    rows = library.basis.design_matrix(sample_phases())
    matrix = np.vstack([np.kron(np.eye(library.n_observed), row) for row in rows])
    noise = 2.0 * library.noise_scale * library.noise_variance[: library.n_observed]
    prior = Gaussian(library.observed_mean[1], library.observed_covariance[1])
    spread = np.diag(np.tile(noise, len(rows)))
    expected, _ = condition(prior, matrix, example.observed.ravel(), spread)
    np.testing.assert_allclose(inferred_weights(trained, example), expected.mean, atol=1e-8)


def moved(recording, offset):
    """The recording, the robot elsewhere."""
    (robot,) = recording.controlled
    return replace(recording, controlled=(replace(robot, values=robot.values + offset),))


@pytest.mark.slow
def test_person_and_other_tasks_stay_to_the_last_bit_and_the_statistics_go_along(trained):
    offset = np.linspace(0.3, -0.2, 7)
    kept = [moved(perform(TRUTH, 0, seed), offset) for seed in (70, 71, 72)]
    regression = PoseRegression(*(np.full((2, 1), 1.0) for _ in range(6)))
    after = replace(trained, library=replace(trained.library, pose_regression=regression))
    for k, one in enumerate(kept):
        after = keep_correction(after, one, kept[:k])
    first, last = trained.library, after.library
    task, n = first.labels.index(kept[0].task), first.n_observed_weights
    for name in ("observed_mean", "observed_covariance", "noise_variance", "none_margin"):
        assert np.array_equal(getattr(first, name), getattr(last, name)), name
    assert np.array_equal(first.weight_mean[1 - task], last.weight_mean[1 - task])
    assert np.array_equal(first.weight_covariance[1 - task], last.weight_covariance[1 - task])
    assert last.pose_regression.share.ravel().tolist() == [float(k != task) for k in range(2)]
    before, now = first.regressions[task], last.regressions[task]
    np.testing.assert_allclose(now.covariance, before.covariance, atol=1e-9)
    assert np.abs(now.matrix - before.matrix).max() > 1e-3
    shift = last.basis.design_matrix(np.ones(1)) @ (
        (last.weight_mean - first.weight_mean)[task, n:].reshape(7, -1).T
    )
    np.testing.assert_allclose(shift[0], offset, atol=0.05)
    earlier, statistics = (each.tasks[kept[0].task] for each in (trained, after))
    for own, were in ((statistics, earlier), (statistics.aligned, earlier.aligned)):
        for one, was in zip(own.examples, were.examples, strict=True):
            np.testing.assert_allclose((one.controlled - was.controlled)[-1], offset, atol=0.05)
        expected = summarize(own.examples)
        for name in ("mean", "scatter", "lowest", "highest"):
            np.testing.assert_allclose(getattr(own, name), getattr(expected, name), atol=1e-7)
