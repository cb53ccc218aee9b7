# SPDX-License-Identifier: Apache-2.0
"""The columns of one file, and what their values mean: numbers, texts, times, units."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags import NANOSECONDS
from intent_recognition.errors import BagError, DofError

Values = NDArray[Any]
"""A column: numbers, dates, or texts (of dtype object)."""
MISSING = frozenset({"", "na", "n/a", "nan", "null", "none"})
"""What a cell of text says in lower case where nothing was measured. Convention, as in pandas."""
LONGEST_CELL = 60
"""Characters of a cell that a message repeats. Convention."""
PER_UNIT = {"s": NANOSECONDS, "ms": 10**6, "us": 10**3, "ns": 1}
"""Nanoseconds in each unit of time."""
SINCE_NS = 946_684_800 * NANOSECONDS
"""From what times count that do not say [ns]: 2000-01-01 UTC. Convention; a stamp of zero counts as
none."""
FIRST_CLOCK_NS = 10**18
"""Times from here on are a computer's clock [ns since 1970]: September 2001. Convention."""
LAST_NS = 2**31 * NANOSECONDS
"""The first time [ns] that a stamp of ROS cannot hold: its seconds are int32."""
MOST_NS = 10**30
"""Beyond this a number is no time in any unit [ns]. Convention."""
MOST_NAMED = 6
"""Missing columns that a message names. Convention."""
MOST_COLUMNS = 10_000
"""Columns of a table. Convention: a motion capture suit takes some hundreds."""
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


@dataclass(frozen=True)
class Table:
    """The columns of one file, read when they are asked for.

    Attributes:
        source: the file, or the folder of a data set.
        names: of all columns, as messages list them; one may occur twice, but not be asked for.
        read: columns by their numbers, each (T,) or (1,).
        aliases: numbers of columns by further names.
        unit: of all columns, "" where the file does not say.
        units: of single columns, by number.
        must_say: whether the map must give the unit where the file does not.
        defaults: what the file says of itself, under the keys of a map: time, segments, task.
        notes: what is odd about the file, as sentences.
    """

    source: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[int]], Sequence[Values]]
    aliases: Mapping[str, int] = field(default_factory=dict)
    unit: str = ""
    units: Mapping[int, str] = field(default_factory=dict)
    must_say: bool = False
    defaults: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def columns(self, wanted: Sequence[str]) -> dict[str, Values]:
        """Some columns by name, or by number from 0 on.

        Raises:
            BagError: one of them is not there, or twice; names those that are.
        """
        names = list(dict.fromkeys(wanted))
        found = {name: self.find(name) for name in names}
        if missing := [name for name, number in found.items() if number is None]:
            more = missing[MOST_NAMED:] and [f"and {len(missing) - MOST_NAMED} more"]
            raise BagError.about(
                str(self.source),
                f"the columns of the map, {', '.join(missing[:MOST_NAMED] + more)} among them",
                ", ".join(dict.fromkeys(self.names)) or "no columns",
                "Correct the names in the map.",
            )
        values = self.read([number for number in found.values() if number is not None])
        return dict(zip(names, values, strict=True))

    def find(self, name: str) -> int | None:
        """The number of a column; None where there is none.

        Raises:
            BagError: the name is there more than once.
        """
        lower = [own.lower() for own in self.names]
        for wanted, known in ((name, self.names), (name.lower(), lower)):
            same = [k for k, own in enumerate(known) if own == wanted]
            if len(same) > 1:
                places = " and ".join(map(str, same))
                cure = f"Name it by its number, {same[0]} or another, if that is what you want."
                got = f"twice {name!r}, the columns {places}"
                raise BagError.about(str(self.source), "every column of the map once", got, cure)
            if same:
                return same[0]
        if name in self.aliases:
            return self.aliases[name]
        return int(name) if name.isdecimal() and int(name) < len(self.names) else None

    def unit_of(self, name: str, wanted: str) -> str:
        """The unit of a column, in our spelling; that which is wanted where nothing is known.

        Raises:
            BagError: it is missing and must be known, or cannot be converted.
        """
        number = self.find(name)
        said = self.units.get(number, self.unit) if number is not None else self.unit
        cure = "Give it as columns_unit in the map, such as mm."
        if not said:
            if self.must_say:
                raise BagError.about(str(self.source), f"the unit of {name}", "none", cure)
            return wanted
        unit = spelled(said)
        if unit != wanted and _scale(unit, wanted) is None:
            expected = f"a unit of {name} that becomes {wanted}"
            raise BagError.about(str(self.source), expected, repr(said), cure)
        return unit


def table_of(source: Path, columns: Mapping[str, Values], **more: Any) -> Table:
    """A table of columns that are read already.

    Args:
        source: the file.
        columns: by name.
        more: further attributes of `Table`.
    """
    values = list(columns.values())
    return Table(source, tuple(columns), lambda wanted: [values[k] for k in wanted], **more)


