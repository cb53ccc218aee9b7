# SPDX-License-Identifier: Apache-2.0
"""The inner surface of a container, closed at the plane of its rim.

The cavity has the rim's outline at every depth, scaled along one profile. The profile goes through
the means of the points that face the cavity, so noise does not widen it as it widens a convex hull.
Where the inside was not seen, the profile follows the outside at the thickness of the wall.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.warping.clipping import closed_tube_faces, surface_volume
from intent_recognition.warping.frame import N_LEVELS
from intent_recognition.warping.rim import Rim

N_BINS, MIN_IN_BIN = 24, 3
"""Number of angular bins, seen from the axis at half depth, in which the profile is averaged, and
fewest points of a bin that is used."""
FLOOR_TO_WALL = 1.7
"""Thickness of the floor relative to the wall's, if the floor was seen from one side only."""
MIN_DEPTH = 0.08
"""Smallest depth of a cavity, relative to the depth of the object."""


@dataclass(frozen=True, eq=False)
class Cavity:
    """Inner surface of a container up to the plane of the rim."""

    vertices: Floats  # (n, 3) [m], in the coordinates of the points
    faces: Integers  # (m, 3), wound outward
    profile: Floats  # radius and depth (J, 2) [m], from the crest to the middle of the floor
    height_m: float  # height of the container, from the base to the crest

    @property
    def volume_m3(self) -> float:
        """Volume up to the plane of the rim."""
        return surface_volume(self.vertices, self.faces)


def fit_cavity(points: Floats, normals: Floats, rim: Rim) -> Cavity:
    """Fit the inner surface below a rim to points (n, 3) [m] with outward unit normals (n, 3)."""
    local, facing = rim.to_local(points), normals @ rim.axes.T
    depth, shape = -local[:, 0], rim.shape(local[:, 1:])
    distance = np.maximum(np.hypot(local[:, 1], local[:, 2]), 1e-12)
    radius = distance / shape
    outside = (local * facing).sum(1) > 0.0
    outward = (local[:, 1:] * facing[:, 1:]).sum(1) / distance
    inside = ~outside & (depth > 0.02 * rim.depth_m) & (radius < 1.5 * rim.radius_m)
    below = outside & (facing[:, 0] < -0.8) & (depth > 0.8 * rim.depth_m)
    outer = _levels(depth, radius, outside & (outward > 0.5), rim.depth_m)
    lid = (facing[:, 0] > 0.5) & (radius < 0.6 * rim.radius_m)
    lid &= np.abs(depth) < MIN_DEPTH * rim.depth_m
    if lid.mean() > 0.008:
        cure = "It is closed on top: open it in a mesh editor, or scan it without its lid."
        got = f"{100.0 * lid.mean():.1f} % of the points inside the rim, in its plane"
        raise ArgumentError.about("points", "a container with an open top", got, cure)
    if inside.sum() < MIN_IN_BIN * 5:
        cure = "Scan the object from above, so that its inside is seen."
        raise ArgumentError.about("points", "some inside", int(inside.sum()), cure)
    floor = inside & (facing[:, 0] > 0.6) & (radius < 0.4 * rim.radius_m)
    floor_m = float(np.median(depth[floor])) if floor.sum() >= 6 else None
    base_seen = below.mean() > 0.01
    inner = _inner(depth[inside], radius[inside], rim)
    profile, height = _profile(inner, outer, floor_m, base_seen, rim)
    if profile[-1, 1] < MIN_DEPTH * rim.depth_m:
        cure = "It may be closed on top, or scanned upside down."
        got = f"{1e3 * profile[-1, 1]:.1f} mm of {1e3 * rim.depth_m:.1f} mm"
        raise ArgumentError.about("points", "a cavity below the rim", got, cure)
    vertices, faces = _surface(profile, rim)
    return Cavity(vertices, faces, profile, height)


