# SPDX-License-Identifier: Apache-2.0
"""The left-out prediction against formulas written out, and the number of components it chooses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_t
from scipy.stats import t as student
from simulation import draw_weights, make_library

from intent_recognition.errors import ArgumentError
from intent_recognition.learning import choose_components, smallest_within_one_error
from intent_recognition.learning.components import predict_left_out, purity, score, try_components
from intent_recognition.learning.mixture import leave_each_out, mixture_features
from intent_recognition.promp.basis import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(10, 1.0)


def drawn(rng, n_each):
    library = make_library(rng, n_tasks=len(n_each), spread=0.02)
    tasks = np.repeat(np.arange(len(n_each)), n_each)
    weights = np.array([draw_weights(library, task, rng) for task in tasks])
    return mixture_features(weights, 3, BASIS), tasks


def test_predictions_are_those_of_student_distributions_written_out(rng):
    features, tasks = drawn(rng, (5, 4))
    prior, split = features.prior, features.n_observed
    left_out = leave_each_out(features.coordinates, tasks, 2, prior)
    found = predict_left_out(features, left_out, prior)
    nll, rmse = score(found, features.controlled)
    covariances = left_out.covariance(features.coordinates)
    for i in (0, 6):
        point, evidence, densities, means = features.coordinates[i], [], [], []
        for k in range(2):
            count, mean = left_out.count[i, k], left_out.mean[i, k]
            freedom = prior.strength + count + 1
            shape = covariances[i, k] * (count + prior.strength) * (1 + 1 / count) / freedom
            oo, oc, cc = shape[:split, :split], shape[:split, split:], shape[split:, split:]
            evidence.append(
                left_out.log_weight[i, k]
                + multivariate_t(mean[:split], oo, df=freedom).logpdf(point[:split])
            )
            gain = np.linalg.solve(oo, oc).T
            error = point[:split] - mean[:split]
            distance = error @ np.linalg.solve(oo, error)
            conditional = (cc - gain @ oc) * (freedom + distance) / (freedom + split)
            predicted = (mean[split:] + gain @ error) @ features.loadings
            scale = np.sqrt(np.diag(features.loadings.T @ conditional @ features.loadings))
            truth = features.controlled[i]
            densities.append(student(freedom + split, predicted, scale).logpdf(truth).mean())
            means.append(predicted)
        posterior = np.array(evidence) - np.logaddexp.reduce(evidence)
        np.testing.assert_allclose(found.log_posterior[i], posterior, atol=1e-8)
        expected = -np.logaddexp.reduce(posterior + densities)
        offset = 0.5 * np.log(features.controlled.shape[1])
        assert nll[i] == pytest.approx(expected + offset, abs=1e-8)
        error = np.exp(posterior) @ np.array(means) - features.controlled[i]
        assert rmse[i] == pytest.approx(np.linalg.norm(error), abs=1e-9)


@pytest.mark.parametrize("n_each", [(12,), (8, 7), (8, 7, 6), (7, 7, 7, 7)])
def test_the_number_of_tasks_is_found(n_each):
    features, tasks = drawn(np.random.default_rng(sum(n_each)), n_each)
    choice = choose_components(features, np.random.default_rng(0), max_components=6)
    assert choice.n_components == len(n_each)
    assert purity(tasks, choice.chosen.labels) == 1.0
    assert [tried.n_components for tried in choice.tried] == list(range(1, len(choice.tried) + 1))


def test_progress_is_told_and_numbers_that_make_no_sense_are_refused(rng):
    told = []
    features, _ = drawn(rng, (4, 4))
    choose_components(features, np.random.default_rng(0), progress=told.append)
    assert told == [1, 2]  # 8 demonstrations: components of at least three
    features, _ = drawn(rng, (5,))
    for n_components in (0, 6):
        with pytest.raises(ArgumentError, match="n_components"):
            try_components(features, n_components, np.random.default_rng(0))
    assert try_components(features, 5, np.random.default_rng(0)).labels.shape == (5,)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_few_demonstrations_or_a_robot_that_does_the_same_are_one_component(n):
    features, _ = drawn(np.random.default_rng(n), (n,))
    choice = choose_components(features, np.random.default_rng(0))
    assert choice.n_components == 1 and len(choice.tried) == 1
    weights = np.random.default_rng(n).normal(size=(n + 5, 4, 10))
    weights[:, 3] = 1.0
    choice = choose_components(mixture_features(weights, 3, BASIS), np.random.default_rng(0))
    assert choice.n_components == 1 and not choice.chosen.nll.any()


def test_the_smallest_within_one_paired_error():
    noise = np.array([3.0, -3.0, 2.0, -2.0])
    scores = np.array([5.0 + noise, 1.05 + noise, 1.0 + noise, 1.2 + noise])
    scores[1] -= [0.35, -0.15, 0.0, 0.0]  # differences scatter, whatever is common to all
    assert smallest_within_one_error(scores) == 1
    scores[1] = 1.05 + noise
    assert smallest_within_one_error(scores) == 2
    assert smallest_within_one_error(scores[:1]) == 0
    apart = np.array([0.3 + 0.2 * noise, 0.0 * noise])  # by 1.02 standard errors
    assert smallest_within_one_error(apart) == 1


@given(st.lists(st.integers(0, 3), min_size=1, max_size=20), st.integers(0, 10))
def test_purity_is_one_for_the_labels_and_never_less_than_the_largest_share(labels, seed):
    components = np.random.default_rng(seed).integers(0, 3, size=len(labels))
    assert purity(labels, np.array(labels)) == 1.0
    assert purity(labels, np.zeros(len(labels))) == np.bincount(labels).max() / len(labels)
    assert purity(labels, components) >= np.bincount(labels).max() / len(labels)