def marker_table(
    source: Path,
    labels: Sequence[str],
    points: NDArray[np.float64],
    unit: str,
    defaults: Mapping[str, object],
    notes: Sequence[str] = (),
) -> Table:
    """Markers as columns `LABEL.x`, `LABEL.y`, `LABEL.z`.

    Args:
        source: the file.
        labels: of the markers, (N,).
        points: (T, N, 3), NaN where a marker was not seen.
        unit: as the file says it, "" for none.
        defaults: as of `Table`.
        notes: as of `Table`.
    """
    zero = np.all(points == 0.0, axis=2)
    hidden = zero & np.any(points != 0.0, axis=(0, 2))
    counts = dict(zip(labels, np.sum(hidden, axis=0).tolist(), strict=True))
    zeros = [f"{label} {count}" for label, count in counts.items() if count]
    if zeros:
        more = zeros[MOST_NAMED:] and [f"and {len(zeros) - MOST_NAMED} more"]
        said = "frames at exactly (0, 0, 0) are taken for occlusion"
        notes = [*notes, f"{said}: {', '.join([*zeros[:MOST_NAMED], *more])}"]
    values = np.where(hidden[:, :, None], np.nan, points).reshape(len(points), -1)
    names = tuple(f"{label}.{axis}" for label in labels for axis in "xyz")
    return Table(
        source,
        names,
        lambda wanted: [values[:, k] for k in wanted],
        unit=unit,
        must_say=True,
        defaults=defaults,
        notes=tuple(notes),
    )


def check_columns(source: Path, count: int) -> None:
    """Bound how many columns a table has.

    Raises:
        BagError: they are too many.
    """
    if count > MOST_COLUMNS:
        cure = "Leave columns out of the file."
        raise unusable(source, f"at most {MOST_COLUMNS} columns", count, cure)


def unusable(source: Path, expected: str, error: object, cure: str) -> BagError:
    """The error that a file is not what its name says."""
    return BagError.about(str(source), expected, error, cure)


def numbers(values: Values, source: Path, name: str) -> NDArray[np.float64]:
    """A column as numbers (T,), NaN where nothing was measured.

    Raises:
        BagError: a cell is no number.
    """
    if values.dtype.kind in "fiub":
        return values.astype(np.float64)
    found = np.empty(values.size)
    for row, cell in enumerate(values):
        text = str(cell).strip()
        try:
            found[row] = np.nan if text.lower() in MISSING else float(with_point(text))
        except ValueError as error:
            cure = "Name a column of numbers in the map."
            got = f"{text[:LONGEST_CELL]!r} in row {row + 1}"
            raise BagError.about(f"{source}: {name}", "numbers", got, cure) from error
    return found


def with_point(text: str) -> str:
    """A number with a decimal point, where it has a decimal comma."""
    if text.count(",") != 1:
        return text
    whole, _, decimals = text.partition(",")
    return f"{whole.replace('.', '')}.{decimals}" if "." not in decimals else text


def text_of(value: object) -> str:
    """One value of a column as text, "" where there is none."""
    if value is None or (isinstance(value, float | np.floating) and np.isnan(value)):
        return ""
    if isinstance(value, float | np.floating) and float(value).is_integer():
        return str(int(value))
    return str(value).strip()


def texts(values: Values) -> list[str]:
    """A column as texts, "" where there is none; whole numbers have no decimals."""
    return [text_of(value) for value in values]


class Stamps(NamedTuple):
    """Times of rows.

    Attributes:
        ns: stamps (T,).
        known: where there is one (T,).
        zero_ns: the stamp of the file's own time zero; of dates that of the first row.
    """

    ns: NDArray[np.int64]
    known: NDArray[np.bool_]
    zero_ns: int


def stamps_ns(values: Values, unit: str, since_ns: int | None, source: Path, name: str) -> Stamps:
    """Times as stamps, without rounding where the column holds whole numbers or decimal texts.

    Args:
        values: times, (T,); dates, also as text in ISO 8601, are taken as they are.
        unit: of the times, a key of `PER_UNIT`.
        since_ns: what they count from [ns]; None for 1970 where they are later than 2001, else
            `SINCE_NS`.
        source: the file, for messages.
        name: of the column, for messages.

    Raises:
        BagError: a cell is no time, or a time is before 1970 or after 2038, which no stamp holds.
    """
    per, place = PER_UNIT[unit], f"{source}: {name}"
    known = np.ones(values.size, bool)
    are_dates = values.dtype.kind == "M"
    if are_dates:
        known = ~np.isnat(values)
        counts: Any = np.where(known, values.astype("datetime64[ns]").astype(np.int64), 0)
    elif values.dtype.kind in "iu":
        counts = values.astype(object) * per
    elif values.dtype.kind == "f":
        known = np.isfinite(values)
        with np.errstate(over="ignore"):
            counts = np.rint(np.where(known, values, 0.0).astype(np.float64) * per)
    else:
        counts = np.zeros(values.size, object)
        for row, cell in enumerate(values):
            text = str(cell).strip()
            known[row] = text.lower() not in MISSING
            try:
                if known[row]:
                    is_date = _is_date(text)
                    are_dates |= is_date
                    counts[row] = _date_ns(text) if is_date else _nanoseconds(text, per)
            except (ArithmeticError, ValueError) as error:
                got = f"{text[:LONGEST_CELL]!r} in row {row + 1}"
                cure = "Name a column of numbers, 10:00:00.5 or 2024-01-31 10:00:00.5 under time."
                raise BagError.about(place, "times", got, cure) from error
    if are_dates:
        stamps = _checked(counts, known, 0, place, per)
        return Stamps(stamps, known, int(stamps[known][0]) if known.any() else 0)
    if since_ns is None:
        lowest = counts[known].min() if known.any() else 0
        since_ns = 0 if lowest >= FIRST_CLOCK_NS else SINCE_NS
    return Stamps(_checked(counts, known, since_ns, place, per), known, since_ns)


