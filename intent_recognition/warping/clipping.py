# SPDX-License-Identifier: Apache-2.0
"""Closed surfaces cut by a plane: the volume below it and the tilt at which half is left."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from intent_recognition.errors import ArgumentError


def surface_volume(vertices: NDArray[np.float64], faces: NDArray[np.float64]) -> float:
    """Volume enclosed by a closed, outward wound surface.

    Args:
        vertices: points (n, 3) in metres.
        faces: vertex indices (m, 3), counter-clockwise seen from outside.
    """
    triangles = vertices[faces] - vertices.mean(0)
    return float(_signed_volumes(triangles).sum())


def shares_left(
    vertices: NDArray[np.float64],
    faces: NDArray[np.float64],
    lip: NDArray[np.float64],
    up: NDArray[np.float64],
    outward: NDArray[np.float64],
    tilts_rad: NDArray[np.float64],
    above_m: float = 0.0,
) -> NDArray[np.float64]:
    """Shares (n,) of the volume below the level plane through the lip, at tilts (n,) about it.

    The other arguments are those of `half_volume_angle`; `above_m` raises the plane.
    """
    triangles = (vertices - lip)[faces]
    left = []
    for normal in np.outer(np.cos(tilts_rad), up) - np.outer(np.sin(tilts_rad), outward):
        cut = triangles - above_m * normal
        left.append(_below(cut, _signed_volumes(cut), normal))
    return np.array(left) / float(_signed_volumes(triangles).sum())


def half_volume_angle(
    vertices: NDArray[np.float64],
    faces: NDArray[np.float64],
    lip: NDArray[np.float64],
    up: NDArray[np.float64],
    outward: NDArray[np.float64],
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
    triangles = (vertices - lip)[faces]
    volumes = _signed_volumes(triangles)
    half = 0.5 * float(volumes.sum())

    def surplus(angle: float) -> float:
        normal = np.cos(angle) * up - np.sin(angle) * outward
        return _below(triangles, volumes, normal) - half

    if not half > 0.0 or surplus(0.0) <= 0.0 or surplus(np.pi) >= 0.0:
        raise ArgumentError.about(
            "vertices, lip",
            "a closed inner surface below its lip",
            f"{2.0 * half * 1e6:.3g} ml, of which {(surplus(0.0) + half) * 1e6:.3g} ml are "
            "below the lip",
            "Wind the faces outward and take a lip point on the opening.",
        )
    return float(brentq(surplus, 0.0, np.pi, xtol=1e-6))


def _below(
    triangles: NDArray[np.float64], volumes: NDArray[np.float64], normal: NDArray[np.float64]
) -> float:
    """Volume below the plane through the origin, whose tetrahedra have these volumes (m,)."""
    heights = triangles @ normal
    n_below = (heights < 0.0).sum(1)
    total = volumes[n_below == 3].sum()
    one = n_below == 1
    if one.any():
        corner, left, right, towards_left, towards_right = _cut(triangles[one], heights[one], True)
        total += _signed_volumes(np.stack([corner, towards_left, towards_right], 1)).sum()
    two = n_below == 2
    if two.any():
        corner, left, right, towards_left, towards_right = _cut(triangles[two], heights[two], False)
        total += _signed_volumes(np.stack([towards_left, left, right], 1)).sum()
        total += _signed_volumes(np.stack([towards_left, right, towards_right], 1)).sum()
    return float(total)


def _signed_volumes(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Volume (m,) of the tetrahedra between triangles (m, 3, 3) and the origin."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = triangles.transpose(1, 2, 0)
    return (ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)) / 6.0


def _cut(
    triangles: NDArray[np.float64], heights: NDArray[np.float64], below: bool
) -> tuple[NDArray[np.float64], ...]:
    """The corner alone on its side, the two others in order, and the cuts toward both."""
    lone = np.argmax((heights < 0.0) == below, axis=1)
    rows = np.arange(len(triangles))
    order = [(lone + step) % 3 for step in range(3)]
    corner, left, right = (triangles[rows, index] for index in order)
    at_corner, at_left, at_right = (heights[rows, index] for index in order)
    towards_left = corner + (at_corner / (at_corner - at_left))[:, None] * (left - corner)
    towards_right = corner + (at_corner / (at_corner - at_right))[:, None] * (right - corner)
    return corner, left, right, towards_left, towards_right
