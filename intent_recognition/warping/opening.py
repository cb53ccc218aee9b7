# SPDX-License-Identifier: Apache-2.0
"""Find the opening of a container: the plane in which its rim lies, with the rest below."""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats

MIN_RIM_POINTS = 8
"""Fewest points of a rim."""
LIKELY_SHARE = 0.15
"""Share of the points, the most rim-like ones, from which hypotheses are drawn."""


@dataclass(frozen=True, eq=False)
class OpeningPlane:
    """A circle with its axis: centre (3,) [m], unit axis (3,) outward, radius [m]."""

    centre: Floats
    up: Floats
    radius_m: float


def find_opening(points: Floats, normals: Floats, rim_probability: Floats) -> OpeningPlane | None:
    """Find the opening of points (n, 3) [m] with outward unit normals (n, 3).

    The search starts from the probability (n,) that each point belongs to the rim. Planes through
    triples of probable rim points are scored by the rim probability near them, less the points
    above. Of the best planes, the one is chosen whose ring lies on the rim and faces most surface.

    Returns:
        The opening; None if no plane has a ring of rim with a cavity below.
    """
    middle = points.mean(0)
    size = float(np.sqrt(((points - middle) ** 2).sum(1).mean()))
    tolerance = 0.03 * size
    # Probabilities differ from camera to camera; only their order counts.
    usual = np.quantile(rim_probability, 1.0 - LIKELY_SHARE)
    rim_probability = rim_probability / (rim_probability + usual + 1e-12)
    planes = _hypotheses(points, rim_probability, middle)
    distance = (points @ planes[:, :3].T) - planes[:, 3]
    near = np.abs(distance) < tolerance
    above = distance > 2.0 * tolerance
    support = rim_probability @ near - 0.5 * above.sum(0)
    likely = planes[np.argsort(-support)[:6]]

    def score(opening: OpeningPlane) -> float:
        looks_into = _looks_into(points, normals, opening, tolerance)
        return looks_into + _ring_share(points, rim_probability, opening, tolerance)

    by_rim = [_refine(points, rim_probability, plane, tolerance) for plane in likely]
    score_of = {opening: score(opening) for opening in by_rim if opening is not None}
    if max(score_of.values(), default=0.0) < 0.9:  # no clear rim
        _, axes = np.linalg.eigh(normals.T @ normals)  # try these axes, and planes turned over
        ways = np.concatenate([axes.T, -axes.T, -likely[:2, :3]])
        by_shape = [_bearing(points, up) for up in ways]
        score_of |= {opening: score(opening) for opening in by_shape if opening is not None}
    best = max(score_of, key=score_of.__getitem__, default=None)
    return best if best is not None and score_of[best] > 0.3 else None


def fit_circle(plane_points: Floats) -> tuple[Floats, float]:
    """Centre (2,) and radius of the circle through points (n, 2) in the least-squares sense."""
    design = np.column_stack([2.0 * plane_points, np.ones(len(plane_points))])
    solution, *_ = np.linalg.lstsq(design, (plane_points**2).sum(1), rcond=None)
    radius = np.sqrt(max(solution[2] + solution[:2] @ solution[:2], 0.0))
    return solution[:2], float(radius)


def fit_plane(points: Floats, up: Floats) -> Floats:
    """Unit normal (3,) of the plane through points (n, 3), on the side of `up`."""
    offsets = points - points.mean(0)
    _, vectors = np.linalg.eigh(offsets.T @ offsets)
    normal = vectors[:, 0]
    return normal if normal @ up >= 0.0 else -normal


