# SPDX-License-Identifier: Apache-2.0
"""Warped parameters: functions of a warped object (Brandl et al. II-D).

Own ones are functions of the warped object as well: of its parts' points, its rim and its cavity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.warping.clipping import half_volume_angle
from intent_recognition.warping.object_warp import WarpedObject


class References(NamedTuple):
    """What the variables of one container are divided by."""

    opening_radius_m: float  # for horizontal distances from its opening
    volume_m3: float  # for amounts in it
    height_m: float  # for vertical distances
    tilt_rad: float  # for its tilt


class PouringParameters(NamedTuple):
    """The parameters of pouring, of one container.

    Attributes:
        opening_radius_m: mean distance of the rim from its centre, the reference of horizontal
            distances into it.
        volume_m3: what it holds up to the rim.
        height_m: from the base to the crest of the rim, the reference of vertical distances.
        opening_centre: of the rim (3,) [m], at the height of its crest.
        lip_point: (3,) [m].
        tilt_reference_rad: tilt about the lip that leaves half of the volume.
    """

    opening_radius_m: float
    volume_m3: float
    height_m: float
    opening_centre: Floats
    lip_point: Floats
    tilt_reference_rad: float


def lip_point(warped: WarpedObject, toward: Floats | None = None) -> Floats:
    """Point (3,) of the rim over which is poured [m].

    It is the one closest to the other container, at `toward` (3,) [m]; else opposite to the handle.
    """
    rim = warped.rim
    return nearest_on_loop(
        rim.crest, rim.centre - 100.0 * rim.axes[1] if toward is None else toward
    )


def nearest_on_loop(corners: Floats, point: Floats) -> Floats:
    """The point (d,) nearest to another (d,) on a closed line with corners (S, d)."""
    along = np.roll(corners, -1, axis=0) - corners
    share = ((point - corners) * along).sum(1) / (along**2).sum(1)
    nearest = corners + np.clip(share, 0.0, 1.0)[:, None] * along
    return nearest[np.argmin(np.linalg.norm(nearest - point, axis=1))]


def tilt_reference(warped: WarpedObject, lip: Floats | None = None) -> float:
    """Tilt about the lip (default: `lip_point`) that leaves half of the volume [rad]."""
    rim, cavity = warped.rim, warped.cavity
    lip = lip_point(warped) if lip is None else lip
    return half_volume_angle(cavity.vertices, cavity.faces, lip, rim.up, rim.outward(lip))


def pouring_parameters(warped: WarpedObject, toward: Floats | None = None) -> PouringParameters:
    """All that pouring needs of one container; the other one is at `toward` (3,) [m], if any."""
    rim, cavity = warped.rim, warped.cavity
    lip = lip_point(warped, toward)
    tilt_rad = tilt_reference(warped, lip)
    return PouringParameters(
        rim.radius_m, cavity.volume_m3, cavity.height_m, rim.centre, lip, tilt_rad
    )


def references(parameters: PouringParameters) -> References:
    """Reference values of a warped container."""
    return References(
        parameters.opening_radius_m,
        parameters.volume_m3,
        parameters.height_m,
        parameters.tilt_reference_rad,
    )
