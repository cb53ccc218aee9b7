# SPDX-License-Identifier: Apache-2.0
"""Pouring to a level: how far a container is tilted to leave a given amount in it.

Brandl et al. 2014 divide the tilt by one reference, the tilt that leaves half of the volume. If the
wall leans outward, as in a bowl, the second half takes a larger share of the tilt than in a mug, so
a ratio of tilts leaves some of it in the bowl. Here the tilt is warped by two references: the tilt
at which the container begins to pour, and the tilt at which it can hold just the amount to leave.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.warping.clipping import shares_left
from intent_recognition.warping.object_warp import WarpedObject

TILTS_RAD = np.deg2rad(np.arange(0.0, 141.0, 2.5))
"""Tilts at which a container's content is computed [rad]; linear interpolation between them is
exact to 0.1 % of the volume."""
LEFT_WHEN_EMPTY = 0.01
"""Share of the volume below which a container counts as empty; the last drops depend on the rim
alone."""
FULL_SHARE = 0.9
"""Share of the second container's volume at which it counts as full, so that nothing spills."""
EMPTY, FULL = "empty", "full"


class Emptying(NamedTuple):
    """How much a container can hold at each tilt about its lip."""

    tilts_rad: Floats  # tilts, ascending from 0 (n,)
    shares: Floats  # shares of its volume that it can hold, falling from 1 (n,)
    empty_rad: float  # tilt at which `LEFT_WHEN_EMPTY` of its volume is below the lip

    def tilt_leaving(self, share: float) -> float:
        """Tilt [rad] at which the container can just hold a share of its volume."""
        return float(np.interp(-share, -self.shares, self.tilts_rad))


class Reached(NamedTuple):
    """How far the demonstrated pours tilt their container, which was half full."""

    begin_ratio: float  # tilt at which it begins to pour, relative to its tilt reference
    largest_ratio: float  # largest tilt, relative to its tilt reference
    beyond_rad: float  # largest tilt less the tilt that empties it


def emptying(warped: WarpedObject, lip: Floats, above_m: float = 0.0) -> Emptying:
    """How much a warped container can hold when it is tilted about its lip (3,) [m].

    The content rises `above_m` above the lip before it leaves: 0 for a liquid.
    """
    rim, cavity = warped.rim, warped.cavity
    outward = rim.outward(lip)
    surface = (cavity.vertices, cavity.faces, lip, rim.up, outward, TILTS_RAD)
    level = shares_left(*surface)
    empty_rad = float(np.interp(-LEFT_WHEN_EMPTY, -level, TILTS_RAD))
    shares = shares_left(*surface, above_m) if above_m else level
    return Emptying(TILTS_RAD, shares, empty_rad)


def amount_to_leave(asked: str | float, fluid_m3: float, second_m3: float) -> float:
    """Volume to leave in the container [m^3] for a requested pour.

    Args:
        asked: "empty" to pour all, "full" to fill the second container or pour all, or a number of
            millilitres, as a number or as text.
        fluid_m3: volume in the container.
        second_m3: volume that the second container can hold.

    Raises:
        ArgumentError: `asked` is none of these, or more than either container allows.
    """
    if asked == EMPTY:
        return 0.0
    if asked == FULL:
        return max(fluid_m3 - FULL_SHARE * second_m3, 0.0)
    try:
        poured_m3 = 1e-6 * float(asked)
    except ValueError:
        poured_m3 = np.nan
    if not 0.0 < poured_m3 <= min(fluid_m3, second_m3):
        expected = f"{EMPTY}, {FULL} or up to {1e6 * min(fluid_m3, second_m3):.0f} millilitres"
        cure = "Pour less than is in the cup, and than the other one holds."
        raise ArgumentError.about("pour", expected, repr(asked), cure)
    return fluid_m3 - poured_m3


def reached(ratios: Floats, tilt_reference_rad: float, shown: Emptying) -> Reached:
    """How far demonstrated pours go, from their mean tilts relative to the tilt reference (T,).

    The tilt reference is that of the demonstrated container, `shown`.

    Raises:
        ArgumentError: the pours do not tilt the container so far that it begins to pour.
    """
    largest = float(np.max(ratios))
    begin = shown.tilt_leaving(0.5) / tilt_reference_rad  # it was half full
    if not begin < largest:
        expected, got = f"a tilt ratio above {begin:.2f}, at which it begins", f"{largest:.2f}"
        raise ArgumentError.about("pours", expected, got, "Tilt the container further.")
    return Reached(begin, largest, largest * tilt_reference_rad - shown.empty_rad)


def tilts_to_level(
    ratios: Floats, far: Reached, cup: Emptying, fluid: float, left: float
) -> Floats:
    """Tilts (T,) [rad] of a demonstrated pour, for a container in which an amount is to be left.

    The tilt at which the demonstrated container began to pour is mapped to the one at which this
    container does, and the largest tilt to the one that leaves the given amount. Between them the
    tilt follows a monotone cubic without a kink. On the way back, and beyond what was demonstrated,
    it is in proportion, so that the rest stays in. To empty a container, it is tilted as far beyond
    its empty tilt as was demonstrated.

    Args:
        ratios: demonstrated tilts relative to the tilt reference (T,).
        far: how far the demonstrated pours go.
        cup: the container in the hand.
        fluid: content of the container, as a share of its volume.
        left: content to be left, as a share of its volume, below `fluid`; 0 to empty it.
    """
    begin, end = cup.tilt_leaving(fluid), cup.empty_rad + far.beyond_rad
    if left >= LEFT_WHEN_EMPTY:
        end = min(end, cup.tilt_leaving(left))
    ratios, largest = np.maximum(ratios, 0.0), far.largest_ratio
    tilt = PchipInterpolator([0.0, far.begin_ratio, largest], [0.0, begin, end])
    in_proportion = (np.arange(len(ratios)) > np.argmax(ratios)) | (ratios > largest)
    return np.where(in_proportion, end * ratios / largest, tilt(np.minimum(ratios, largest)))
