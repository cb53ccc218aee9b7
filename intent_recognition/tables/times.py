# SPDX-License-Identifier: Apache-2.0
"""Times of a table's rows as stamps."""

import re
from datetime import datetime, timezone
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.bags import NANOSECONDS
from intent_recognition.errors import BagError
from intent_recognition.tables.cells import LONGEST_CELL, MISSING, Values, with_point

PER_UNIT = {"s": NANOSECONDS, "ms": 10**6, "us": 10**3, "ns": 1}
"""Nanoseconds in each unit of time."""
SAMPLES = "samples"
"""Unit of a column that counts samples, at a rate."""
SINCE_NS = 946_684_800 * NANOSECONDS
"""From what times count that do not say [ns]: 2000-01-01 UTC. Convention; a stamp of zero counts as
none."""
FIRST_CLOCK_NS = 10**18
"""Times from here on are a computer's clock [ns since 1970]: September 2001. Convention."""
LAST_NS = 2**31 * NANOSECONDS
"""The first time [ns] that a stamp of ROS cannot hold: its seconds are int32."""
DAY_NS = 86_400 * NANOSECONDS
USUAL_PERIODS_S = 1e-3, 0.5
"""Steps between samples by which the unit of times is known [s]. Convention."""


class Stamps(NamedTuple):
    """Times of rows.

    Attributes:
        ns: stamps (T,).
        known: where there is one (T,).
        zero_ns: the stamp of the file's own time zero; of dates that of the first row.
    """

    ns: Integers
    known: Flags
    zero_ns: int


def usual_unit(steps: Floats) -> str:
    """The unit in which steps between samples are usual, "" where there is none."""
    step = float(np.median(steps)) if steps.size else 0.0
    for unit, per in PER_UNIT.items():
        if USUAL_PERIODS_S[0] <= step * per / NANOSECONDS <= USUAL_PERIODS_S[1]:
            return unit
    return ""


def stamps_ns(values: Values, unit: str, since_ns: int | None, source: Path, name: str) -> Stamps:
    """Times as stamps, without rounding where the column holds whole numbers or decimal texts.

    Args:
        values: times, (T,); dates, also as text in ISO 8601, are taken as they are. Times of day
            go on after midnight.
        unit: of the times, a key of `PER_UNIT`.
        since_ns: what they count from [ns]; None for 1970 where they are later than 2001, else
            `SINCE_NS`.
        source: the file, for messages.
        name: of the column, for messages.
    """
    per, place = PER_UNIT[unit], f"{source}: {name}"
    known = np.ones(values.size, bool)
    are_dates = values.dtype.kind == "M"
    if are_dates:
        known = ~np.isnat(values)
        counts: Any = np.where(known, values.astype("datetime64[ns]").astype(np.int64), 0)
    elif values.dtype.kind == "m":
        known = ~np.isnat(values)
        counts = np.where(known, values.astype("timedelta64[ns]").astype(np.int64), 0)
    elif values.dtype.kind in "iu":
        counts = values.astype(object) * per
    elif values.dtype.kind == "f":
        known = np.isfinite(values)
        with np.errstate(over="ignore"):
            counts = np.rint(np.where(known, values, 0.0).astype(np.float64) * per)
    else:
        counts = np.zeros(values.size, object)
        days = last = 0
        for row, cell in enumerate(values):
            text = str(cell).strip()
            known[row] = text.lower() not in MISSING
            try:
                if known[row]:
                    is_date = _is_date(text)
                    are_dates |= is_date
                    counts[row] = _date_ns(text) if is_date else _nanoseconds(text, per)
                    if not is_date and ":" in text:
                        days += last - counts[row] > DAY_NS // 2
                        last, counts[row] = counts[row], counts[row] + days * DAY_NS
            except (ArithmeticError, ValueError) as error:
                got = f"{text[:LONGEST_CELL]!r} in row {row + 1}"
                cure = "Name a column of numbers, 10:00:00.5 or 2024-01-31 10:00:00.5 under time."
                raise BagError.about(place, "times", got, cure) from error
    if are_dates:
        is_zero = known.any() and counts[known].min() < DAY_NS  # times that were saved as dates
        stamps = _checked(counts, known, SINCE_NS if is_zero else 0, place, per)
        return Stamps(stamps, known, int(stamps[known][0]) if known.any() else 0)
    if since_ns is None:
        lowest = counts[known].min() if known.any() else 0
        since_ns = 0 if lowest >= FIRST_CLOCK_NS else SINCE_NS
    return Stamps(_checked(counts, known, since_ns, place, per), known, since_ns)


def counted_ns(values: Floats, rate_hz: float, since_ns: int | None, source: Path) -> Stamps:
    """Stamps of samples at a rate [Hz] by their numbers (T,); the first one is at `since_ns`."""
    known = np.isfinite(values)
    first = values[known][0] if known.any() else 0.0
    ticks = np.rint(np.where(known, values - first, 0.0) * (NANOSECONDS / rate_hz))
    zero_ns = SINCE_NS if since_ns is None else since_ns
    return Stamps(_checked(ticks, known, zero_ns, str(source), NANOSECONDS), known, zero_ns)


def _checked(counts: NDArray[Any], known: Flags, since_ns: int, place: str, per: int) -> Integers:
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
    whole, _, rest = text.replace("Z", "+00:00").replace(",", ".").partition(".")
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
    if not abs(count) < 10**30:
        raise OverflowError
    return round(count)
