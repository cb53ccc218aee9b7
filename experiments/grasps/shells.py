# SPDX-License-Identifier: Apache-2.0
"""Any open mesh as convex pieces: wall and floor by rays from its axis, the handle by sectors.

Bullet collides moving bodies by convex shapes alone, and the hull of a cup has no inside.
"""

import numpy as np
import trimesh

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from sim_bridge.containers import at_heights, pieces_between

N_RINGS, N_CORNERS = 9, 32
"""Rings and corners of a wall: 256 pieces, a few millimetres wide on a cup."""
LEVEL_M = 0.0005
"""Step of the search for the uppermost ring [m]."""
MIN_WALL_SHARE = 0.9
"""Share of the rays of a ring that have to meet the wall: scans have pinholes."""
FLOOR_SHARE = 0.05
"""Share of the cavity's depth that lies below the lowest ring, and is filled."""
BEYOND_M = 0.003
"""Distance outside the wall from which a vertex is the handle's [m]: above a scan's unevenness."""
MIN_ONE_SIDED = 0.9
"""Least length of the mean direction from the axis to a handle: the rim's lip is wider."""
N_SECTORS = 12
"""Pieces of a handle, by direction from its middle."""
OVERLAP = 1.3
"""Width of such a sector relative to its share of half a turn, so that the pieces touch."""
THINNEST_M = 1e-4
"""Pieces thinner than this are left out, and walls are at least so thick [m]: hulls need a body."""


def shell_pieces(mesh: trimesh.Trimesh) -> list[Floats]:
    """Corners (V, 3) of convex pieces that together are an open container.

    Args:
        mesh: in metres, z up, wound outward; every ray from its axis meets the wall once.
    """
    low, high = mesh.bounds
    turns = np.arange(N_CORNERS) * 2.0 * np.pi / N_CORNERS
    directions = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(N_CORNERS)])
    axis = 0.5 * (low[:2] + high[:2])
    # A handle moves the middle of the bounds, and not that of the wall.
    radii = _walls(mesh, axis, [0.2 * low[2] + 0.8 * high[2]], directions)[0, :, 0]
    met = np.isfinite(radii)
    if met.any():
        axis = axis + (radii[met, None] * directions[met, :2]).mean(0)
    top = _top(mesh, axis, directions)
    floor = _floor(mesh, axis)
    heights = np.linspace(floor + FLOOR_SHARE * (top - floor), top, N_RINGS)
    walls = _filled(_walls(mesh, axis, heights, directions))
    inner, outer = (
        at_heights(axis + walls[..., k, None] * directions[:, :2], heights) for k in (0, 1)
    )
    pieces = pieces_between(inner, outer)
    vertices = np.asarray(mesh.vertices, dtype=float)
    flat = vertices[:, :2] - axis
    radius, turn = np.hypot(*flat.T), np.arctan2(flat[:, 1], flat[:, 0])
    level = np.clip(vertices[:, 2], heights[0], heights[-1])
    wall = _outer_radius(walls[..., 1], heights, turns, level, turn)
    under = (vertices[:, 2] < heights[0]) & (radius < wall + BEYOND_M)
    pieces.append(np.concatenate([outer[0], vertices[under]]))
    return pieces + _handle_pieces(vertices[radius > wall + BEYOND_M], axis)


def _walls(
    mesh: trimesh.Trimesh, axis: Floats, heights: Floats | list[float], directions: Floats
) -> Floats:
    """Distance (R, S, 2) of the wall's inner and outer side from the axis; NaN where none is."""
    rays = np.tile(directions, (len(heights), 1))
    starts = np.column_stack(
        [np.tile(axis, (len(rays), 1)), np.repeat(np.asarray(heights), len(directions))]
    )
    points, ray, face = mesh.ray.intersects_location(starts, rays, multiple_hits=True)
    distance = np.linalg.norm(points - starts[ray], axis=1)
    out = (mesh.face_normals[face] * rays[ray]).sum(1) > 0.0
    found = np.full((len(rays), 2), np.inf)
    np.minimum.at(found[:, 0], ray[~out], distance[~out])
    behind = out & (distance > found[ray, 0])
    np.minimum.at(found[:, 1], ray[behind], distance[behind])
    found[~np.isfinite(found).all(1)] = np.nan
    return found.reshape(len(heights), len(directions), 2)


