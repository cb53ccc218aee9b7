# SPDX-License-Identifier: Apache-2.0
"""What balls collide with: a hollow as convex pieces of wall, written as one OBJ file.

Bullet makes one convex hull of every `o` group of an OBJ file. A triangle mesh of a cup lets balls
through, and `createCollisionShapeArray` silently keeps sixteen shapes.
"""

from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from intent_recognition.array_types import Floats
from sim_bridge.balls.hollow import Hollow, offset
from sim_bridge.containers import at_heights, pieces_between

WALL_M = 0.006
"""Thickness of walls that balls collide with [m], drawn outward from the inner surface."""
HULL_MARGIN_M = 0.001
"""Bullet's hulls reach this much farther than their corners [m]; the wall is drawn back by it."""


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
