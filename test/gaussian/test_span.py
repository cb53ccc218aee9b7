# SPDX-License-Identifier: Apache-2.0
"""Coordinates in a span keep distances; starts of a mixture are partitions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.gaussian.gaussian_mixture import kmeans_starts
from intent_recognition.gaussian.linalg import affine_span


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


def test_starts_find_clusters_that_are_far_apart(rng):
    truth = np.repeat(np.arange(4), 5)
    points = 100.0 * rng.normal(size=(4, 6))[truth] + rng.normal(size=(20, 6))
    for labels in kmeans_starts(points, 4, 5, rng):
        assert len({(a, b) for a, b in zip(truth, labels, strict=True)}) == 4


def test_points_that_are_all_equal_need_no_second_component(rng):
    labels = kmeans_starts(np.ones((5, 2)), 3, 2, rng)
    assert labels.shape == (2, 5) and np.all(labels == labels[:, :1])
