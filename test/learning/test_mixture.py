# SPDX-License-Identifier: Apache-2.0
"""A mixture of primitives: its coordinates, its clusters, and what an observation makes of it."""

import numpy as np
import pytest
from simulation import draw_weights, make_library

from intent_recognition.errors import TrainingError
from intent_recognition.gaussian.mixture import fit_mixture, one_hot
from intent_recognition.learning import mixture, mixture_features
from intent_recognition.learning.mixture import Features, cluster, leave_each_out, left_out_labels
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
    factor = np.array([1000.0, 1.0, 1e-3, 57.3, 0.1])[:, None]
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
