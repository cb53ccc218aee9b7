# SPDX-License-Identifier: Apache-2.0
"""Units: group DOFs with a common scale, and check whether values can be in their unit.

Constants in metres and radians apply to these units only. Values in other units, such as newtons or
pixels, are scaled by their range in the demonstrations, so that nothing depends on the unit's size.
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
"""Units in which constants are given. Values in both may be added: over the reach of an arm, a
radian at a joint is about a metre at the hand."""
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
"""Common spellings of each unit, in lower case and without the plural s."""
PRODUCT = re.compile(
    r"(?<=\w)[ .*\u00b7\u22c5]s(?:\^|\*\*)?[-\u2212\u207b]([1-3\u00b9\u00b2\u00b3])"
)
"""Matches division by seconds written as a product, as in `mm s^-1` or `rad s-2`."""
OFTEN_TAKEN = {
    "m": {"millimetres": 1000.0, "centimetres": 100.0},
    "rad": {"degrees": 180.0 / np.pi},
}
"""Units often recorded instead of the right one, with their number per right unit."""
SELDOM_TAKEN = {"m": {"inches": 1.0 / 0.0254}}
"""Units like those of `OFTEN_TAKEN`, but so close to one of them that only learned positions can
distinguish them; both are named."""
NAMES = {"m": "metres", "rad": "radians"}
"""Names of the units in words."""
FASTEST = {"m": 20.0, "rad": 25.0}
"""Speed above which a unit must be wrong [m/s, rad/s]: a thrown ball is faster, but nothing at a
workplace, and no joint of an industrial arm turns four times per second."""
WIDEST = {"m": 20.0, "rad": 8.0 * np.pi}
"""Extent of a movement above which a unit must be wrong [m, rad]: larger than a robot cell, or four
turns."""
USUAL = {"m": 0.5, "rad": 1.0}
"""Usual extent of a reach [m, rad]. If two units explain too large values, the one that gives the
more usual extent is named."""
STILL_USUAL = 4.0
"""Largest factor between `USUAL` and the extent of a usual reach: 12 cm to 2 m."""
FAST = 10.0
"""Speed above which a unit is doubted [m/s, rad/s]; the fastest joints of cobots reach 6 rad/s,
a hand 3 m/s."""
OUTSIDE_RAD = 0.1
"""Largest distance of a recorded joint from the range in its URDF [rad], which allows for
calibration and narrower software limits."""
SAME_SCALE = 3.0
"""Largest ratio of level and extent between recordings in one unit, less than the square root of
the smallest factor between two units."""
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 2e-4, 4.0
"""Sampling periods beyond which times must be in another unit [s]: no tracker is faster than 5 kHz,
and a movement sampled every four seconds cannot be learned."""
USUAL_PERIODS_S = 1e-3, 0.5
"""Range of the sampling periods of trackers and encoders [s]. The ratio of its ends is below 1000,
so that at most one other unit explains a period, or minutes besides."""
FAR_SHARE = 0.1
"""Distance outside the learned range above which a sample is in another unit, in learned extents
and relative to the factor between the units: 100 extents for millimetres, 6 for degrees. A reach
that begins within a tenth of its extent from the origin is judged only beyond that."""


class Known(NamedTuple):
    """Prior knowledge about a signal, such as limits from the description of an arm."""

    # smallest positions of the DOFs (d,), empty if unknown
    lower: Floats = np.empty(0)
    upper: Floats = np.empty(0)  # largest positions (d,)
    widest: float = np.inf  # upper bound of the extent of each DOF, infinite if unknown


class Misfit(NamedTuple):
    """Why values are hardly in their unit."""

    reason: str  # a sentence with the names of the DOFs and the likely unit
    factor: float  # by which the values are too large; NaN if no usual unit explains them
    certain: bool  # whether no real movement can have such values
    # last sentence of the reason, which is the same for all recordings with this error
    likely: str = ""


class Size(NamedTuple):
    """Size of a signal's values: root mean square and largest extent of a DOF."""

    unit: str
    level: float
    extent: float


def spelled(unit: str) -> str:
    """Spell a unit of length or angle as in this package; other units are only stripped."""
    one, slash, per = as_quotient(unit.strip()).partition("/")
    low = one.strip().lower().removesuffix(".")
    for name, known in UNITS.items():
        if low in known or low.removesuffix("s") in known:
            return f"{name}{slash}{per.strip()}"
    return unit.strip()


