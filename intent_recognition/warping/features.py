# SPDX-License-Identifier: Apache-2.0
"""How the surface looks around each point, free of unit, place and direction."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

N_NEIGHBOURS = 20
"""Neighbours from which a point's features are computed."""


def local_features(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    tree: cKDTree | None = None,
    rows: NDArray[np.float64] | slice = slice(None),
) -> NDArray[np.float64]:
    """Features of the neighbourhood of each point (Brandl et al. II-B).

    The eigenvalues of the neighbourhood's covariance and the distance to its mean, as in the
    paper, both in units of the neighbourhood's own size; neighbours on the other side of a thin
    wall count less. The spread of the normals tells a rim from the edge of a scan.

    Args:
        points: (n, 3) in metres.
        normals: outward unit normals (n, 3).
        tree: of the points, if there is one.
        rows: of the points whose features are wanted.

    Returns:
        Features (m, 16): eight and their squares.
    """
    tree = tree or cKDTree(points)
    count = min(N_NEIGHBOURS, len(points))
    _, near = tree.query(points[rows], k=count)
    offsets = points[near] - points[rows][:, None]
    around, own = normals[near], normals[rows]
    agreement = (around @ own[:, :, None])[:, :, 0]
    weights = np.maximum(agreement, 0.0) + 0.05
    weights /= weights.sum(1, keepdims=True)
    size = np.sqrt((offsets * offsets).sum((1, 2)) / count)
    offsets /= np.maximum(size, np.finfo(float).tiny)[:, None, None]  # 0: all in one place
    mean = (weights[:, None] @ offsets)[:, 0]
    covariance = (offsets * weights[:, :, None]).transpose(0, 2, 1) @ offsets
    covariance -= mean[:, :, None] * mean[:, None]
    spread = around.transpose(0, 2, 1) @ around / count
    facing = around.mean(1)
    features = np.column_stack(
        [
            np.linalg.eigvalsh(covariance),
            np.sqrt((mean * mean).sum(1)),
            (mean * own).sum(1),
            np.linalg.eigvalsh(spread)[:, :2],
            np.sqrt((facing * facing).sum(1)),
        ]
    )
    return np.column_stack([features, features * features])
