# SPDX-License-Identifier: Apache-2.0
"""Closed triangle meshes from stacked rings and swept tubes."""

import numpy as np
import trimesh

from intent_recognition.array_types import Floats
from intent_recognition.warping import closed_tube_faces

N_CORNERS, TUBE_CORNERS = 64, 16
"""Corners of each outline, and of a handle's cross section. Convention."""


def at_heights(outlines: Floats, heights_m: Floats) -> Floats:
    """Rings (R, S, 3) of outlines (R, S, 2) at heights (R,)."""
    z = np.broadcast_to(heights_m[:, None, None], (*outlines.shape[:2], 1))
    return np.concatenate([outlines, z], axis=-1)


def pieces_between(inner: Floats, outer: Floats) -> list[Floats]:
    """Corners (8, 3) of the pieces of a wall between rings (R, S, 3), ring by ring."""
    pieces = []
    for low in range(len(inner) - 1):
        for k in range(inner.shape[1]):
            corners = [k, (k + 1) % inner.shape[1]]
            sides = [ring[low : low + 2, corners].reshape(-1, 3) for ring in (inner, outer)]
            pieces.append(np.concatenate(sides))
    return pieces


def close_rings(rings: Floats) -> trimesh.Trimesh:
    """Join rings (R, S, 3) [m] to a tube and close both ends with fans.

    Each is counter-clockwise seen from the last one.
    """
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(1)])
    return trimesh.Trimesh(vertices, closed_tube_faces(*rings.shape[:2]), process=False)


def swept_tube(path: Floats, radius_m: float, end_tangent: Floats) -> Floats:
    """Rings (P, S, 3) of a round tube along a path (P, 3) [m] in the plane y = 0.

    Each is counter-clockwise seen from the one before. The tube leaves in the direction
    `end_tangent` (3,) at the start, and comes back the other way at its end.
    """
    tangents = np.gradient(path, axis=0)
    tangents[0], tangents[-1] = end_tangent, -end_tangent
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    across = np.array([0.0, 1.0, 0.0])
    beside = np.cross(across, tangents)
    angles = np.arange(TUBE_CORNERS) * 2.0 * np.pi / TUBE_CORNERS
    circle = np.cos(angles)[:, None, None] * beside + np.sin(angles)[:, None, None] * across
    return path[:, None] + radius_m * circle.transpose(1, 0, 2)
