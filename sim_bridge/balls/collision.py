# SPDX-License-Identifier: Apache-2.0
"""Collision shapes of containers: convex pieces of wall, written as one OBJ file.

Bullet makes one convex hull of every `o` group of an OBJ file. A triangle mesh of a cup lets balls
through, and `createCollisionShapeArray` silently keeps only sixteen shapes. Walls for balls are
thickened outward, so much that two cups could not pass each other closely. Walls that another cup
can touch are therefore separate, with their true thickness apart from Bullet's margin.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from intent_recognition.array_types import Floats
from sim_bridge.balls.hollow import N_CORNERS, N_HEIGHTS, Hollow, offset
from sim_bridge.containers import TUBE_CORNERS, Container, at_heights, pieces_between

WALL_M = 0.006
"""Thickness of walls that balls collide with [m], measured outward from the inner surface."""
HULL_MARGIN_M = 0.001
"""Distance by which Bullet's hulls extend beyond their corners [m]; walls are shrunk by it."""


def wall_pieces(hollow: Hollow) -> list[Floats]:
    """Corners (V, 3) of the convex pieces: one per edge and pair of rings, and the floor.

    The inner faces of the pieces, Bullet's margin included, are the inner wall of `hollow`; the
    pieces grow outward only.
    """
    inner = hollow.grown(HULL_MARGIN_M)
    heights = inner.heights_m.copy()
    heights[-1] -= HULL_MARGIN_M
    outer = offset(inner.rings_m, WALL_M)
    near, far = at_heights(inner.rings_m, heights), at_heights(outer, heights)
    below = far[0] - np.array([0.0, 0.0, WALL_M])
    return [*pieces_between(near, far), np.concatenate([far[0], below])]


def write_obj(pieces: list[Floats], path: Path) -> None:
    """Write each piece as an `o` group with the triangles of its hull, facing outward."""
    lines, used = [], 0
    for index, corners in enumerate(pieces):
        hull = ConvexHull(corners)
        lines.append(f"o piece_{index}")
        lines += [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in corners]
        for triangle, plane in zip(hull.simplices, hull.equations, strict=True):
            a, b, c = corners[triangle]
            turned = np.dot(np.cross(b - a, c - a), plane[:3]) < 0.0
            order = triangle[::-1] if turned else triangle
            lines.append("f " + " ".join(str(used + i + 1) for i in order))
        used += len(corners)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


THINNEST_M, LOWEST_M = 0.0004, 0.0001
"""Smallest thickness and height of hulls [m]: Bullet's margin would leave none of a 2 mm wall."""


def solid_pieces(container: Container) -> list[Floats]:
    """Corners (V, 3) of slabs that fill a container up to its rim, and of its handle."""
    _, outer, heights = _rows(container)
    rings = at_heights(outer, heights)
    slabs = [np.concatenate(pair) for pair in pairwise(rings)]
    return slabs + _handle_pieces(container)


def shell_pieces(container: Container) -> list[Floats]:
    """Corners (V, 3) of the pieces of a container's wall, of its floor and of its handle."""
    inner, outer, heights = _rows(container)
    near, far = at_heights(inner, heights), at_heights(outer, heights)
    wall = pieces_between(near[1:], far[1:])
    return [np.concatenate([far[0], far[1]]), *wall, *_handle_pieces(container)]


def _rows(container: Container) -> tuple[Floats, Floats, Floats]:
    """Inner and outer outlines (R, N_CORNERS, 2) and heights (R,), less Bullet's margin."""
    sections = container.sections
    # The wall up to where the rim begins to curve, and the crest.
    level = sections.heights_m
    shoulder = int(np.argmax(np.linalg.norm(sections.outer, axis=2).max(1)))
    wanted = np.linspace(level[0], level[shoulder], N_HEIGHTS - 1)
    near = [int(np.argmin(np.abs(level[: shoulder + 1] - height))) for height in wanted]
    rows = [*sorted(set(near)), len(level) - 1]
    every = sections.inner.shape[1] // N_CORNERS
    heights = np.concatenate([[HULL_MARGIN_M], sections.heights_m[rows]])
    heights[-1] -= HULL_MARGIN_M
    heights[:-1] = np.minimum(heights[:-1], heights[-1] - LOWEST_M)
    base = sections.base[None, ::every]
    outer = np.concatenate([base, sections.outer[rows][:, ::every]])
    inner = np.concatenate([base, sections.inner[rows][:, ::every]])
    outer, inner = offset(outer, -HULL_MARGIN_M), offset(inner, HULL_MARGIN_M)
    middle, half = 0.5 * (outer + inner), 0.5 * (outer - inner)
    length = np.linalg.norm(middle, axis=-1, keepdims=True)
    outward = middle / length
    thick = np.maximum((half * outward).sum(-1, keepdims=True), 0.5 * THINNEST_M)
    return middle - thick * outward, middle + thick * outward, heights


def _handle_pieces(container: Container) -> list[Floats]:
    if container.handle is None:
        return []
    # The last two corners close the ends, which lie in the wall.
    rings = np.asarray(container.handle.vertices)[:-2].reshape(-1, TUBE_CORNERS, 3)
    middle = rings.mean(1, keepdims=True)
    grip = np.linalg.norm(rings - middle, axis=2, keepdims=True)
    rings = middle + (rings - middle) * (1.0 - HULL_MARGIN_M / grip)
    return [np.concatenate(pair) for pair in pairwise(rings)]
