# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours with agreeing normals, against looking at every pair."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.warping.mapping import agreeing_neighbours, majority


def cloud(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    normals = rng.normal(size=(n, 3))
    return rng.normal(size=(n, 3)), normals / np.linalg.norm(normals, axis=1)[:, None]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 9999), k=st.integers(1, 5), m=st.integers(5, 80))
def test_neighbours_are_those_of_the_full_table(seed, k, m):
    rng = np.random.default_rng(seed)
    points, normals = cloud(rng, 40)
    candidates, facing = cloud(rng, m)
    found = agreeing_neighbours(points, normals, candidates, facing, k)
    distance = np.linalg.norm(points[:, None] - candidates[None], axis=2)
    distance[normals @ facing.T <= 0.0] = np.inf
    for row in range(len(points)):
        order = [j for j in np.argsort(distance[row]) if np.isfinite(distance[row, j])]
        if len(order) >= k:
            assert found[row].tolist() == order[:k]
        elif order:
            assert set(found[row]) == set(order)
        else:
            all_distances = np.linalg.norm(points[row] - candidates, axis=1)
            assert set(found[row]) == {int(np.argmin(all_distances))}


def test_majority_and_its_ties():
    labels = np.array([[0, 1, 1], [2, 0, 1], [1, 0, 0], [2, 2, 0]])
    assert majority(labels, 3).tolist() == [1, 2, 0, 2]
    assert majority(labels[:, :1], 3).tolist() == [0, 2, 1, 2]


def test_k_beyond_the_candidates_is_refused():
    points, normals = cloud(np.random.default_rng(0), 5)
    with pytest.raises(ArgumentError, match="k: expected 1 to 5"):
        agreeing_neighbours(points, normals, points, normals, 6)
