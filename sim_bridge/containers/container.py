# SPDX-License-Identifier: Apache-2.0
"""A container with its ground truth, all in the object's frame.

In this frame, in metres, z is up along the container's axis, the base lies in the plane z = 0, a
handle points toward -x and the lip toward +x.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.warping import Part, half_volume_angle, nearest_on_loop


@dataclass(frozen=True)
class Sections:
    """The wall as stacked rings at R heights with S corners each.

    Between two neighbouring rings the wall is linear: the eight corners s and s + 1, inner and
    outer, of rings r and r + 1 form a convex piece of it. On the uppermost ring, the crest, inner
    and outer outline coincide. The floor is the convex hull of `base` at height 0 and `outer[0]` at
    `heights_m[0]`; the cavity begins at its upper side.
    """

    heights_m: Floats  # (R,), rising, from the cavity's floor to the crest
    inner: Floats  # outline of the cavity (R, S, 2) in metres, counter-clockwise from +x
    outer: Floats  # outline of the wall (R, S, 2) in metres, at the same polar angles
    base: Floats  # outline of the base (S, 2) in metres


@dataclass(frozen=True)
class Container:
    """A cup or bowl with its ground truth."""

    name: str
    # surface of the solid: wall and handle, each closed; the handle's ends are inside the wall
    mesh: trimesh.Trimesh
    inner: trimesh.Trimesh  # the cavity up to the plane of the rim, a closed surface
    sections: Sections  # the wall without its handle
    handle: trimesh.Trimesh | None
    # mean distance of the crest of the rim from its centre, over its length
    opening_radius_m: float
    height_m: float  # from the base to the crest
    inner_volume_m3: float
    opening_centre: Floats  # centre (3,) of the opening, in the plane of the rim

    @cached_property
    def lip_point(self) -> Floats:
        """Lip (3,) toward +x, away from the handle."""
        return self.lip_toward(np.array([10.0, 0.0, 0.0]))

    @cached_property
    def tilt_reference_rad(self) -> float:
        """Tilt about `lip_point` at which half of the cavity is above it."""
        return self.tilt_reference_about(self.lip_point)

    def lip_toward(self, point: Floats) -> Floats:
        """Point (3,) of the crest nearest to `point` (3,), the other container's position."""
        nearest = nearest_on_loop(self.sections.outer[-1], np.asarray(point)[:2])
        return np.append(nearest, self.height_m)

    def tilt_reference_about(self, lip: Floats) -> float:
        """Tilt [rad] about the lip (3,) at which half of the cavity is above the lip."""
        outward = (lip - self.opening_centre) * [1.0, 1.0, 0.0]
        return half_volume_angle(
            self.inner.vertices,
            self.inner.faces,
            lip,
            np.array([0.0, 0.0, 1.0]),
            outward / np.linalg.norm(outward),
        )

    def labels(self, points: Floats) -> NDArray[np.integer]:
        """Part (n,), values of `Part`, of surface points (n, 3) in the object's frame."""
        points = np.asarray(points, dtype=float)
        parts = np.full(len(points), int(Part.CONTAINER))
        if self.handle is not None:
            outside = self._outer_distance(points)
            parts[(outside > 0.0008) & (points[:, 0] < 0.0)] = int(Part.HANDLE)
        parts[(points[:, 2] > self.height_m - 0.0025) & (parts != Part.HANDLE)] = int(Part.RIM)
        return parts

    def _outer_distance(self, points: Floats) -> Floats:
        """Horizontal distance (n,) by which points are outside of the wall."""
        heights = np.concatenate([[0.0], self.sections.heights_m])
        outlines = np.concatenate([self.sections.base[None], self.sections.outer])
        radii = np.linalg.norm(outlines, axis=2)
        n_corners = radii.shape[1]
        angle = np.arctan2(points[:, 1], points[:, 0]) % (2.0 * np.pi)
        corner = np.rint(angle / (2.0 * np.pi) * n_corners).astype(int) % n_corners
        row = np.interp(points[:, 2], heights, np.arange(len(heights)))
        low = np.minimum(row.astype(int), len(heights) - 2)
        share = row - low
        wall = (1.0 - share) * radii[low, corner] + share * radii[low + 1, corner]
        return np.linalg.norm(points[:, :2], axis=1) - wall
