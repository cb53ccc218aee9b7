# SPDX-License-Identifier: Apache-2.0
"""The region of two standard deviations about a path, as triangles to draw."""

import numpy as np

from intent_recognition.array_types import Floats, Integers

N_RINGS, N_SIDES = 16, 10
"""Number of rings of a tube, and of corners of each ring."""


def tube_rings(
    path: Floats, std: Floats, *, n_rings: int = N_RINGS, n_sides: int = N_SIDES
) -> Floats:
    """Rings about a path (T, 3) [m], evenly spaced along its samples.

    The points of a ring lie on the ellipsoid of two standard deviations about its centre. `std`
    holds the standard deviations along the coordinate axes, (T, 3) [m].

    Returns:
        Vertices (n_rings, n_sides, 3) [m].
    """
    at = np.linspace(0.0, len(path) - 1.0, n_rings)
    index = np.arange(len(path))
    centre = np.column_stack([np.interp(at, index, column) for column in path.T])
    radius = np.column_stack([np.interp(at, index, column) for column in std.T])
    first, second = _across(centre)
    angle = 2.0 * np.pi * np.arange(n_sides) / n_sides
    circle = (
        np.cos(angle)[None, :, None] * first[:, None]
        + np.sin(angle)[None, :, None] * second[:, None]
    )
    return centre[:, None] + 2.0 * radius[:, None] * circle


def tube_faces(n_rings: int = N_RINGS, n_sides: int = N_SIDES) -> Integers:
    """Triangles between the rings, counter-clockwise seen from outside.

    Returns:
        Indices of the flattened vertices, (2 (n_rings - 1) n_sides, 3).
    """
    ring, side = np.indices((n_rings - 1, n_sides))
    low, low_next = (ring * n_sides + (side + k) % n_sides for k in (0, 1))
    high, high_next = low + n_sides, low_next + n_sides
    triangles = np.array([[low, low_next, high_next], [low, high_next, high]])
    return np.moveaxis(triangles, 1, -1).reshape(-1, 3)


def _across(centre: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors perpendicular to the path at each of its points, which turn little."""
    along = np.gradient(centre, axis=0)
    centred = centre - centre.mean(axis=0)
    flattest = np.linalg.svd(centred, full_matrices=True)[2][-1]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 1e-9, along / np.maximum(length, 1e-9), np.eye(3)[_other(flattest)])
    first = np.cross(along, flattest)
    degenerate = np.linalg.norm(first, axis=1) < 1e-6
    first[degenerate] = np.cross(along[degenerate], np.eye(3)[_other(flattest)])
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-9)
    return first, np.cross(along, first)


def _other(axis: Floats) -> int:
    """Index of the coordinate axis that is least parallel to a vector."""
    return int(np.argmin(np.abs(axis)))
