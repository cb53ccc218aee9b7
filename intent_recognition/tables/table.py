# SPDX-License-Identifier: Apache-2.0
"""The columns of one file, and what their values mean: numbers, texts, times, units."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

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
LAST_NS = 2**31 * NANOSECONDS
"""The first time [ns] that a stamp of ROS cannot hold: its seconds are int32."""
MOST_NAMED = 6
"""Missing columns that a message names. Convention."""
MOST_COLUMNS = 10_000
"""Columns of a table. Convention: a motion capture suit takes some hundreds."""
LENGTHS = {"m": 1, "dm": 10, "cm": 100, "mm": 1000}
"""How many of each unit are one metre."""


@dataclass(frozen=True)
class Table:
    """The columns of one file, read when they are asked for.

    Attributes:
        source: the file, or the folder of a data set.
        names: of all columns, as messages list them.
        read: columns by name, each (T,) or (1,), for names that are there.
        aliases: further names by which `read` knows columns.
        unit: of all columns, "" where the file does not say.
        defaults: what the file says of itself, under the keys of a map: time, segments, task.
    """

    source: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], dict[str, Values]]
    aliases: frozenset[str] = frozenset()
    unit: str = ""
    defaults: Mapping[str, object] = field(default_factory=dict)

    def columns(self, wanted: Sequence[str]) -> dict[str, Values]:
        """Some columns by name.

        Raises:
            BagError: one of them is not there; names those that are.
        """
        there = self.aliases.union(self.names)
        if missing := [name for name in dict.fromkeys(wanted) if name not in there]:
            more = missing[MOST_NAMED:] and [f"and {len(missing) - MOST_NAMED} more"]
            raise BagError.about(
                str(self.source),
                f"the columns of the map, {', '.join(missing[:MOST_NAMED] + more)} among them",
                ", ".join(self.names) or "no columns",
                "Correct the names in the map.",
            )
        return self.read(tuple(dict.fromkeys(wanted)))


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
            found[row] = np.nan if text.lower() in MISSING else float(text)
        except ValueError as error:
            cure = "Name a column of numbers, with decimal points, in the map."
            got = f"{text[:LONGEST_CELL]!r} in row {row + 1}"
            raise BagError.about(f"{source}: {name}", "numbers", got, cure) from error
    return found


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


def stamps_ns(
    values: Values, unit: str, since_ns: int, source: Path, name: str
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Times as stamps, without rounding where the column holds whole numbers or decimal texts.

    Args:
        values: times, (T,); dates are taken as they are.
        unit: of the times, a key of `PER_UNIT`.
        since_ns: what they count from [ns].
        source: the file, for messages.
        name: of the column, for messages.

    Returns:
        Stamps (T,), and where there is one, (T,).

    Raises:
        BagError: a cell is no time, or a time is before 1970 or after 2038, which no stamp holds.
    """
    per = PER_UNIT[unit]
    known = np.ones(values.size, bool)
    if values.dtype.kind == "M":
        known = ~np.isnat(values)
        since_ns = 0
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
                counts[row] = _nanoseconds(text, per) if known[row] else 0
            except (ArithmeticError, ValueError) as error:
                got = f"{text[:LONGEST_CELL]!r} in row {row + 1}"
                cure = "Name a column of times, with decimal points, under time in the map."
                raise BagError.about(f"{source}: {name}", "times", got, cure) from error
    return _checked(counts, known, since_ns, f"{source}: {name}"), known


def ticks_ns(count: int, rate_hz: float, since_ns: int, source: Path) -> NDArray[np.int64]:
    """Stamps (count,) of samples at a rate [Hz], the first at `since_ns`.

    Raises:
        BagError: they leave what a stamp holds.
    """
    ticks = np.rint(np.arange(count) * (NANOSECONDS / rate_hz))
    return _checked(ticks, np.ones(count, bool), since_ns, str(source))


def _checked(
    counts: NDArray[Any], known: NDArray[np.bool_], since_ns: int, place: str
) -> NDArray[np.int64]:
    """Stamps [ns] of nanoseconds since another time, where they are known."""
    there = counts[known]
    lowest, highest = (there.min(), there.max()) if there.size else (1, 1)
    if lowest + since_ns <= 0 or highest + since_ns >= LAST_NS:
        cure = "Correct unit and since under time in the map; times of the computer have since: 0."
        got = f"{lowest:.6g} to {highest:.6g} ns since {since_ns} ns"
        raise BagError.about(place, "times between 1970 and 2038", got, cure)
    return counts.astype(np.int64) + since_ns


def _nanoseconds(text: str, per: int) -> int:
    """A decimal text as nanoseconds; ArithmeticError where it is none, or no stamp holds it."""
    count = Decimal(text) * per
    if not abs(count) < 2**63:
        raise OverflowError
    return round(count)


def check_convertible(unit: str, wanted: str, place: str) -> None:
    """Make sure that there is a factor between two units.

    Raises:
        DofError: there is none.
    """
    if _scale(unit, wanted) is None:
        known = f"{wanted}, or one of {', '.join(LENGTHS)} for lengths, deg or rad for angles"
        raise DofError.about(place, known, unit, "Convert the columns, or correct the unit.")


def convert(values: NDArray[np.float64], unit: str, wanted: str) -> NDArray[np.float64]:
    """Values in another unit; as they are where it is the same or unknown.

    Args:
        values: of any shape.
        unit: they are in.
        wanted: to have them in.
    """
    scale = _scale(unit, wanted)
    if scale is None or scale[0] == scale[1]:
        return values
    multiplier, divisor = scale
    return values * multiplier / divisor  # a quotient of small integers rounds once


def _scale(unit: str, wanted: str) -> tuple[float, float] | None:
    """Factor and divisor from one unit to the other, None where there is none."""
    (one, _, per), (other, _, other_per) = unit.partition("/"), wanted.partition("/")
    if unit == wanted:
        return 1, 1
    if per != other_per:
        return None
    if one in LENGTHS and other in LENGTHS:
        return LENGTHS[other], LENGTHS[one]
    return {("deg", "rad"): (np.pi, 180), ("rad", "deg"): (180, np.pi)}.get((one, other))
