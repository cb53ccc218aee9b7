# SPDX-License-Identifier: Apache-2.0
"""Warped parameters: functions of a warped object (Brandl et al. II-D).

Write your own as functions of a `WarpedObject`: of its parts' points, its rim and its cavity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.warping.clipping import half_volume_angle
from intent_recognition.warping.object_warp import WarpedObject


class References(NamedTuple):
    """Values of one container by which its variables are divided."""

    opening_radius_m: float  # divides horizontal distances from the opening
    volume_m3: float  # divides amounts in the container
    height_m: float  # divides vertical distances
    tilt_rad: float  # divides the tilt


class PouringParameters(NamedTuple):
    """Parameters of one container for pouring.

    Attributes:
        opening_radius_m: mean distance of the rim from its centre, the reference of horizontal
            distances.
        volume_m3: volume up to the rim.
        height_m: height from the base to the crest of the rim, the reference of vertical distances.
        opening_centre: centre of the rim (3,) [m], at the height of its crest.
        lip_point: point of the rim over which is poured (3,) [m].
        tilt_reference_rad: tilt about the lip that leaves half of the volume.
    """

    opening_radius_m: float
    volume_m3: float
    height_m: float
    opening_centre: Floats
    lip_point: Floats
    tilt_reference_rad: float

    @property
    def references(self) -> References:
        """Reference values of the container."""
        return References(*self[:3], self.tilt_reference_rad)


def nearest_on_loop(corners: Floats, point: Floats) -> Floats:
    """Point (d,) on a closed line with corners (S, d) that is nearest to `point` (d,)."""
    along = np.roll(corners, -1, axis=0) - corners
    share = ((point - corners) * along).sum(1) / (along**2).sum(1)
    nearest = corners + np.clip(share, 0.0, 1.0)[:, None] * along
    return nearest[np.argmin(np.linalg.norm(nearest - point, axis=1))]


def pouring_parameters(warped: WarpedObject, toward: Floats | None = None) -> PouringParameters:
    """Parameters of one container for pouring.

    The lip is the point of the rim closest to the other container at `toward` (3,) [m], or by
    default opposite the handle.
    """
    rim, cavity = warped.rim, warped.cavity
    beside = rim.centre - 100.0 * rim.axes[1] if toward is None else toward
    lip = nearest_on_loop(rim.crest, beside)
    tilt_rad = half_volume_angle(cavity.vertices, cavity.faces, lip, rim.up, rim.outward(lip))
    return PouringParameters(
        rim.radius_m, cavity.volume_m3, cavity.height_m, rim.centre, lip, tilt_rad
    )