def across(up: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that make a right-handed frame with `up` as the third axis."""
    # The first is the cross product with the axis least along `up`, written out for speed.
    x, y, z = up
    least = int(np.argmin(np.abs(up)))
    first = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)][least])
    first /= np.sqrt(first @ first)
    a, b, c = first
    return first, np.array([y * c - z * b, z * a - x * c, x * b - y * a])


def _hypotheses(points: Floats, probability: Floats, middle: Floats) -> Floats:
    """Planes (m, 4): normals away from the middle, and their distances from the origin."""
    count = max(MIN_RIM_POINTS, int(LIKELY_SHARE * len(points)))
    likely = np.argsort(-probability, kind="stable")[:count]
    # The draws are fixed: the same cloud in another place gives the same planes.
    draws = np.random.default_rng(0).integers(0, count, (300, 3))
    corners = points[likely[draws]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    kept = length > 1e-3 * length.max()
    normals = normals[kept] / length[kept, None]
    offsets = np.einsum("ij,ij->i", normals, corners[kept, 0])
    sign = np.where(normals @ middle > offsets, -1.0, 1.0)
    return np.column_stack([normals * sign[:, None], offsets * sign])


def _bearing(points: Floats, up: Floats) -> OpeningPlane | None:
    """The plane and the circle through the highest points in all directions."""
    middle = points.mean(0)
    farthest, n_sectors = np.argmax(((points - middle) ** 2).sum(1)), 24
    for _ in range(4):
        first, second = across(up)
        flat = (points - middle) @ np.stack([first, second], 1)
        level = (points - middle) @ up
        # Sectors are counted from a point of the object, so that they turn with it.
        angle = np.arctan2(flat[:, 1], flat[:, 0])
        share = (angle - angle[farthest]) / (2.0 * np.pi) % 1.0
        sector = (share * n_sectors).astype(int) % n_sectors
        order = np.lexsort((-level, sector))
        first_of = np.searchsorted(sector[order], np.unique(sector))
        crest = order[first_of]
        if len(crest) < MIN_RIM_POINTS:
            return None
        up = fit_plane(points[crest], up)
        middle = points[crest].mean(0)
    return _circle(points[crest], up)


def _circle(rim: Floats, up: Floats) -> OpeningPlane | None:
    """The circle through rim points (n, 3); None if they are far from a circle."""
    first, second = across(up)
    flat = rim @ np.stack([first, second], 1)
    centre, radius = fit_circle(flat)
    if np.std(np.linalg.norm(flat - centre, axis=1)) > 0.25 * radius:
        return None
    height = rim.mean(0) @ up
    return OpeningPlane(centre[0] * first + centre[1] * second + height * up, up, radius)


def _refine(
    points: Floats, probability: Floats, plane: Floats, tolerance: float
) -> OpeningPlane | None:
    """The plane and circle through the probable rim points near a plane."""
    up, offset = plane[:3], plane[3]
    for _ in range(3):
        near = (np.abs(points @ up - offset) < 1.5 * tolerance) & (probability >= 0.5)
        if near.sum() < MIN_RIM_POINTS:
            return None
        rim = points[near]
        up = fit_plane(rim, up)
        offset = rim.mean(0) @ up
    return _circle(rim, up)


def _ring_share(
    points: Floats, probability: Floats, opening: OpeningPlane, tolerance: float
) -> float:
    """Share of the probable rim that lies on the ring."""
    offsets = points - opening.centre
    level = offsets @ opening.up
    aside = np.linalg.norm(offsets - level[:, None] * opening.up, axis=1)
    on_ring = np.abs(aside - opening.radius_m) < 0.25 * opening.radius_m
    likely = probability >= 0.5
    return float((on_ring & (np.abs(level) < 1.5 * tolerance))[likely].mean())


def _looks_into(points: Floats, normals: Floats, opening: OpeningPlane, tolerance: float) -> float:
    """Share of points below the ring that face its centre, less those in or above the ring."""
    centre, up, radius = opening.centre, opening.up, opening.radius_m
    offsets = points - centre
    depth = -(offsets @ up)
    aside = np.linalg.norm(offsets + depth[:, None] * up, axis=1)
    facing = -(normals * offsets).sum(1) > 0.1 * radius
    inside = (aside < 1.05 * radius) & (depth > 2.0 * tolerance)
    lid = (aside < 0.75 * radius) & (depth < 2.0 * tolerance)
    above = depth < -2.0 * tolerance
    floor = inside & (aside < 0.9 * radius) & (normals @ up < -0.7)
    return float((inside & facing).mean() - 3.0 * lid.mean() - 3.0 * above.mean() - floor.mean())