def _top(mesh: trimesh.Trimesh, axis: Floats, directions: Floats) -> float:
    """The greatest height at which there is a wall all around [m]."""
    low, high = mesh.bounds[:, 2]
    heights = np.arange(high, low, -LEVEL_M)
    seen = np.isfinite(_walls(mesh, axis, heights, directions)[..., 0]).mean(1)
    if seen.max() < MIN_WALL_SHARE:
        cure = "Stand it upright, z up, and close holes in a mesh editor."
        got = f"one over {100.0 * seen.max():.0f} % of a turn"
        raise ArgumentError.about("mesh", "a wall all around its axis", got, cure)
    return float(heights[np.argmax(seen >= MIN_WALL_SHARE)]) - LEVEL_M


def _floor(mesh: trimesh.Trimesh, axis: Floats) -> float:
    """Height of the cavity's floor on the axis [m]."""
    start = [[*axis, mesh.bounds[1, 2] + 1.0]]
    points, _, _ = mesh.ray.intersects_location(start, [[0.0, 0.0, -1.0]], multiple_hits=True)
    if not len(points):
        cure = "Close its floor in a mesh editor."
        raise ArgumentError.about("mesh", "a floor", "none on its axis", cure)
    return float(points[:, 2].max())


def _filled(walls: Floats) -> Floats:
    """Walls (R, S, 2) with gaps bridged along each ring."""
    corners = np.arange(walls.shape[1])
    for ring in walls:
        known = np.isfinite(ring[:, 0])
        for side in (0, 1):
            ring[:, side] = np.interp(
                corners, corners[known], ring[known, side], period=len(corners)
            )
    walls[..., 1] = np.maximum(walls[..., 1], walls[..., 0] + THINNEST_M)
    return walls


def _outer_radius(
    radii: Floats, heights: Floats, turns: Floats, level: Floats, turn: Floats
) -> Floats:
    """Outer radius (n,) of rings (R, S) at levels (n,) and turns (n,)."""
    row = np.interp(level, heights, np.arange(len(heights)))
    column = (turn % (2.0 * np.pi)) / (turns[1] - turns[0])
    low, left = np.minimum(row.astype(int), len(heights) - 2), column.astype(int) % len(turns)
    up, right = row - low, column - column.astype(int)
    after = (left + 1) % len(turns)
    near = (1.0 - right) * radii[low, left] + right * radii[low, after]
    far = (1.0 - right) * radii[low + 1, left] + right * radii[low + 1, after]
    return (1.0 - up) * near + up * far


def _handle_pieces(vertices: Floats, axis: Floats) -> list[Floats]:
    """Pieces of what stands out of the wall to one side, in sectors about its middle."""
    flat = vertices[:, :2] - axis
    units = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    if not len(units) or np.linalg.norm(units.mean(0)) < MIN_ONE_SIDED:
        return []
    reach = flat @ units.mean(0) / np.linalg.norm(units.mean(0))
    middle = 0.5 * (vertices[:, 2].min() + vertices[:, 2].max())
    turn = np.arctan2(vertices[:, 2] - middle, reach - reach.min())
    width = OVERLAP * np.pi / N_SECTORS
    sectors = -np.pi / 2.0 + (np.arange(N_SECTORS) + 0.5) * np.pi / N_SECTORS
    near = [vertices[np.abs(turn - sector) < 0.5 * width] for sector in sectors]
    return [some for some in near if _thickness(some) > THINNEST_M]


def _thickness(points: Floats) -> float:
    """Least standard deviation of points (n, 3) in any direction; 0 of too few."""
    if len(points) <= points.shape[1]:
        return 0.0
    return float(
        np.linalg.svd(points - points.mean(0), compute_uv=False)[-1] / np.sqrt(len(points))
    )
