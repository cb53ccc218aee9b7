# SPDX-License-Identifier: Apache-2.0
"""A mixture of primitives: its coordinates and clusters, left-out predictions, and their number."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_t
from scipy.stats import t as student
from simulation import draw_weights, make_library

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.gaussian.mixture import fit_mixture, one_hot
from intent_recognition.learning import (
    choose_components,
    mixture,
    mixture_features,
    smallest_within_one_error,
)
from intent_recognition.learning.components import predict_left_out, purity, score, try_components
from intent_recognition.learning.mixture import (
    Features,
    cluster,
    leave_each_out,
    left_out_labels,
)
from intent_recognition.promp.basis import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(10, 1.0)


def drawn(rng, n_each=(8, 7, 6)):
    """Weights of demonstrations of a few tasks, (n, D, N), and their tasks."""
    library = make_library(rng, n_tasks=len(n_each), spread=0.02)
    tasks = np.repeat(np.arange(len(n_each)), n_each)
    return np.array([draw_weights(library, task, rng) for task in tasks]), tasks


def same_partition(first, second):
    """Whether two labellings name the same groups."""
    pairs = {(int(a), int(b)) for a, b in zip(first, second, strict=True)}
    return len(pairs) == len(set(first)) == len(set(second))


def test_neither_units_nor_dofs_that_never_move_matter(rng):
    weights, _ = drawn(rng)
    factor = np.array([1000.0, 1.0, 1e-12, 57.3, 0.1])[:, None]
    first = mixture_features(weights, 3, BASIS)
    second = mixture_features(weights * factor + 3.0 * factor, 3, BASIS)
    gram = first.coordinates @ first.coordinates.T
    np.testing.assert_allclose(second.coordinates @ second.coordinates.T, gram, atol=1e-9)
    still = np.insert(weights, 5, 0.3, axis=1)
    first, second = (mixture_features(w, 3, BASIS) for w in (weights, still))
    assert np.all(np.isfinite(second.coordinates))
    assert first.coordinates.shape == second.coordinates.shape


def test_each_agent_counts_alike_and_none_or_too_many_are_refused(rng):
    weights, _ = drawn(rng)
    features = mixture_features(weights, 3, BASIS)
    split = features.n_observed
    for part in (features.coordinates[:, :split], features.coordinates[:, split:]):
        np.testing.assert_allclose(np.sum(part**2), len(weights), rtol=1e-9)
    rebuilt = features.coordinates[:, split:] @ features.loadings
    np.testing.assert_allclose(rebuilt, features.controlled, atol=1e-12)
    for n in (0, mixture.MAX_DEMONSTRATIONS + 1):
        with pytest.raises(TrainingError, match="demonstrations"):
            mixture_features(np.zeros((n, 4, 10)), 2, BASIS)


def test_tasks_are_found_and_numbered_by_size_with_the_same_generator_alike(rng):
    weights, tasks = drawn(rng)
    order = rng.permutation(len(tasks))
    features = mixture_features(weights[order], 3, BASIS)
    found = cluster(features, 3, np.random.default_rng(0))
    assert same_partition(found.labels, tasks[order])
    assert np.bincount(found.labels).tolist() == [8, 7, 6]
    alike = mixture_features(drawn(rng, (6, 6))[0], 3, BASIS)
    assert cluster(alike, 2, np.random.default_rng(0)).labels.tolist() == [0] * 6 + [1] * 6
    first, second = (cluster(features, 4, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(first.labels, second.labels)
    assert first.log_likelihood == second.log_likelihood


@pytest.mark.parametrize("seed", [5, 6, 8])
def test_each_is_assigned_by_the_mixture_without_it_while_that_is_likelier(seed, monkeypatch):
    """Of two clouds that overlap, where a demonstration stays in the component that it shaped."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(16, 8))
    points[9:, 0] += 2.5
    points -= points.mean(axis=0)
    features = Features(points, 8, np.zeros((16, 0)), np.zeros((0, 0)))
    found = cluster(features, 2, np.random.default_rng(0))
    monkeypatch.setattr(mixture, "REASSIGNMENTS", 0)
    assert found.log_likelihood > cluster(features, 2, np.random.default_rng(0)).log_likelihood
    moved = left_out_labels(points, found.left_out)
    again = fit_mixture(points, one_hot(moved[None], 2), features.prior)
    sizes = np.bincount(again.labels[0], minlength=2)
    assert sizes.min() < mixture.MIN_MEMBERS or again.log_likelihood[0] <= found.log_likelihood