def _levels(depth: Floats, radius: Floats, wall: Floats, depth_m: float) -> Floats:
    """Mean depth and median radius (m, 2) of a wall, level by level."""
    row = np.where(wall, (depth / depth_m * N_LEVELS).astype(int), -1)
    levels = [row == level for level in range(N_LEVELS)]
    return np.array(
        [(depth[here].mean(), np.median(radius[here])) for here in levels if here.sum() >= 4]
    ).reshape(-1, 2)


def _inner(depth: Floats, radius: Floats, rim: Rim) -> Floats:
    """Mean radius and depth (m, 2) of the inner points, binned by angle from half the depth."""
    pole = 0.5 * float(np.quantile(depth, 0.98))
    start = np.arctan2(-pole, rim.radius_m)
    angle = (np.arctan2(depth - pole, radius) - start) / (0.5 * np.pi - start)
    row = np.clip((angle * N_BINS).astype(int), 0, N_BINS - 1)
    count = np.bincount(row, minlength=N_BINS)
    seen = count >= MIN_IN_BIN
    sums = np.stack([np.bincount(row, values, N_BINS) for values in (radius, depth)], 1)
    return sums[seen] / count[seen, None]


def _profile(
    inner: Floats, outer: Floats, floor_m: float | None, base_seen: bool, rim: Rim
) -> tuple[Floats, float]:
    """Profile from crest to floor, extrapolated along the wall where unseen; and the height."""
    floor_thickness = FLOOR_TO_WALL * _thickness(inner, outer, rim)
    height = rim.depth_m
    if floor_m is None:
        floor_m = max(height - floor_thickness, inner[:, 1].max())
        hidden = outer[(outer[:, 0] > inner[:, 1].max()) & (outer[:, 0] < floor_m)]
        wall = np.stack([hidden[:, 1] - floor_thickness / FLOOR_TO_WALL, hidden[:, 0]], 1)
        inner = np.concatenate([inner, wall])
        inner = np.concatenate([inner, [[inner[-1, 0], floor_m]]])
    elif not base_seen:
        height = max(height, floor_m + floor_thickness)
    ends = np.array([[rim.radius_m, 0.0], [0.0, floor_m]])
    return np.concatenate([ends[:1], inner, ends[1:]]), float(height)


def _thickness(inner: Floats, outer: Floats, rim: Rim) -> float:
    """Median distance between outer and inner wall, perpendicular to the wall."""
    usual = 0.05 * rim.radius_m
    wall = inner[inner[:, 0] > 0.6 * rim.radius_m]
    if len(outer) < 2 or not len(wall):
        return usual
    wall = wall[np.argsort(wall[:, 1])]
    slope = np.gradient(outer[:, 1], outer[:, 0])
    level = outer[:, 0]
    both = (level >= wall[0, 1]) & (level <= wall[-1, 1])
    if not both.any():
        return usual
    gap = (outer[:, 1] - np.interp(level, wall[:, 1], wall[:, 0])) / np.sqrt(1.0 + slope**2)
    return float(np.clip(np.median(gap[both]), 0.01 * rim.radius_m, 0.3 * rim.radius_m))


def _surface(profile: Floats, rim: Rim) -> tuple[Floats, Integers]:
    """Rings along the profile, from the floor up, closed by the floor and the plane of the rim."""
    outline = rim.outline / rim.radius_m
    n_corners, n_rings = len(outline), len(profile) - 1
    radius, depth = profile[-2::-1].T
    rings = np.empty((n_rings, n_corners, 3))
    rings[..., 0] = -depth[:, None]
    rings[..., 1:] = radius[:, None, None] * outline
    ends = [[-profile[-1, 1], 0.0, 0.0], [0.0, 0.0, 0.0]]
    vertices = rim.centre + np.concatenate([rings.reshape(-1, 3), ends]) @ rim.axes
    return vertices, closed_tube_faces(n_rings, n_corners)