def as_quotient(unit: str) -> str:
    """Write products such as `mm s^-1` in a text as quotients such as `mm/s`."""
    return PRODUCT.sub(lambda found: f"/s^{digit(found[1])}".removesuffix("^1"), unit)


def commensurate(units: Sequence[str]) -> list[Integers]:
    """Indices of the DOFs with a common scale: metres and radians, then each other unit."""
    kinds = ["" if unit in SPATIAL_UNITS else f"in {unit}" for unit in units]
    return [np.flatnonzero([own == kind for own in kinds]) for kind in sorted(set(kinds))]


def is_spatial(units: Sequence[str]) -> Flags:
    """Whether each DOF is in metres or radians, (D,)."""
    return np.array([unit in SPATIAL_UNITS for unit in units], dtype=bool)


def misfit(signal: Signal, known: Known | None = None) -> Misfit | None:
    """Why a recorded movement is hardly in its unit; None if it may be, or is not in m or rad.

    `known` is the prior knowledge about the arm that moved.
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
    turn = TURNS["rad"]  # few joints turn farther in either direction
    turned = unit == "rad" and farthest > turn
    turned = turned and max(extent / turn, speed / FAST, farthest / WIDEST[unit]) > 1.0
    too_wide = extent > known.widest
    never = too_wide or extent > WIDEST[unit] or speed > FASTEST[unit]
    if not (never or turned or (unit == "m" and speed > FAST)):
        return None
    if unit == "m" and (stray := _stray(signal)) is not None:
        return stray
    reason = f"{in_words(signal.names)} moves over {extent:.3g} {unit}"
    reason += f" at up to {speed:.3g} {unit}/s" if speed > FAST else ""  # too low if sparse
    reason += f" and is at {farthest:.3g} {unit}" if turned else ""
    reason += f", and the arm cannot reach over {known.widest:.3g} {unit}" if too_wide else ""
    named = _nearest_usual(unit, extent)
    certain = unit == "m" and never  # joints without limits may turn as far, a toy's as fast
    likely = taken_for(unit, named)
    said = "cannot be" if certain else "is hardly"
    text = f"{reason}: the unit {said} {NAMES[unit]}. {likely}"
    return Misfit(text, next(iter(named.values())), certain, likely)


def _stray(signal: Signal) -> Misfit | None:
    """Misfit due to samples [m] far from all others, if only these are odd; else None.

    They are few, or up to half of all, between the two longest steps: away, and back.
    """
    values = signal.values
    away = np.linalg.norm(values - np.median(values, axis=0), axis=1)
    far, steps = away > 0.5 * away.max(), np.linalg.norm(np.diff(values, axis=0), axis=1)
    if far.mean() > 0.1:
        out, back = np.sort(np.argsort(steps)[-2:])
        far = (np.arange(far.size) > out) & (np.arange(far.size) <= back)
    ends = steps[far[1:] != far[:-1]]
    if far.mean() > 0.5 or not ends.size or ends.min() < 0.5 * away.max():
        return None
    if misfit(Signal(signal.names, signal.stamps_ns[~far], values[~far], signal.unit)) is not None:
        return None
    row = int(np.argmax(np.where(far, away, -np.inf)))
    at_s = (signal.stamps_ns[row] - signal.stamps_ns[0]) * 1e-9
    reason = (
        f"{in_words(signal.names)} at {at_s:.3g} s is {away[row]:.3g} m from its median, in"
        f" {far.sum()} of {far.size} samples so far. Likely a tracker's error: leave these"
        " samples out."
    )
    return Misfit(reason, np.nan, certain=True)


def time_misfit(signal: Signal) -> Misfit | None:
    """Why times are hardly in seconds; None if they may be."""
    if len(signal.stamps_ns) < MIN_SAMPLES:
        return None
    period_s = float(np.median(np.diff(signal.stamps_ns))) * 1e-9
    if SHORTEST_PERIOD_S <= period_s <= LONGEST_PERIOD_S:
        return None
    length_s = float(signal.stamps_ns[-1] - signal.stamps_ns[0]) * 1e-9
    reason = f"{in_words(signal.names)} has a sample every {period_s:.3g} s, over {length_s:.3g} s"
    units = {f"{name} for seconds": factor for name, factor in OFTEN_TIMES.items()}
    units |= {f"seconds for {name}": 1.0 / factor for name, factor in OFTEN_TIMES.items()}
    units["minutes for seconds"] = 1.0 / 60.0
    least_s, most_s = USUAL_PERIODS_S
    likely = [text for text, factor in units.items() if least_s <= period_s / factor <= most_s]
    if not likely:
        return Misfit(f"{reason}. Record it at 10 Hz or more.", np.nan, certain=False)
    likely.sort(key=lambda text: abs(np.log(50.0 * period_s / units[text])))  # near 50 Hz first
    causes = " or ".join(f"{text} (a factor of {units[text]:.4g})" for text in likely)
    said = f"{reason}. Likely {causes}: correct the times."
    return Misfit(said, units[likely[0]], certain=True)


def learned_misfit(
    names: Sequence[str], unit: str, values: Floats, learned: Known
) -> Misfit | None:
    """Why one sample (d,) is hardly in the unit that was learned; None if it may be.

    `learned` is the range of the DOFs in the library.
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
    """Other units, with their factors, in which a sample (d,) is inside the learned range."""
    return {
        name: factor
        for name, factor in (OFTEN_TAKEN.get(unit, {}) | SELDOM_TAKEN.get(unit, {})).items()
        if np.all((values / factor >= learned.lower) & (values / factor <= learned.upper))
    }


