# SPDX-License-Identifier: Apache-2.0
"""EM in the span against textbook EM in the full space, and what degenerate components do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from intent_recognition.gaussian import mixture
from intent_recognition.gaussian.gaussian_mixture import _lloyd, kmeans_starts
from intent_recognition.gaussian.linalg import affine_span
from intent_recognition.gaussian.mixture import (
    CovariancePrior,
    fit_mixture,
    log_joint,
    maximisation,
    one_hot,
)


def clusters(rng, n_each=6, n_dims=40, n_components=3, distance=3.0):
    """Long vectors around different centres, and the centre of each."""
    centers = distance * rng.normal(size=(n_components, n_dims)) / np.sqrt(n_dims)
    labels = np.repeat(np.arange(n_components), n_each)
    factors = rng.normal(size=(4, n_dims))
    points = centers[labels] + 0.2 * rng.normal(size=(len(labels), 4)) @ factors
    return points + 0.05 * rng.normal(size=points.shape), labels


def textbook(points, share, floor, n_iterations):
    """EM as printed (Ewerton et al. 2015, Eq. 7-10), one component after the other."""
    for _ in range(n_iterations):
        joint = []
        for r in share.T:
            mean = r @ points / r.sum()
            covariance = (r[:, None] * (points - mean)).T @ (points - mean) / r.sum()
            covariance += floor * np.eye(points.shape[1])
            density = multivariate_normal(mean, covariance).logpdf(points)
            joint.append(np.log(r.mean()) + density)
        total = np.logaddexp.reduce(joint, axis=0)
        share = np.exp(np.array(joint) - total).T
    return share, total.mean()


@pytest.mark.slow
@given(seed=st.integers(0, 1000), floor=st.sampled_from([1e-4, 1e-2, 1.0]))
def test_the_span_gives_the_same_fit_as_the_full_space(seed, floor):
    rng = np.random.default_rng(seed)
    points, _ = clusters(rng)
    start = rng.dirichlet(np.ones(3), size=len(points))
    span = affine_span(points)
    assert span.coordinates.shape[1] < len(points) < points.shape[1]
    prior = CovariancePrior(floor)
    fit = fit_mixture(span.coordinates, start[None], prior, n_iterations=4, tolerance=-1.0)
    share, likelihood = textbook(points, start, floor, 4)
    np.testing.assert_allclose(fit.responsibilities[0], share, atol=1e-7)
    missing = points.shape[1] - span.coordinates.shape[1]
    complement = -0.5 * missing * np.log(2 * np.pi * floor)
    np.testing.assert_allclose(fit.log_likelihood[0] + complement, likelihood, rtol=1e-8)
    full = span.axes.T @ fit.components.covariance(span.coordinates)[0, 0] @ span.axes
    full += floor * (np.eye(points.shape[1]) - span.axes.T @ span.axes)
    r = share[:, 0]
    mean = r @ points / r.sum()
    expected = (r[:, None] * (points - mean)).T @ (points - mean) / r.sum()
    np.testing.assert_allclose(full, expected + floor * np.eye(len(full)), atol=1e-6)
    found = span.mean + fit.components.mean[0, 0] @ span.axes
    np.testing.assert_allclose(found, mean, atol=1e-7)


@pytest.mark.parametrize("n", [4, 9], ids=["by_members", "by_axes"])
@given(seed=st.integers(0, 1000), strength=st.sampled_from([0.0, 3.0]))
def test_densities_are_those_of_the_covariances_written_out(n, seed, strength):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 5)) * np.array([3.0, 2.0, 1.0, 0.5, 0.2])
    share = rng.dirichlet(np.ones(2), size=(2, n))
    prior = CovariancePrior(0.01, strength, 4.0)
    components = maximisation(points, share, prior)
    found = log_joint(points, components)
    scatters = [[np.cov(points.T, aweights=r, ddof=0) * r.sum() for r in fit.T] for fit in share]
    for b in range(2):
        pooled = np.diag(sum(scatters[b])) / n
        for k in range(2):
            m = share[b, :, k].sum()
            target = (np.diag(scatters[b][k]) + 4.0 * pooled) / (m + 4.0)
            covariance = (scatters[b][k] + strength * np.diag(target)) / (m + strength)
            covariance += 0.01 * np.eye(5)
            np.testing.assert_allclose(components.covariance(points)[b, k], covariance, atol=1e-12)
            mean = share[b, :, k] @ points / m
            expected = np.log(m / n) + multivariate_normal(mean, covariance).logpdf(points)
            np.testing.assert_allclose(found[b, :, k], expected, rtol=1e-9, atol=1e-9)


def test_a_batch_is_its_fits_one_by_one(rng, monkeypatch):
    points, _ = clusters(rng)
    starts = rng.dirichlet(np.ones(3), size=(7, len(points)))
    prior = CovariancePrior(0.01, 2.0, 1.0)
    together = fit_mixture(points, starts, prior)
    monkeypatch.setattr(mixture, "NUMBERS_AT_ONCE", 7)
    assert list(mixture.batches(5, 3)) == [slice(0, 2), slice(2, 4), slice(4, 6)]
    apart = fit_mixture(points, starts, prior)
    np.testing.assert_allclose(together.responsibilities, apart.responsibilities, atol=1e-12)
    single = fit_mixture(points, starts[3:4], prior)
    np.testing.assert_allclose(single.log_likelihood, together.log_likelihood[3:4], rtol=1e-12)


def test_a_point_left_out_has_no_influence(rng):
    points, labels = clusters(rng)
    prior = CovariancePrior(0.01, 2.0, 1.0)
    start = one_hot(labels, 3)
    start[4] = 0.0
    fit = fit_mixture(points, start[None], prior)
    rest = np.delete(np.arange(len(points)), 4)
    alone = fit_mixture(points[rest], start[None, rest], prior)
    np.testing.assert_allclose(fit.log_likelihood, alone.log_likelihood, rtol=1e-12)
    assert np.all(fit.responsibilities[0, 4] == 0.0)
    np.testing.assert_allclose(fit.components.mean, alone.components.mean, atol=1e-12)
    without_any = maximisation(points, 0.0 * start[None], prior)
    np.testing.assert_array_equal(without_any.log_weight, 0.0)
    np.testing.assert_array_equal(without_any.diagonal, prior.floor)


def test_an_empty_component_is_dropped(rng):
    points, labels = clusters(rng)
    prior = CovariancePrior(0.01, 2.0, 1.0)
    fit = fit_mixture(points, one_hot(labels, 4)[None], prior)
    without = fit_mixture(points, one_hot(labels, 3)[None], prior)
    assert fit.components.log_weight[0, 3] == -np.inf
    np.testing.assert_allclose(fit.log_likelihood, without.log_likelihood, rtol=1e-12)
    np.testing.assert_array_equal(fit.labels, without.labels)


def test_points_that_are_all_equal_make_one_component():
    points = affine_span(np.full((3, 3), 0.1)).coordinates  # whose mean is not quite 0.1
    assert points.shape == (3, 0)
    start = one_hot(np.array([[0, 1, 1]]), 2)
    fit = fit_mixture(points, start, CovariancePrior(0.1))
    assert np.isfinite(fit.log_likelihood[0])
    np.testing.assert_array_equal(fit.labels[0], 1)


@given(seed=st.integers(0, 1000), n=st.integers(1, 12), d=st.integers(1, 30))
def test_a_span_keeps_vectors_and_distances(seed, n, d):
    vectors = 5.0 + np.random.default_rng(seed).normal(size=(n, d))
    span = affine_span(vectors)
    assert span.coordinates.shape[1] <= min(n - 1, d)
    np.testing.assert_allclose(span.mean + span.coordinates @ span.axes, vectors, atol=1e-9)
    np.testing.assert_allclose(span.axes @ span.axes.T, np.eye(len(span.axes)), atol=1e-9)
    variance = np.sum(span.coordinates**2, axis=0)
    assert np.all(np.diff(variance) <= 1e-9)


@given(seed=st.integers(0, 1000), n=st.integers(1, 20), n_components=st.integers(1, 6))
def test_starts_leave_no_component_empty_if_there_are_points_enough(seed, n, n_components):
    rng = np.random.default_rng(seed)
    labels = kmeans_starts(rng.normal(size=(n, 3)), n_components, 4, rng)
    assert labels.shape == (4, n)
    for row in labels:
        assert len(np.unique(row)) == min(n, n_components)


def test_each_empty_cluster_takes_the_point_farthest_from_its_centre():
    """Another one each; a cluster keeps its last point, and equal points stay together."""
    distance = np.subtract.outer(*2 * (np.array([0.0, 2.0, 2.1, 2.2, 9.0]),)) ** 2
    assert _lloyd(distance, np.zeros(5, dtype=int), 3).tolist() == [2, 0, 0, 0, 1]
    assert _lloyd(distance[:2, :2], np.zeros(2, dtype=int), 3).tolist() == [1, 0]
    assert _lloyd(np.zeros((3, 3)), np.zeros(3, dtype=int), 2).tolist() == [0, 0, 0]


def test_starts_find_clusters_that_are_far_apart(rng):
    truth = np.repeat(np.arange(4), 5)
    points = 100.0 * rng.normal(size=(4, 6))[truth] + rng.normal(size=(20, 6))
    for labels in kmeans_starts(points, 4, 5, rng):
        assert len({(a, b) for a, b in zip(truth, labels, strict=True)}) == 4


def test_points_that_are_all_equal_need_no_second_component(rng):
    labels = kmeans_starts(np.ones((5, 2)), 3, 2, rng)
    assert labels.shape == (2, 5) and np.all(labels == labels[:, :1])
