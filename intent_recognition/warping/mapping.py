# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours whose normals agree (Brandl et al. II-B and II-C)."""

import numpy as np
from scipy.spatial import cKDTree

from intent_recognition.errors import ArgumentError, describe

FIRST_LOOK = 6


def agreeing_neighbours(
    points: np.ndarray,
    normals: np.ndarray,
    candidates: np.ndarray,
    candidate_normals: np.ndarray,
    k: int = 1,
) -> np.ndarray:
    """The k nearest candidates of each point with a normal on the same side.

    Args:
        points: (n, 3).
        normals: unit normals (n, 3).
        candidates: (m, 3).
        candidate_normals: unit normals (m, 3).
        k: how many, at least 1.

    Returns:
        Indices (n, k), nearest first. Where fewer than k candidates agree the nearest of those
        that do are repeated; where none does, the nearest of all stands in.

    Raises:
        ArgumentError: k is not between 1 and m.
    """
    m = len(candidates)
    if not 1 <= k <= m:
        raise ArgumentError(describe("k", f"1 to {m}", k, "Use 1, as in the paper."))
    found = np.empty((len(points), k), dtype=int)
    tree = cKDTree(candidates)
    missing, look = np.arange(len(points)), FIRST_LOOK + k
    while len(missing):
        look = min(look, m)
        _, near = tree.query(points[missing], k=look)
        near = near.reshape(len(missing), look)
        agree = (candidate_normals[near] @ normals[missing][:, :, None])[:, :, 0] > 0.0
        enough = agree.sum(1) >= k
        order = np.argsort(~agree, axis=1, kind="stable")[:, :k]
        done = np.take_along_axis(near, order, 1)
        found[missing[enough]] = done[enough]
        if look == m:
            short = missing[~enough]
            found[short] = _repeated(done[~enough], agree[~enough].sum(1))
            break
        missing, look = missing[~enough], look * 8
    return found


def majority(labels: np.ndarray, n_labels: int) -> np.ndarray:
    """Most frequent of k labels (n, k), that of the nearest neighbour where two are level."""
    if labels.shape[1] == 1:
        return labels[:, 0]
    votes = np.stack([(labels == label).sum(1) for label in range(n_labels)], 1).astype(float)
    votes[np.arange(len(labels)), labels[:, 0]] += 0.5
    return votes.argmax(1)


def _repeated(near: np.ndarray, n_agreeing: np.ndarray) -> np.ndarray:
    """Fill the columns behind those that agree with copies of these."""
    columns = np.arange(near.shape[1]) % np.maximum(n_agreeing, 1)[:, None]
    return np.take_along_axis(near, columns, 1)
