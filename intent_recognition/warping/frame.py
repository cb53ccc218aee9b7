# SPDX-License-Identifier: Apache-2.0
"""The coarse frame of an object, from its parts (Brandl et al. II-B)."""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.warping.opening import OpeningPlane, across

N_LEVELS = 12
"""Number of levels of the height at which the outer wall is averaged."""


@dataclass(frozen=True, eq=False)
class ObjectFrame:
    """Position, orientation and size of an object.

    The origin is the centre of the opening. The paper's origin, the mean of the container's points,
    depends on which part of the object a camera sees.
    """

    origin: Floats  # centre (3,) of the opening [m]
    axes: Floats  # rows (3, 3): toward the opening; toward the handle; their cross product
    radius_m: float  # radius of the opening
    height_m: float  # from the base to the opening
    reach_m: float  # from the axis to the handle's far end, 0 without a handle
    # distance (N_LEVELS,) of the outer wall from the axis, from the base up, in opening radii
    wall: Floats

    @property
    def has_handle(self) -> bool:
        """Whether a handle was found."""
        return self.reach_m > 0.0

    def to_local(self, points: Floats) -> Floats:
        """Points (n, 3) in the frame's axes, in metres."""
        return (points - self.origin) @ self.axes.T

    def on_handle(self, local: Floats) -> Flags:
        """Whether points `local` (n, 3) [m] stand out of the wall on the handle's side, (n,)."""
        if not self.has_handle:
            return np.zeros(len(local), dtype=bool)
        radius = np.hypot(local[:, 1], local[:, 2])
        out = protruding(local[:, 0] / self.height_m, radius, self.wall * self.radius_m)
        return out & (local[:, 1] > 0.0)


def coarse_frame(points: Floats, normals: Floats, opening: OpeningPlane) -> ObjectFrame:
    """Frame of points (n, 3) [m] with outward unit normals (n, 3), given their opening.

    The second axis points to the handle. Without a handle it is the direction of the largest spread
    across the first axis, which does not matter for round objects.
    """
    up = opening.up
    offsets = points - opening.centre
    level = offsets @ up
    flat = offsets - level[:, None] * up
    radius = np.linalg.norm(flat, axis=1)
    height = -float(np.quantile(level, 0.003))
    outward = (normals * flat).sum(1) > 0.5 * radius
    wall = outer_wall(level / height, radius, outward)
    handle = protruding(level / height, radius, wall)
    direction, reach = np.zeros(3), 0.0
    if handle.mean() > 0.006:
        direction = (flat[handle] / radius[handle, None]).mean(0)
        # The corners of a square bowl stand out as well, but on all sides.
        if np.linalg.norm(direction) > 0.7:
            reach = float(np.quantile(radius[handle], 0.98))
    if not reach:
        direction = _widest(flat, up, opening)
    direction = direction - (direction @ up) * up
    direction /= np.linalg.norm(direction)
    axes = np.stack([up, direction, np.cross(up, direction)])
    wall = np.clip(wall / opening.radius_m, 0.3, 3.0)
    return ObjectFrame(opening.centre, axes, opening.radius_m, height, reach, wall)


def outer_wall(share: Floats, radius: Floats, outward: Floats) -> Floats:
    """Distance (N_LEVELS,) of the outer wall from the axis, from the base up.

    `share` is each point's height relative to the opening, from -1 to 0 in heights of the object,
    `radius` its distance from the axis [m], `outward` whether its normal points away from the axis,
    (n,) each.
    """
    row = _level(share)
    wall = np.full(N_LEVELS, np.nan)
    for level in range(N_LEVELS):
        here = radius[(row == level) & outward]
        if len(here) >= 5:
            # Below the median, because a handle is outside of the wall.
            wall[level] = np.quantile(here, 0.35)
    known = np.isfinite(wall)
    if not known.any():
        return np.full(N_LEVELS, np.median(radius))
    return np.interp(np.arange(N_LEVELS), np.flatnonzero(known), wall[known])


def protruding(share: Floats, radius: Floats, wall: Floats) -> Flags:
    """Whether points (n,) stand out of the wall (N_LEVELS,) by more than a quarter."""
    return radius > 1.25 * np.maximum(wall[_level(share)], 0.6 * np.median(wall))


def _level(share: Floats) -> Floats:
    """Level (n,) of each height from -1 to 0."""
    return np.clip(((1.0 + share) * N_LEVELS).astype(int), 0, N_LEVELS - 1)


def _widest(flat: Floats, up: Floats, opening: OpeningPlane) -> Floats:
    """Direction (3,) in which points spread most across the axis, signed toward more of them."""
    plane = np.stack(across(up), 1)
    local = flat @ plane
    _, vectors = np.linalg.eigh(local.T @ local)
    direction = plane @ vectors[:, 1]
    along = flat @ direction
    return direction if (along**3).sum() >= 0.0 else -direction
