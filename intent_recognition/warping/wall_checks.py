# SPDX-License-Identifier: Apache-2.0
"""Check that a container that was seen from all sides has no hole in its wall."""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.warping.cavity import Cavity
from intent_recognition.warping.object_model import ObjectCloud
from intent_recognition.warping.object_warp import WarpedObject

N_AROUND, N_DOWN = 36, 24
"""Numbers of cells into which the inside is divided: around the axis, and from rim to floor."""


def check_wall(warped: WarpedObject, surface: ObjectCloud) -> None:
    """Refuse a container with a hole in its inner wall or floor.

    Pinholes of a few millimetres, as in scans of thin plastic, are ignored. `surface` has tens of
    thousands of points spread evenly over the whole object.

    Raises:
        ArgumentError: there is a hole; the message says where.
    """
    rim, cavity = warped.rim, warped.cavity
    floor_m = cavity.profile[-1, 1]
    # From the middle of a closed cavity, there is wall in every direction.
    pole = np.array([-0.5 * floor_m, 0.0, 0.0])
    offsets = rim.to_local(surface.points) - pole
    facing = surface.normals @ rim.axes.T
    radius = np.hypot(offsets[:, 1], offsets[:, 2])
    widest_m = max(rim.radius_m, cavity.profile[:, 0].max())
    inside = ((offsets * facing).sum(1) < 0.0) & (radius < 1.3 * widest_m)
    inside &= np.abs(offsets[:, 0]) < 0.5 * floor_m + 0.1 * rim.depth_m
    angle = np.arctan2(-offsets[:, 0], radius)
    start = np.arctan2(-0.5 * floor_m, rim.radius_m)
    down = np.floor((angle - start) / (0.5 * np.pi - start) * N_DOWN).astype(int)
    turn = np.arctan2(offsets[:, 2], offsets[:, 1]) / (2.0 * np.pi) + 0.5
    around = (turn * N_AROUND).astype(int) % N_AROUND
    cells = np.zeros((N_DOWN, N_AROUND), dtype=int)
    kept = inside & (down >= 0) & (down < N_DOWN)
    np.add.at(cells, (down[kept], around[kept]), 1)
    holes = _holes(cells)
    cure = "Scan the container again, or close the hole in a mesh editor."
    if holes.any():
        middle_row = 0.5 + float(np.argwhere(holes)[:, 0].mean())
        lowered = np.tan(start + middle_row / N_DOWN * (0.5 * np.pi - start)) * rim.radius_m
        level = np.clip(0.5 * floor_m + lowered, 0.0, floor_m)
        got = f"a hole about {1e3 * level:.0f} mm below the rim"
        raise ArgumentError.about("target", "a closed wall and floor", got, cure)
    middle_m = 0.35 * rim.radius_m
    expected = inside.sum() * (middle_m**2 * np.pi) / _area(cavity)
    if (inside & (radius < middle_m)).sum() < 0.3 * expected:
        got = "a hole in the floor"
        raise ArgumentError.about("target", "a closed wall and floor", got, cure)


def _holes(cells: Floats) -> Floats:
    """Empty cells with an empty neighbour, in places where cells are usually full."""
    around = np.stack([np.roll(cells, turn, axis=1) for turn in range(-4, 5)])
    filled = np.ma.median(np.ma.masked_equal(around, 0), axis=0)
    # Where all neighbours are empty, the row tells what is usual.
    row = np.broadcast_to(np.median(cells, axis=1, keepdims=True), cells.shape)
    empty = (cells == 0) & (np.where(np.ma.getmaskarray(filled), row, filled) >= 15)
    beside = np.roll(empty, 1, axis=1) | np.roll(empty, -1, axis=1)
    beside[1:] |= empty[:-1]
    beside[:-1] |= empty[1:]
    return empty & beside


def _area(cavity: Cavity) -> float:
    """Area of wall and floor of a cavity [m^2]; its lid is the triangles around the centre."""
    lid = len(cavity.vertices) - 1
    triangles = cavity.vertices[cavity.faces[(cavity.faces != lid).all(1)]]
    edges = triangles[:, 1:] - triangles[:, :1]
    return float(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
