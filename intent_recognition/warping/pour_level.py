# SPDX-License-Identifier: Apache-2.0
"""Pouring to a level: how far a container is tilted to leave so much in it.

Brandl et al. 2014 divide the tilt by one reference, the tilt that leaves half. Where the wall leans
out, as a bowl's does, the second half needs a larger share of the tilt than in a mug, so that a
ratio of tilts leaves some of it in there. Here the tilt is warped by two references: where the
container at hand begins to pour, and where what is to be left is level with its lip.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.warping.clipping import shares_left
from intent_recognition.warping.object_warp import WarpedObject

TILTS_RAD = np.deg2rad(np.arange(0.0, 141.0, 2.5))
"""Tilts at which it is known what a container holds [rad]. Convention: linear interpolation is
then exact to 0.1 % of the volume."""
LEFT_WHEN_EMPTY = 0.01
"""Share of the volume below which a container counts as empty. Convention: the last drops depend
on the rim alone."""
FULL_SHARE = 0.9
"""Share of the second container's volume that fills it. Convention: a hand's care for the table."""
EMPTY, FULL = "empty", "full"


class Emptying(NamedTuple):
    """What a container holds at a tilt about its lip."""

    tilts_rad: Floats  # ascending from 0 (n,)
    shares: Floats  # of its volume that it can hold, falling from 1 (n,)
    empty_rad: float  # tilt at which `LEFT_WHEN_EMPTY` of its volume is below the lip

    def tilt_leaving(self, share: float) -> float:
        """Tilt [rad] at which it can hold a share of its volume."""
        return float(np.interp(-share, -self.shares, self.tilts_rad))


class Reached(NamedTuple):
    """How far the demonstrated pours tilt their container, which was half full."""

    begin_ratio: float  # of the tilt at which it begins to pour to its tilt reference
    largest_ratio: float  # of the largest tilt to it
    beyond_rad: float  # how far the largest tilt is beyond the one that empties it


def emptying(warped: WarpedObject, lip: Floats, above_m: float = 0.0) -> Emptying:
    """What a warped container holds when it is tilted over its lip (3,) [m].

    What is in it stands `above_m` above the lip before it leaves: 0 for a liquid.
    """
    rim, cavity = warped.rim, warped.cavity
    outward = rim.outward(lip)
    surface = (cavity.vertices, cavity.faces, lip, rim.up, outward, TILTS_RAD)
    level = shares_left(*surface)
    empty_rad = float(np.interp(-LEFT_WHEN_EMPTY, -level, TILTS_RAD))
    shares = shares_left(*surface, above_m) if above_m else level
    return Emptying(TILTS_RAD, shares, empty_rad)


def amount_to_leave(asked: str | float, fluid_m3: float, second_m3: float) -> float:
    """What is to be left in the container [m^3], for what is asked of a pour.

    Args:
        asked: "empty": all is poured; "full": as much as fills the second container, or all; a
            number: so many millilitres, as it is or as text.
        fluid_m3: what is in the container.
        second_m3: what the second one holds.

    Raises:
        ArgumentError: none of these, or more than there is.
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
    """How far demonstrated pours go, from the tilts of their mean as ratios to the reference (T,).

    That is of the demonstrated container, `shown`.

    Raises:
        ArgumentError: they do not tilt it so far that it begins to pour.
    """
    largest = float(np.max(ratios))
    begin = shown.tilt_leaving(0.5) / tilt_reference_rad  # what the demonstrated one was filled to
    if not begin < largest:
        expected, got = f"a tilt ratio above {begin:.2f}, at which it begins", f"{largest:.2f}"
        raise ArgumentError.about("pours", expected, got, "Tilt the container further.")
    return Reached(begin, largest, largest * tilt_reference_rad - shown.empty_rad)


def tilts_to_level(
    ratios: Floats, far: Reached, cup: Emptying, fluid: float, left: float
) -> Floats:
    """Tilts (T,) [rad] of a demonstrated pour, for a container that is to be left with so much.

    Where the demonstrated one began to pour, this one does; where that one was tilted most, this
    one is as far as it must be. Between these the tilt follows a monotone cubic without a kink. On
    the way back it falls in proportion, so that what is left stays in, and so it rises beyond what
    was demonstrated. What is emptied is tilted as far beyond as was demonstrated.

    Args:
        ratios: demonstrated tilts as ratios to the tilt reference (T,).
        far: how far they go.
        cup: the container in the hand.
        fluid: what is in it, as a share of its volume.
        left: what is to be left, as a share of its volume, below `fluid`; 0 to empty it.
    """
    begin, end = cup.tilt_leaving(fluid), cup.empty_rad + far.beyond_rad
    if left >= LEFT_WHEN_EMPTY:
        end = min(end, cup.tilt_leaving(left))
    ratios, largest = np.maximum(ratios, 0.0), far.largest_ratio
    tilt = PchipInterpolator([0.0, far.begin_ratio, largest], [0.0, begin, end])
    in_proportion = (np.arange(len(ratios)) > np.argmax(ratios)) | (ratios > largest)
    return np.where(in_proportion, end * ratios / largest, tilt(np.minimum(ratios, largest)))