def ticks_ns(count: int, rate_hz: float, since_ns: int | None, source: Path) -> Stamps:
    """Stamps (count,) of samples at a rate [Hz], the first at `since_ns`.

    Raises:
        BagError: they leave what a stamp holds.
    """
    ticks, known = np.rint(np.arange(count) * (NANOSECONDS / rate_hz)), np.ones(count, bool)
    zero_ns = SINCE_NS if since_ns is None else since_ns
    return Stamps(_checked(ticks, known, zero_ns, str(source), NANOSECONDS), known, zero_ns)


def _checked(
    counts: NDArray[Any], known: NDArray[np.bool_], since_ns: int, place: str, per: int
) -> NDArray[np.int64]:
    """Stamps [ns] of nanoseconds since another time, where they are known."""
    there = counts[known]
    lowest, highest = (there.min(), there.max()) if there.size else (1, 1)
    if lowest + since_ns <= 0 or highest + since_ns >= LAST_NS:
        cure = "Correct unit and since under time in the map; times of the computer have since: 0."
        got = f"{float(lowest):.6g} to {float(highest):.6g} ns since {since_ns} ns"
        likely = [
            unit
            for unit, other in PER_UNIT.items()
            if other != per and FIRST_CLOCK_NS <= int(lowest) // per * other < LAST_NS
        ]
        cure = f"Likely they are {likely[0]}: say unit: {likely[0]}." if likely else cure
        raise BagError.about(place, "times between 1970 and 2038", got, cure)
    return np.where(known, counts, 0).astype(np.int64) + since_ns


def _is_date(text: str) -> bool:
    return "-" in text[1:] and ":" in text


def _date_ns(text: str) -> int:
    """A date and time in ISO 8601 as nanoseconds since 1970; without a zone it is UTC.

    Raises:
        ValueError: it is none.
    """
    whole, _, rest = text.replace("Z", "+00:00").partition(".")
    digits = re.match(r"\d*", rest)[0]  # type: ignore[index]
    day = datetime.fromisoformat(whole + rest[len(digits) :])
    moment = day if day.tzinfo else day.replace(tzinfo=timezone.utc)
    return int(moment.timestamp()) * NANOSECONDS + int(digits[:9].ljust(9, "0"))


def _nanoseconds(text: str, per: int) -> int:
    """A number, or a time of day, as nanoseconds.

    Raises:
        ArithmeticError, ValueError: it is none, or far beyond any time.
    """
    if text.count(":") == 2:
        hours, minutes, seconds = text.split(":")
        text, per = str(3600 * int(hours) + 60 * int(minutes) + Decimal(seconds)), NANOSECONDS
    count = Decimal(with_point(text)) * per
    if not abs(count) < MOST_NS:
        raise OverflowError
    return round(count)


def spelled(unit: str) -> str:
    """A unit of length or angle as it is written here, whatever a file calls it; else as it is."""
    one, slash, per = unit.strip().partition("/")
    low = one.strip().lower()
    for name, known in UNITS.items():
        if low in known or low.removesuffix("s") in known:
            return f"{name}{slash}{per.strip()}"
    return unit.strip()


def check_convertible(unit: str, wanted: str, place: str) -> None:
    """Make sure that there is a factor between two units.

    Raises:
        DofError: there is none.
    """
    if spelled(unit) != wanted and _scale(spelled(unit), wanted) is None:
        known = f"{wanted}, or one of {', '.join(UNITS)}, for lengths and angles"
        raise DofError.about(place, known, unit, "Convert the columns, or correct the unit.")


def convert(values: NDArray[np.float64], unit: str, wanted: str) -> NDArray[np.float64]:
    """Values in another unit; as they are where it is the same or unknown.

    Args:
        values: of any shape.
        unit: they are in.
        wanted: to have them in.
    """
    scale = _scale(spelled(unit), wanted)
    if scale is None or scale[0] == scale[1]:
        return values
    multiplier, divisor = scale
    return values * multiplier / divisor  # a quotient of small integers rounds once


def _scale(unit: str, wanted: str) -> tuple[float, float] | None:
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