def place_misfit(position_m: Floats) -> Misfit | None:
    """Why the position of a tracked body (3,) is hardly in metres; None if it may be."""
    distance_m = float(np.linalg.norm(position_m))
    return length_misfit(distance_m, f"is {distance_m:.3g} m from the origin of its frame")


def scene_misfit(signal: Signal) -> Misfit | None:
    """Like `misfit`, for an object that may stand still: its position (T, d) is checked, too."""
    found = misfit(signal)
    if found is None and signal.unit == "m" and signal.values.size:
        found = place_misfit(np.median(signal.values, axis=0))
        found = found and found._replace(reason=f"{in_words(signal.names)} {found.reason}")
    return found


def length_misfit(length_m: float, said: str, do: str = "record") -> Misfit | None:
    """Why a length of an arm or a distance is hardly in metres; None if it may be.

    `said` describes the length in words, and `do` is the verb of the advice, before "metres".
    """
    if length_m <= WIDEST["m"]:
        return None
    likely = _nearest_usual("m", length_m)
    factor = next(iter(likely.values()))
    if length_m / max(OFTEN_TAKEN["m"].values()) < 0.3:  # [m]; any of the units is possible
        likely = OFTEN_TAKEN["m"]
    text = taken_for("m", likely, do)
    return Misfit(f"{said}. {text}", factor, certain=False, likely=text)


def _nearest_usual(unit: str, length: float) -> dict[str, float]:
    """Units, with factors, that make a length usual: the best often taken one, then seldom ones."""
    often, seldom = OFTEN_TAKEN[unit], SELDOM_TAKEN.get(unit, {})
    away = {n: abs(np.log(length / f / USUAL[unit])) for n, f in (often | seldom).items()}
    nearest = min(often, key=lambda name: float(away[name]))
    also = {n: f for n, f in seldom.items() if away[n] < np.log(STILL_USUAL)}
    return {nearest: often[nearest]} | also


def in_words(names: Sequence[str]) -> str:
    """Name of a signal with these DOFs: the first, followed by an ellipsis if there are more."""
    return ", ".join(names[:1]) + (", ..." if len(names) > 1 else "")


def _outside(signal: Signal, known: Known) -> Misfit | None:
    """Misfit of positions outside the joint ranges; their unit is wrong if they are far outside."""
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
    """Size of values (T, d)."""
    if not values.size:
        return Size(unit, 0.0, 0.0)
    level = float(np.sqrt(np.mean(np.square(values))))
    return Size(unit, level, float(np.ptp(values, axis=0).max()))


def median_size(sizes: Sequence[Size]) -> Size:
    """Median size of the same signal in several recordings."""
    unit, *_ = (size.unit for size in sizes)
    level, extent = np.median([size[1:] for size in sizes], axis=0)
    return Size(unit, float(level), float(extent))


def differing_unit(one: Size, usual: Size) -> Misfit | None:
    """Misfit of a signal whose unit differs from that in most recordings; None if it does not."""
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
    """Sentence that names the units likely recorded instead of `unit`, with advice."""
    taken, factors = " or ".join(likely), " or ".join(f"{one:.4g}" for one in likely.values())
    return f"Likely {taken} for {NAMES[unit]} (a factor of {factors}): {do} {NAMES[unit]}."
