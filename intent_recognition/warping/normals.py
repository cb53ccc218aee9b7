# SPDX-License-Identifier: Apache-2.0
"""Normals of a cloud that has none, from the places it was seen from."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.warping.object_model import ObjectCloud, checked_points

N_NEIGHBOURS = 10
"""Neighbours from which a normal is estimated."""


def with_estimated_normals(
    points: NDArray[np.float64], viewpoints: NDArray[np.float64] | None
) -> ObjectCloud:
    """A cloud whose normals are those of the planes through each point's neighbours.

    A surface can only be seen from outside: each normal is turned toward the camera. Neighbours
    on the other side of a thin wall are seen from another camera, or not at all.

    Args:
        points: (n, 3) [m].
        viewpoints: place of the camera (3,), or that of each point's camera (n, 3) [m].

    Returns:
        The cloud.

    Raises:
        ShapeError: viewpoints are neither (3,) nor (n, 3).
        ArgumentError: viewpoints are missing or not finite, or the points are bad.
    """
    points = checked_points(points)
    if viewpoints is None:
        cure = "Give normals, or where the camera was: without either inside is like outside."
        raise ArgumentError(describe("viewpoints", "where the camera was", "none", cure))
    eyes = np.asarray(viewpoints, dtype=float)
    if eyes.shape not in ((3,), points.shape):
        cure = "Give one place, or one per point."
        raise ShapeError(describe("viewpoints", f"(3,) or {points.shape}", eyes.shape, cure))
    if not np.isfinite(eyes).all():
        raise ArgumentError(describe("viewpoints", "finite places", eyes, "Leave NaN out."))
    normals = np.empty_like(points)
    groups = [np.arange(len(points))]
    if eyes.ndim == 2:
        _, group = np.unique(eyes, axis=0, return_inverse=True)
        groups = [np.flatnonzero(group.ravel() == one) for one in range(group.max() + 1)]
    for rows in groups:
        normals[rows] = _plane_normals(points[rows])
    away = ((eyes - points) * normals).sum(1) < 0.0
    normals[away] *= -1.0
    return ObjectCloud(points, normals)


def _plane_normals(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals (n, 3) of either sign."""
    _, near = cKDTree(points).query(points, k=min(N_NEIGHBOURS, len(points)))
    offsets = points[near] - points[near].mean(1, keepdims=True)
    _, vectors = np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)
    return vectors[:, :, 0]
