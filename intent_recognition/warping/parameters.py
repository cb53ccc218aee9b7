# SPDX-License-Identifier: Apache-2.0
"""Warped parameters: functions of a warped object (Brandl et al. II-D).

Each takes the warped object and gives a number or a point in the target's coordinates. Own ones
are functions of the same kind; they may use these, the parts' points, the rim and the cavity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.warping.clipping import half_volume_angle
from intent_recognition.warping.object_warp import WarpedObject

Parameter = Callable[[WarpedObject], float | NDArray[np.float64]]
FAR_M = 100.0
"""Distance [m] of a point that stands for a direction."""
LEVEL_RAD = 0.05
"""An opening tilted by less is level [rad]."""


class PouringParameters(NamedTuple):
    """The parameters of pouring, of one container.

    Attributes:
        opening_radius_m: reference of horizontal distances into it.
        volume_m3: what it holds up to the rim.
        height_m: reference of vertical distances above it.
        opening_centre: (3,) [m].
        lip_point: (3,) [m].
        tilt_reference_rad: tilt about the lip that leaves half of the volume.
    """

    opening_radius_m: float
    volume_m3: float
    height_m: float
    opening_centre: NDArray[np.float64]
    lip_point: NDArray[np.float64]
    tilt_reference_rad: float


def opening_radius(warped: WarpedObject) -> float:
    """Mean distance of the rim from its centre [m]."""
    return warped.rim.radius_m


def opening_centre(warped: WarpedObject) -> NDArray[np.float64]:
    """Centre (3,) of the rim [m], at the height of its crest."""
    return warped.rim.centre


def volume(warped: WarpedObject) -> float:
    """What the container holds up to the rim [m^3]."""
    return warped.cavity.volume_m3


def height(warped: WarpedObject) -> float:
    """From the base to the crest of the rim [m]."""
    return warped.cavity.height_m


def lip_point(
    warped: WarpedObject,
    toward: NDArray[np.float64] | None = None,
    vertical: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Point (3,) of the rim over which is poured [m].

    Args:
        warped: the container.
        toward: place (3,) of the other container [m]; the lip is the rim point closest to it.
        vertical: unit vector (3,) against gravity; without `toward` the lip is the lowest rim
            point, and while the rim is level that opposite to the handle.
    """
    rim = warped.rim
    if toward is None:
        direction = -rim.axes[1]
        if vertical is not None:
            downhill = (vertical @ rim.up) * rim.up - vertical
            if np.linalg.norm(downhill) > LEVEL_RAD:
                direction = downhill
        toward = rim.centre + FAR_M * direction / np.linalg.norm(direction)
    crest = rim.crest
    along = np.roll(crest, -1, axis=0) - crest
    share = np.einsum("ij,ij->i", toward - crest, along) / np.einsum("ij,ij->i", along, along)
    nearest = crest + np.clip(share, 0.0, 1.0)[:, None] * along
    return nearest[np.argmin(np.linalg.norm(nearest - toward, axis=1))]


def tilt_reference(warped: WarpedObject, lip: NDArray[np.float64] | None = None) -> float:
    """Tilt about the lip (default: `lip_point`) that leaves half of the volume [rad]."""
    rim, cavity = warped.rim, warped.cavity
    lip = lip_point(warped) if lip is None else lip
    return half_volume_angle(cavity.vertices, cavity.faces, lip, rim.up, rim.outward(lip))


PARAMETERS: Mapping[str, Parameter] = MappingProxyType(
    {
        "opening_radius_m": opening_radius,
        "volume_m3": volume,
        "height_m": height,
        "opening_centre": opening_centre,
        "lip_point": lip_point,
        "tilt_reference_rad": tilt_reference,
    }
)


def evaluate(
    warped: WarpedObject, parameters: Mapping[str, Parameter] = PARAMETERS
) -> dict[str, float | NDArray[np.float64]]:
    """Values of parameters, by name."""
    return {name: parameter(warped) for name, parameter in parameters.items()}


def pouring_parameters(
    warped: WarpedObject,
    toward: NDArray[np.float64] | None = None,
    vertical: NDArray[np.float64] | None = None,
) -> PouringParameters:
    """All that pouring needs of one container.

    Args:
        warped: the container.
        toward: place (3,) of the other container [m], if there is one.
        vertical: unit vector (3,) against gravity, if it is known.
    """
    lip = lip_point(warped, toward, vertical)
    return PouringParameters(
        opening_radius(warped),
        volume(warped),
        height(warped),
        opening_centre(warped),
        lip,
        tilt_reference(warped, lip),
    )
