# SPDX-License-Identifier: Apache-2.0
"""Units of lengths and angles as files spell them, and the factors between them."""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import DofError

UNITS = {
    "m": ("m", "metre", "meter"),
    "dm": ("dm", "decimetre", "decimeter"),
    "cm": ("cm", "centimetre", "centimeter"),
    "mm": ("mm", "millimetre", "millimeter"),
    "um": ("um", "\u00b5m", "\u03bcm", "micrometre", "micrometer", "micron"),
    "in": ("in", "inch", "inches"),
    "ft": ("ft", "foot", "feet"),
    "deg": ("deg", "degree", "\u00b0"),
    "rad": ("rad", "radian"),
}
"""How files spell each unit, in lower case and but for a plural s."""
PER_BASE = {
    "m": (1, 1), "dm": (1, 10), "cm": (1, 100), "mm": (1, 1000), "um": (1, 10**6),
    "in": (127, 5000), "ft": (381, 1250), "rad": (1, 1), "deg": (np.pi, 180),
}  # fmt: skip
"""What each unit is, in metres or radians, as a quotient that rounds once."""
ANGLES = ("deg", "rad")


def spelled(unit: str) -> str:
    """A unit of length or angle as it is written here, whatever a file calls it; else as it is."""
    one, slash, per = unit.strip().partition("/")
    low = one.strip().lower()
    for name, known in UNITS.items():
        if low in known or low.removesuffix("s") in known:
            return f"{name}{slash}{per.strip()}"
    return unit.strip()


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
