# SPDX-License-Identifier: Apache-2.0
"""Closed surfaces cut by a plane: the volume below it and the tilt at which half is left."""

import numpy as np
from scipy.optimize import brentq

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.gaussian import tube_faces


def surface_volume(vertices: Floats, faces: Integers) -> float:
    """Volume [m^3] enclosed by a closed surface of vertices (n, 3) [m].

    Its faces (m, 3) are counter-clockwise seen from outside.
    """
    triangles = vertices[faces] - vertices.mean(0)
    return float(_signed_volumes(triangles).sum())


def closed_tube_faces(n_rings: int, n_corners: int) -> Integers:
    """Triangles (m, 3), wound outward, of a tube with a fan at either end.

    Args:
        n_rings: number of rings. Their corners are the first vertices, ring by ring, each ring
            counter-clockwise seen from the last one; the centres of the first and of the last ring
            are the two vertices after them.
        n_corners: number of corners per ring.
    """
    around = np.arange(n_corners)
    after = np.roll(around, -1)
    top, first = (n_rings - 1) * n_corners, np.full(n_corners, n_rings * n_corners)
    return np.concatenate(
        [
            tube_faces(n_rings, n_corners),
            np.stack([after, around, first], -1),
            np.stack([top + around, top + after, first + 1], -1),
        ]
    )


def shares_left(
    vertices: Floats,
    faces: Integers,
    lip: Floats,
    up: Floats,
    outward: Floats,
    tilts_rad: Floats,
    above_m: float = 0.0,
) -> Floats:
    """Shares (n,) of the volume below the level plane through the lip, at tilts (n,) about it.

    The other arguments are those of `half_volume_angle`; `above_m` raises the plane.
    """
    triangles = (vertices - lip)[faces]
    left = []
    for normal in np.outer(np.cos(tilts_rad), up) - np.outer(np.sin(tilts_rad), outward):
        cut = triangles - above_m * normal
        left.append(_below(cut @ normal, _signed_volumes(cut)))
    return np.array(left) / float(_signed_volumes(triangles).sum())


def half_volume_angle(
    vertices: Floats, faces: Integers, lip: Floats, up: Floats, outward: Floats
) -> float:
    """Tilt about the lip after which half of the volume is above the lip (Brandl et al. II-D).

    Args:
        vertices: points (n, 3) of the closed inner surface up to the opening, in metres.
        faces: vertex indices (m, 3), counter-clockwise seen from outside.
        lip: the lip point (3,).
        up: unit axis (3,) of the container, toward its opening.
        outward: unit vector (3,) across `up`, from the axis toward the lip.

    Raises:
        ArgumentError: the surface encloses nothing, or no tilt leaves half of it.
    """
    volume = surface_volume(vertices, faces)
    surface = (vertices, faces, lip, up, outward)

    def surplus(angle: float) -> float:
        return float(shares_left(*surface, np.array([angle]))[0]) - 0.5

    if not volume > 0.0 or surplus(0.0) <= 0.0 or surplus(np.pi) >= 0.0:
        raise ArgumentError.about(
            "vertices, lip",
            "a closed inner surface below its lip",
            f"{volume * 1e6:.3g} ml, not half of which are below the lip",
            "Wind the faces outward and take a lip point on the opening.",
        )
    return float(brentq(surplus, 0.0, np.pi, xtol=1e-6))


def _below(heights: Floats, volumes: Floats) -> float:
    """Volume below a plane through the origin, enclosed by a surface of triangles.

    `heights` (m, 3) are those of the corners above the plane, `volumes` (m,) those of the
    tetrahedra between the triangles and the origin. Where the plane cuts a triangle, one corner is
    alone on its side; the plane cuts off a share of both edges at that corner, and the product of
    the two shares of the tetrahedron.
    """
    n_below = (heights < 0.0).sum(1)
    cut = (n_below == 1) | (n_below == 2)
    at = heights[cut]
    lone = ((at < 0.0) == (n_below[cut] == 1)[:, None]).argmax(1)[:, None]
    own = np.take_along_axis(at, lone, 1)
    apart = own - at
    np.put_along_axis(apart, lone, 1.0, 1)
    share = own[:, 0] ** 2 / np.prod(apart, axis=1)
    share = np.where(n_below[cut] == 1, share, 1.0 - share)
    return float(volumes[n_below == 3].sum() + share @ volumes[cut])


def _signed_volumes(triangles: Floats) -> Floats:
    """Volume (m,) of the tetrahedra between triangles (m, 3, 3) and the origin."""
    return np.linalg.det(triangles) / 6.0