def test_odd_few_or_identical_demonstrations_do_no_harm(rng):
    weights, tasks = drawn(rng)
    weights[0] += 4.0 * (weights[0] - weights[tasks == 0].mean(axis=0))
    features = mixture_features(weights, 3, BASIS)
    found = cluster(features, 3, np.random.default_rng(0))
    assert np.bincount(found.labels).min() >= mixture.MIN_MEMBERS
    features = mixture_features(drawn(rng, (3, 2))[0], 3, BASIS)
    for n_components in (3, 5):
        found = cluster(features, n_components, np.random.default_rng(0))
        assert np.isfinite(found.log_likelihood) and found.labels.max() < n_components
    weights = np.repeat(drawn(rng)[0][:1], 6, axis=0)
    found = cluster(mixture_features(weights, 3, BASIS), 2, np.random.default_rng(0))
    assert np.isfinite(found.log_likelihood)


def test_fits_without_each_or_a_fold_are_fits_of_the_rest(rng, monkeypatch):
    weights, tasks = drawn(rng)
    features = mixture_features(weights, 3, BASIS)
    points, prior = features.coordinates, features.prior
    left_out = leave_each_out(points, tasks, 3, prior)
    for index in (0, 9, 20):
        rest = np.delete(np.arange(len(points)), index)
        alone = fit_mixture(points[rest], one_hot(tasks[rest], 3)[None], prior).components
        np.testing.assert_allclose(left_out.mean[index], alone.mean[0], atol=1e-10)
        np.testing.assert_allclose(left_out.diagonal[index], alone.diagonal[0], rtol=1e-9)
    assert same_partition(left_out_labels(points, left_out), tasks)
    monkeypatch.setattr(mixture, "MAX_FOLDS", 4)
    left_out = leave_each_out(features.coordinates, tasks, 3, features.prior)
    assert left_out.mean.shape[0] == len(tasks)
    np.testing.assert_array_equal(left_out.mean[0], left_out.mean[4])
    assert left_out.count[0].sum() == pytest.approx(len(tasks) - 6)


def features_of(rng, n_each):
    weights, tasks = drawn(rng, n_each)
    return mixture_features(weights, 3, BASIS), tasks


def test_predictions_are_those_of_student_distributions_written_out(rng):
    features, tasks = features_of(rng, (5, 4))
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
    features, tasks = features_of(np.random.default_rng(sum(n_each)), n_each)
    choice = choose_components(features, np.random.default_rng(0), max_components=6)
    assert choice.n_components == len(n_each)
    assert purity(tasks, choice.chosen.labels) == 1.0
    assert [tried.n_components for tried in choice.tried] == list(range(1, len(choice.tried) + 1))


def test_progress_is_told_and_numbers_that_make_no_sense_are_refused(rng):
    told = []
    features, _ = features_of(rng, (4, 4))
    choose_components(features, np.random.default_rng(0), progress=told.append)
    assert told == [1, 2]  # 8 demonstrations: components of at least three
    features, _ = features_of(rng, (5,))
    for n_components in (0, 6):
        with pytest.raises(ArgumentError, match="n_components"):
            try_components(features, n_components, np.random.default_rng(0))
    assert try_components(features, 5, np.random.default_rng(0)).labels.shape == (5,)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_few_demonstrations_or_a_robot_that_does_the_same_are_one_component(n):
    features, _ = features_of(np.random.default_rng(n), (n,))
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
