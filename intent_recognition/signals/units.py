# SPDX-License-Identifier: Apache-2.0
"""Units: which DOFs may be measured by one scale, and whether numbers can be in their unit.

Constants in metres and radians hold for these two alone. Newtons, pixels and all else are measured
by how far the demonstrations go in them, so that nothing depends on how large their unit is.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from unicodedata import digit

import numpy as np

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.signals.arrays import OFTEN_TIMES
from intent_recognition.signals.onset import peak_speed
from intent_recognition.signals.signal import MIN_SAMPLES, Signal
from intent_recognition.signals.turns import TURNS

SPATIAL_UNITS = ("m", "rad")
"""Units that constants are given in. Their numbers are added, too: over the reach of an arm, a
radian at a joint is a metre at the hand. Convention."""
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
"""How people spell each unit, in lower case and but for a plural s."""
PRODUCT = re.compile(
    r"(?<=\w)[ .*\u00b7\u22c5]s(?:\^|\*\*)?[-\u2212\u207b]([1-3\u00b9\u00b2\u00b3])"
)
"""Where a unit is divided by seconds in another form: `mm s^-1`, `rad s-2`."""
OFTEN_TAKEN = {
    "m": {"millimetres": 1000.0, "centimetres": 100.0},
    "rad": {"degrees": 180.0 / np.pi},
}
"""Units that are recorded in place of another, with how many of them make it."""
SELDOM_TAKEN = {"m": {"inches": 1.0 / 0.0254}}
"""Likewise, but so near to one of these that only learned places tell them apart."""
NAMES = {"m": "metres", "rad": "radians"}
"""Units in words."""
FASTEST = {"m": 20.0, "rad": 25.0}
"""Speed that nothing reaches at work, by unit [m/s, rad/s]. Convention: a thrown ball is faster;
no joint of an industrial arm turns four times a second."""
WIDEST = {"m": 20.0, "rad": 8.0 * np.pi}
"""Extent of a movement beyond which its unit is another, by unit [m, rad]. Convention: larger than
a cell; four turns."""
USUAL = {"m": 0.5, "rad": 1.0}
"""Extent of a reach, by unit [m, rad]: of two factors that explain too large numbers, the one that
comes nearer to it is named. Convention."""
FAST = 10.0
"""Speed that is doubted [m/s, rad/s]. Convention: the fastest joints of cobots turn with 6, a hand
reaches with 3."""
OUTSIDE_RAD = 0.1
"""By how much a recorded joint may be outside the range of its URDF [rad]. Convention: calibration,
and limits in software that are narrower."""
SAME_SCALE = 3.0
"""Ratio by which recordings in one unit differ at most in level and extent. Convention: half of
the step between any two units, on a scale of logarithms, is more."""
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 2e-4, 4.0
"""Steps between samples beyond which times are in another unit [s]. Convention: no tracker is
faster than 5 kHz; a movement with a sample in four seconds cannot be learned from."""
USUAL_PERIODS_S = 1e-3, 0.5
"""Steps of trackers and encoders [s]. Convention; their ratio is less than a thousand, so that one
unit at most explains other steps."""
FAR_SHARE = 0.1
"""How far outside what was learned numbers of another unit are, in learned extents and parts of the
factor between the units. Convention: 100 extents for millimetres, 6 for degrees; a reach that
begins within a tenth of its extent from the origin is judged once it has left that."""


class Known(NamedTuple):
    """What the description of an arm says of a signal."""

    # smallest positions of the DOFs (d,); empty where that is not known
    lower: Floats = np.empty(0)
    upper: Floats = np.empty(0)  # largest positions (d,)
    widest: float = np.inf  # extent that no DOF can have; infinite where that is not known


class Misfit(NamedTuple):
    """Why numbers are hardly in their unit."""

    reason: str  # a sentence with the names of the DOFs, and the likely unit
    factor: float  # by which the numbers are too large; NaN where no usual unit explains them
    certain: bool  # whether no movement can look like this
    # the last sentence of the reason, which is the same for all recordings of a kind
    likely: str = ""


class Size(NamedTuple):
    """How large the numbers of a signal are: root mean square and largest extent."""

    unit: str
    level: float
    extent: float


def spelled(unit: str) -> str:
    """A unit of length or angle as it is written here, whatever others call it; else as it is."""
    one, slash, per = as_quotient(unit.strip()).partition("/")
    low = one.strip().lower()
    for name, known in UNITS.items():
        if low in known or low.removesuffix("s") in known:
            return f"{name}{slash}{per.strip()}"
    return unit.strip()


def as_quotient(unit: str) -> str:
    """A text with `mm s^-1` in it with `mm/s` instead, as units are written here."""
    return PRODUCT.sub(lambda found: f"/s^{digit(found[1])}".removesuffix("^1"), unit)


def commensurate(units: Sequence[str]) -> list[Integers]:
    """Indices of DOFs (D,) whose numbers may be added: metres and radians, then each other unit."""
    kinds = ["" if unit in SPATIAL_UNITS else f"in {unit}" for unit in units]
    return [np.flatnonzero([own == kind for own in kinds]) for kind in sorted(set(kinds))]


def is_spatial(units: Sequence[str]) -> Flags:
    """Whether each DOF is in metres or radians, (D,)."""
    return np.array([unit in SPATIAL_UNITS for unit in units], dtype=bool)


def misfit(signal: Signal, known: Known | None = None) -> Misfit | None:
    """Why a movement is hardly in its unit; None where it may be, and for other units than m, rad.

    It was recorded, or converted from a table; `known` is of the arm that moved.
    """
    unit, values = signal.unit, signal.values
    if unit not in SPATIAL_UNITS or not values.size:
        return None
    known = Known() if known is None else known
    outside = _outside(signal, known)
    if outside is not None:
        return outside
    extent = float(np.ptp(values, axis=0).max())
    speed = peak_speed(signal.seconds(int(signal.stamps_ns[0])), values)
    farthest = float(np.abs(values).max())
    turn = TURNS["rad"]  # few joints turn farther to either side
    turned = unit == "rad" and farthest > turn
    turned = turned and max(extent / turn, speed / FAST, farthest / WIDEST[unit]) > 1.0
    too_wide = extent > known.widest
    never = too_wide or extent > WIDEST[unit] or speed > FASTEST[unit]
    if not (never or turned or (unit == "m" and speed > FAST)):
        return None
    if unit == "m" and (stray := _stray(signal)) is not None:
        return stray
    reason = f"{in_words(signal)} moves over {extent:.3g} {unit}"
    reason += f" at up to {speed:.3g} {unit}/s" if speed > FAST else ""  # few samples say less
    reason += f" and is at {farthest:.3g} {unit}" if turned else ""
    reason += f", and the arm cannot reach over {known.widest:.3g} {unit}" if too_wide else ""
    name, factor = _nearest_usual(unit, extent)
    certain = unit == "m" and never  # a joint without limits may turn as far, a toy's as fast
    likely = taken_for(unit, {name: factor})
    said = "cannot be" if certain else "is hardly"
    text = f"{reason}: the unit {said} {NAMES[unit]}. {likely}"
    return Misfit(text, factor, certain, likely)


def _stray(signal: Signal) -> Misfit | None:
    """Few samples (T, d) [m] far from all others, without which nothing is odd; None if not so."""
    values = signal.values
    away = np.linalg.norm(values - np.median(values, axis=0), axis=1)
    far = away > 0.5 * away.max()
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)[far[1:] != far[:-1]]
    if far.mean() > 0.1 or not steps.size or steps.min() < 0.5 * away.max():
        return None
    if misfit(Signal(signal.names, signal.stamps_ns[~far], values[~far], signal.unit)) is not None:
        return None
    row = int(np.argmax(away))
    at_s = (signal.stamps_ns[row] - signal.stamps_ns[0]) * 1e-9
    reason = (
        f"{in_words(signal)} at {at_s:.3g} s is {away[row]:.3g} m from its median, in {far.sum()}"
        f" of {far.size} samples so far. Likely a tracker's error: leave these samples out."
    )
    return Misfit(reason, np.nan, certain=True)


def time_misfit(signal: Signal) -> Misfit | None:
    """Why times are hardly in seconds; None where they may be."""
    if len(signal.stamps_ns) < MIN_SAMPLES:
        return None
    period_s = float(np.median(np.diff(signal.stamps_ns))) * 1e-9
    if SHORTEST_PERIOD_S <= period_s <= LONGEST_PERIOD_S:
        return None
    length_s = float(signal.stamps_ns[-1] - signal.stamps_ns[0]) * 1e-9
    reason = f"{in_words(signal)} has a sample every {period_s:.3g} s, over {length_s:.3g} s"
    for name, factor in OFTEN_TIMES.items():
        for scale, text in ((factor, f"{name} for seconds"), (1.0 / factor, f"seconds for {name}")):
            if USUAL_PERIODS_S[0] <= period_s / scale <= USUAL_PERIODS_S[1]:
                said = f"{reason}. Likely {text} (a factor of {scale:.4g}): correct the times."
                return Misfit(said, scale, certain=True)
    return Misfit(f"{reason}. Record it at 10 Hz or more.", np.nan, certain=False)


def learned_misfit(
    names: Sequence[str], unit: str, values: Floats, learned: Known
) -> Misfit | None:
    """Why one sample (d,) is hardly in the unit that was learned; None where it may be.

    `learned` is where the DOFs were, as far as the library knows.
    """
    lower, upper = learned.lower, learned.upper
    excess = np.maximum(lower - values, values - upper)
    farthest = int(np.argmax(excess))
    far = excess[farthest] / max(float(np.max(upper - lower)), 1e-9)
    likely = other_units(unit, values, learned) if far > 0.0 else {}
    if not likely or far <= FAR_SHARE * min(likely.values()):
        return None
    reason = (
        f"{names[farthest]} is at {values[farthest]:.3g} {unit}, and was learned between"
        f" {lower[farthest]:.3g} and {upper[farthest]:.3g} {unit}"
    )
    return Misfit(f"{reason}. {taken_for(unit, likely)}", next(iter(likely.values())), certain=True)


def other_units(unit: str, values: Floats, learned: Known) -> dict[str, float]:
    """Units, and their factors, in which a sample (d,) lies where the DOFs were."""
    return {
        name: factor
        for name, factor in (OFTEN_TAKEN.get(unit, {}) | SELDOM_TAKEN.get(unit, {})).items()
        if np.all((values / factor >= learned.lower) & (values / factor <= learned.upper))
    }


def place_misfit(position_m: Floats) -> Misfit | None:
    """Why the place of a tracked body (3,) is hardly in metres; None where it may be."""
    distance_m = float(np.linalg.norm(position_m))
    return length_misfit(distance_m, f"is {distance_m:.3g} m from the origin of its frame")


def scene_misfit(signal: Signal) -> Misfit | None:
    """As `misfit`, of a thing that may stand still: where it is (T, d) counts, too."""
    found = misfit(signal)
    if found is None and signal.unit == "m" and signal.values.size:
        found = place_misfit(np.median(signal.values, axis=0))
        found = found and found._replace(reason=f"{in_words(signal)} {found.reason}")
    return found


def length_misfit(length_m: float, said: str, do: str = "record") -> Misfit | None:
    """Why a length, of an arm or from an origin, is hardly in metres; None where it may be.

    `said` is the same in words, and `do` what helps, in metres.
    """
    if length_m <= WIDEST["m"]:
        return None
    name, factor = _nearest_usual("m", length_m)
    likely = {name: factor}
    if length_m / max(OFTEN_TAKEN["m"].values()) < 0.3:  # [m]: so near, either may be it
        likely = OFTEN_TAKEN["m"]
    text = taken_for("m", likely, do)
    return Misfit(f"{said}. {text}", factor, certain=False, likely=text)


def _nearest_usual(unit: str, length: float) -> tuple[str, float]:
    """The unit that is taken for another, and its factor, by which a length is most usual."""
    return min(
        OFTEN_TAKEN[unit].items(), key=lambda item: abs(np.log(length / item[1] / USUAL[unit]))
    )


def in_words(signal: Signal) -> str:
    """Names of a signal: its DOFs, of many the first."""
    return ", ".join(signal.names[:1]) + (", ..." if len(signal.names) > 1 else "")


def _outside(signal: Signal, known: Known) -> Misfit | None:
    """Positions outside the ranges of the joints: farther than these are wide in another unit."""
    unit, values = signal.unit, signal.values
    if not known.lower.size:
        return None
    excess = np.maximum(known.lower - values, values - known.upper)
    if excess.max() <= OUTSIDE_RAD:
        return None
    column = int(np.unravel_index(np.argmax(excess), excess.shape)[1])
    value = values[np.argmax(excess[:, column]), column]
    where = (
        f"{signal.names[column]} is at {value:.3g} {unit}, and its limits are"
        f" {known.lower[column]:.3g} and {known.upper[column]:.3g} {unit}"
    )
    far = np.any(excess > known.upper - known.lower)
    for name, factor in OFTEN_TAKEN[unit].items() if far else ():
        own = values / factor
        fits = np.all(np.maximum(known.lower - own, own - known.upper) <= OUTSIDE_RAD)
        if fits or excess.max() > WIDEST[unit]:
            return Misfit(f"{where}. {taken_for(unit, {name: factor})}", factor, certain=True)
    cause = "another arm than the URDF's, or whole turns that were counted"
    return Misfit(f"{where}. Likely {cause}.", np.nan, certain=False)


def size_of(unit: str, values: Floats) -> Size:
    """Of numbers (T, d)."""
    if not values.size:
        return Size(unit, 0.0, 0.0)
    level = float(np.sqrt(np.mean(np.square(values))))
    return Size(unit, level, float(np.ptp(values, axis=0).max()))


def median_size(sizes: Sequence[Size]) -> Size:
    """Of the same signal in several recordings."""
    unit, *_ = (size.unit for size in sizes)
    level, extent = np.median([size[1:] for size in sizes], axis=0)
    return Size(unit, float(level), float(extent))


def differing_unit(one: Size, usual: Size) -> Misfit | None:
    """Whether a signal is in another unit than the same one of most recordings; None if not."""
    if min(*one[1:], *usual[1:]) <= 0.0:
        return None
    ratio = np.log(one[1:]) - np.log(usual[1:])
    for name, factor in OFTEN_TAKEN.get(one.unit, {}).items():
        for sign, where in ((1.0, "here"), (-1.0, "there")):
            if np.abs(ratio - sign * np.log(factor)).max() < np.log(SAME_SCALE):
                reason = (
                    f"is in numbers {np.exp(ratio[1]):.3g} times as large as in the other"
                    f" recordings. {taken_for(one.unit, {name: factor})[:-1]}, {where}."
                )
                return Misfit(reason, factor if sign > 0.0 else 1.0 / factor, certain=False)
    return None


def taken_for(unit: str, likely: Mapping[str, float], do: str = "record") -> str:
    """Which units were likely taken for another, and what to do instead, in words."""
    taken, factors = " or ".join(likely), " or ".join(f"{one:.4g}" for one in likely.values())
    return f"Likely {taken} for {NAMES[unit]} (a factor of {factors}): {do} {NAMES[unit]}."
