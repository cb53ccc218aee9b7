# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours whose normals agree (Brandl et al. II-B and II-C)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError


def agreeing_neighbours(
    points: Floats, normals: Floats, candidates: Floats, candidate_normals: Floats, k: int = 1
) -> NDArray[np.integer]:
    """The k nearest candidates (m, 3) of each point (n, 3) with a normal on the same side.

    Normals are unit vectors; k is at least 1.

    Returns:
        Indices (n, k), nearest first. If fewer than k candidates agree, these are repeated; if none
        agrees, the nearest of all candidates is used.
    """
    m = len(candidates)
    if not 1 <= k <= m:
        raise ArgumentError.about("k", f"1 to {m}", k, "Use 1, as in the paper.")
    tree = cKDTree(candidates)
    found = np.empty((len(points), k), dtype=int)
    missing = np.arange(len(points))
    for look in (4, 16):
        look = min(look + k, m)
        _, near = tree.query(points[missing], k=look)
        near = near.reshape(len(missing), look)
        agree = (candidate_normals[near] @ normals[missing][:, :, None])[:, :, 0] > 0.0
        order = np.argsort(~agree, axis=1, kind="stable")[:, :k]
        found[missing] = np.take_along_axis(near, order, 1)
        missing = missing[agree.sum(1) < k]
    n = 64  # rows whose distances to all candidates are held at once
    for rows in (missing[at : at + n] for at in range(0, len(missing), n)):
        found[rows] = _among_all(points[rows], normals[rows], candidates, candidate_normals, k)
    return found


def majority(labels: NDArray[np.integer], n_labels: int) -> NDArray[np.integer]:
    """Most frequent of k labels (n, k); in a tie, the nearest neighbour's label wins."""
    if labels.shape[1] == 1:
        return labels[:, 0]
    votes = np.stack([(labels == label).sum(1) for label in range(n_labels)], 1).astype(float)
    votes[np.arange(len(labels)), labels[:, 0]] += 0.5
    return votes.argmax(1)


def _among_all(
    points: Floats, normals: Floats, candidates: Floats, candidate_normals: Floats, k: int
) -> NDArray[np.integer]:
    """`agreeing_neighbours` by comparing all candidates, for points whose neighbours are far."""
    # Squared distances less a constant per point, in one product.
    extended = np.column_stack([candidates, (candidates * candidates).sum(1)])
    distance = np.column_stack([-2.0 * points, np.ones(len(points))]) @ extended.T
    masked = np.where(normals @ candidate_normals.T > 0.0, distance, np.inf)
    near = np.argpartition(masked, k - 1, axis=1)[:, :k]
    order = np.argsort(np.take_along_axis(masked, near, 1), axis=1, kind="stable")
    near = np.take_along_axis(near, order, 1)
    n_agreeing = np.isfinite(np.take_along_axis(masked, near, 1)).sum(1)
    none = n_agreeing == 0
    near[none] = distance[none].argmin(1)[:, None]
    columns = np.arange(k) % np.maximum(n_agreeing, 1)[:, None]
    return np.take_along_axis(near, columns, 1)
