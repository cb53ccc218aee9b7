# SPDX-License-Identifier: Apache-2.0
"""The rim of an opening as a closed line."""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.warping.frame import ObjectFrame
from intent_recognition.warping.opening import MIN_RIM_POINTS, fit_circle, fit_plane

N_HARMONICS = 8
"""Number of harmonics of the rim's radius over direction: enough for a rounded square."""


@dataclass(frozen=True, eq=False)
class Rim:
    """The rim's crest in the plane of the opening."""

    centre: Floats  # (3,) [m]
    axes: Floats  # rows (3, 3): out of the opening; toward the handle; their cross product
    outline: Floats  # crest (S, 2) [m] along the second and third axis, about the centre
    depth_m: float  # depth of the lowest point of the object below the crest

    @property
    def up(self) -> Floats:
        """Unit axis (3,) out of the opening."""
        return self.axes[0]

    @property
    def radius_m(self) -> float:
        """Mean distance of the crest from its centre, over its length."""
        edges = np.linalg.norm(np.roll(self.outline, -1, axis=0) - self.outline, axis=1)
        radii = np.linalg.norm(self.outline, axis=1)
        return float(np.average(radii, weights=edges + np.roll(edges, 1)))

    @property
    def crest(self) -> Floats:
        """The crest (S, 3) [m]."""
        return self.centre + self.outline @ self.axes[1:]

    def shape(self, flat: Floats) -> Floats:
        """Distance (n,) of the crest from its centre, in mean radii, in the direction of points.

        The points (n, 2) are relative to the centre, along the second and third axis.
        """
        radii = np.linalg.norm(self.outline, axis=1) / self.radius_m
        corners = np.arange(len(radii)) * 2.0 * np.pi / len(radii)
        return np.interp(np.arctan2(flat[:, 1], flat[:, 0]), corners, radii, period=2.0 * np.pi)

    def outward(self, point: Floats) -> Floats:
        """Unit vector (3,) in the plane of the opening, from its axis toward a point (3,)."""
        across = point - self.centre
        across = across - (across @ self.up) * self.up
        return across / np.linalg.norm(across)

    def to_local(self, points: Floats) -> Floats:
        """Points (n, 3) in the rim's axes, in metres."""
        return (points - self.centre) @ self.axes.T


def fit_rim(points: Floats, normals: Floats, frame: ObjectFrame) -> Rim:
    """Fit plane, centre and outline to rim points (n, 3) [m] with outward unit normals (n, 3).

    The distance from the centre is modelled as a smooth function of the direction plus the
    thickness of the rim times the outward component of the normal. The crest is where the normal
    points along the axis, so it does not matter which side of the rim a camera saw.
    """
    if len(points) < MIN_RIM_POINTS:
        cure = "Scan the opening from above, with more points."
        got = f"{len(points)} points on the rim"
        raise ArgumentError.about("points", f"at least {MIN_RIM_POINTS}", got, cure)
    points, normals, up = _in_plane(points, normals, frame.axes[0])
    handle = frame.axes[1] - (frame.axes[1] @ up) * up
    handle /= np.linalg.norm(handle)
    axes = np.stack([up, handle, np.cross(up, handle)])
    local, facing = (points - frame.origin) @ axes.T, normals @ axes.T
    middle, _ = fit_circle(local[:, 1:])
    for _ in range(2):
        flat = local[:, 1:] - middle
        radius = np.maximum(np.hypot(*flat.T), 1e-12)
        outward = (flat * facing[:, 1:]).sum(1) / radius
        coefficients = _fit_harmonics(np.arctan2(flat[:, 1], flat[:, 0]), radius, outward)
        # The first harmonic is an offset of the centre.
        middle = middle + coefficients[[1, 1 + N_HARMONICS]]
    corners = np.arange(48)
    angles = corners * 2.0 * np.pi / len(corners)
    coefficients[[1, 1 + N_HARMONICS]] = 0.0
    radii = _harmonics(angles) @ coefficients[:-1]
    outline = radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)
    level = _crest_level(local[:, 0], facing[:, 0])
    centre = frame.origin + np.array([level, *middle]) @ axes
    return Rim(centre, axes, outline, frame.height_m + level)


def _harmonics(angles: Floats) -> Floats:
    """Constant, cosines and sines (n, 1 + 2 N_HARMONICS) of angles (n,)."""
    orders = np.arange(1, N_HARMONICS + 1)
    turned = angles[:, None] * orders
    return np.column_stack([np.ones(len(angles)), np.cos(turned), np.sin(turned)])


def _fit_harmonics(angles: Floats, radii: Floats, outward: Floats) -> Floats:
    """Coefficients of the radius over direction, and of the normal's outward component."""
    design = np.column_stack([_harmonics(angles), outward])
    orders = np.arange(1, N_HARMONICS + 1)
    penalty = 0.02 * np.concatenate([[0.0], orders**2, orders**2, [0.0]])
    penalty[[1, 1 + N_HARMONICS]] = 0.0
    normal = design.T @ design + np.diag(penalty + 1e-9)
    return np.linalg.solve(normal, design.T @ radii)


def _crest_level(level: Floats, upward: Floats) -> float:
    """Height of the crest, where a rounded rim's normal points along the axis.

    On a round rim the height falls in proportion to 1 - upward, on a flat rim not at all. A line
    fitted to the height averages noise out, which the highest points would not.
    """
    top = upward > 0.3
    if top.sum() < MIN_RIM_POINTS:
        return float(np.quantile(level, 0.9))
    drop = 1.0 - upward[top]
    spread = drop - drop.mean()
    slope = min((spread @ level[top]) / (spread @ spread + 1e-6 * len(drop)), 0.0)
    return float(level[top].mean() - slope * drop.mean())


def _in_plane(points: Floats, normals: Floats, up: Floats) -> tuple[Floats, Floats, Floats]:
    """Rim points near their common plane, their normals, and its unit normal (3,)."""
    for _ in range(3):
        up = fit_plane(points, up)
        distance = (points - points.mean(0)) @ up
        kept = np.abs(distance) < 2.5 * distance.std() + 1e-12
        if kept.all() or kept.sum() < MIN_RIM_POINTS:
            break
        points, normals = points[kept], normals[kept]
    return points, normals, fit_plane(points, up)
