# SPDX-License-Identifier: Apache-2.0
"""The tube's vertices lie on the ellipsoids, and its surface is closed around the path."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from intent_recognition.gaussian.tube import tube_faces, tube_rings

COORDINATES = st.floats(-2.0, 2.0, allow_nan=False)


@given(arrays(float, (7, 3), elements=COORDINATES), st.floats(0.001, 0.5))
def test_every_vertex_is_as_many_standard_deviations_from_its_point(path, size):
    std = np.full((7, 3), size) * np.array([1.0, 2.0, 0.5])
    rings = tube_rings(path, std, n_rings=7)
    distance = np.linalg.norm((rings - path[:, None]) / std[:, None], axis=-1)
    assert np.allclose(distance, 2.0, atol=1e-6)


def test_rings_lie_across_a_straight_path():
    path = np.outer(np.linspace(0.0, 1.0, 9), [0.3, -0.2, 0.9])
    rings = tube_rings(path, np.full((9, 3), 0.05))
    along = path[-1] / np.linalg.norm(path[-1])
    assert np.allclose((rings - rings.mean(axis=1, keepdims=True)) @ along, 0.0, atol=1e-9)


def test_faces_share_every_inner_edge_and_point_outward():
    faces = tube_faces(5, 6)
    assert len(faces) == 2 * 4 * 6
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert sorted(set(count)) == [1, 2]
    assert np.sum(count == 1) == 2 * 6  # the two open ends
    path = np.outer(np.arange(5.0), [0.0, 0.0, 1.0])
    vertices = tube_rings(path, np.full((5, 3), 0.1), n_rings=5, n_sides=6).reshape(-1, 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outward = np.sum(np.cross(b - a, c - a) * (a * [1.0, 1.0, 0.0]), axis=1)
    assert np.all(outward > 0)


def test_a_single_point_has_a_tube_too():
    assert np.all(np.isfinite(tube_rings(np.zeros((1, 3)), np.full((1, 3), 0.1))))
