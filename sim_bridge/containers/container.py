# SPDX-License-Identifier: Apache-2.0
"""A container with its ground truth, all in the object's frame.

In this frame, in metres, z is up along the container's axis, the base lies in the plane z = 0, a
handle points toward -x and the lip toward +x.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from intent_recognition.array_types import Floats
from intent_recognition.warping import half_volume_angle, nearest_on_loop


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
