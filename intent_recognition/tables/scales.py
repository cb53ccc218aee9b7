# SPDX-License-Identifier: Apache-2.0
"""Factors between the units of lengths and angles."""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import DofError
from intent_recognition.signals import UNITS, spelled

PER_BASE = {
    "m": (1, 1), "dm": (1, 10), "cm": (1, 100), "mm": (1, 1000), "um": (1, 10**6),
    "in": (127, 5000), "ft": (381, 1250), "rad": (1, 1), "deg": (np.pi, 180),
}  # fmt: skip
"""What each unit is, in metres or radians, as a quotient that rounds once."""
ANGLES = ("deg", "rad")
LENGTHS = tuple(unit for unit in UNITS if unit not in ANGLES)


def check_convertible(unit: str, wanted: str, place: str) -> None:
    """Make sure that there is a factor between two units."""
    if spelled(unit) != wanted and scale_between(spelled(unit), wanted) is None:
        known = f"{wanted}, or one of {', '.join(UNITS)}, for lengths and angles"
        raise DofError.about(place, known, unit, "Convert the columns, or correct the unit.")


def convert(values: Floats, unit: str, wanted: str) -> Floats:
    """Values in another unit; as they are where it is the same or unknown."""
    scale = scale_between(spelled(unit), wanted)
    if scale is None or scale[0] == scale[1]:
        return values
    multiplier, divisor = scale
    return values * multiplier / divisor  # a quotient of small integers rounds once


def scale_between(unit: str, wanted: str) -> tuple[float, float] | None:
    """Factor and divisor from one unit to the other, None where there is none."""
    (one, _, per), (other, _, other_per) = unit.partition("/"), wanted.partition("/")
    if unit == wanted:
        return 1, 1
    if per != other_per or one not in PER_BASE or other not in PER_BASE:
        return None
    if (one in ANGLES) != (other in ANGLES):
        return None
    (a, b), (c, d) = PER_BASE[one], PER_BASE[other]
    shared = np.gcd(a * d, b * c) if one not in ANGLES else 1
    return a * d / shared, b * c / shared
