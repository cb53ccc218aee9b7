# SPDX-License-Identifier: Apache-2.0
"""Times of a table's rows as stamps."""

import re
from datetime import datetime, timezone
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.bags import NANOSECONDS
from intent_recognition.errors import BagError
from intent_recognition.signals import (
    FIRST_CLOCK_S,
    LONGEST_PERIOD_S,
    SHORTEST_PERIOD_S,
    USUAL_PERIODS_S,
)
from intent_recognition.tables.cells import MISSING, Values, cell_at, with_point, without_thousands

PER_UNIT = {"s": NANOSECONDS, "ms": 10**6, "us": 10**3, "ns": 1, "min": 60 * NANOSECONDS,
            "ticks": 100}  # fmt: skip
"""Nanoseconds in each unit of time; Windows and Kinect count ticks."""
EPOCHS_NS = (11_644_473_600 * NANOSECONDS, 62_135_596_800 * NANOSECONDS)
"""Time from the origin of other clocks to 1970 [ns]: Windows (1601) and .NET (year 1)."""
SLOW_S = 0.2
"""Step above which another unit with a shorter step is preferred [s]: Kinect's 30 Hz are in ticks,
not microseconds."""
TIME_UNIT = re.compile(
    r"(?i)(?:^|[\W_])(?:(?P<ms>msecs?|ms|millis|milliseconds?)"
    r"|(?P<us>[u\u00b5\u03bc]secs?|[u\u00b5\u03bc]s|micros|microseconds?)"
    r"|(?P<ns>nsecs?|ns|nanos|nanosecs?|nanoseconds?)"
    r"|(?P<min>mins?|minutes?)|(?P<s>s|secs?|seconds?))\W*$"
)
"""A unit of time at the end of a name: `time_ms`, `t [ms]`, `Time (Seconds)`, `msec`."""
TIME_NAME = re.compile(
    r"(?i)(^|[^a-z])(t|ts|times?|elapsed|timestamps?|stamps?|secs?|seconds|zeit(_?secs?)?)"
    r"([^a-z]|$)"
    r"|^(ms|msecs?|millis|milliseconds)$"
)
"""Names of columns of times."""
SAMPLES = "samples"
"""Unit of a column that counts samples at a rate."""
SINCE_NS = 946_684_800 * NANOSECONDS
"""Origin of times without one [ns]: 2000-01-01 UTC. A stamp of zero counts as none."""
FIRST_CLOCK_NS = int(FIRST_CLOCK_S) * NANOSECONDS
LAST_NS = 2**31 * NANOSECONDS
"""The first time [ns] that a stamp of ROS cannot hold: its seconds are int32."""
DAY_NS = 86_400 * NANOSECONDS
HOUR_NS = 3600 * NANOSECONDS
CLOCK = (
    r"(?P<hour>\d{1,2})(?P<mark>[:.])(?P<minute>\d\d)(?:(?P=mark)(?P<second>\d\d))?"
    r"(?:(?:[.,]|:(?=\d{3}))(?P<digits>\d+))?(?:\s*(?P<half>[ap])\.?m\.?)?"
)
"""A time of day: 10:00:00.5, 10.00.00,500 or 10:00:00.5 PM."""
ZONE = r"(?:\s*(?:Z|UTC|GMT|(?P<sign>[+-])(?P<off_hours>\d\d):?(?P<off_minutes>\d\d)?))?"
DATES = (
    re.compile(
        r"(?P<first>\d{1,4})(?P<between>[-/.])(?P<middle>\d{1,2}|[a-z]{3})(?P=between)"
        r"(?P<last>\d{1,4})"
        rf"(?:T|,?\s+){CLOCK}{ZONE}",
        re.IGNORECASE,
    ),
    re.compile(
        r"(?P<first>\d{4})(?P<middle>\d\d)(?P<last>\d\d)[T_ ](?P<hour>\d\d)(?P<minute>\d\d)"
        rf"(?P<second>\d\d)(?:[.,](?P<digits>\d+))?{ZONE}",
        re.IGNORECASE,
    ),
)
"""Dates and times: 2024-01-31T10:00:00.5+01:00, 31.01.2024 10:00:00,5, 1/31/2024 10:00:00.5 AM,
20240131T100000.5, 31-Jan-2024 10:00:00.5."""
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
TIME_OF_DAY = re.compile(
    r"(?:(?P<days>\d+) days? )?"
    r"(?:(?P<hours>\d+):(?P<minutes>\d{1,2}):(?P<seconds>\d{1,2}(?:[.,]\d+|:\d{3,})?)"
    r"|(?P<short>\d{1,2}):(?P<rest>\d\d[.,]\d+))(?:\s*(?P<half>[ap])\.?m\.?)?",
    re.IGNORECASE,
)
"""A time of day, also after days as pandas writes it, or minutes and seconds with decimals as
spreadsheets show them. Three or more digits after a third colon are milliseconds; fewer would be
frames of an unknown rate."""
WITH_UNIT = re.compile(r"(?P<count>.+) (?P<unit>sec|min|hr)")
"""A duration of MATLAB."""
PER_WORD = {"sec": NANOSECONDS, "min": 60 * NANOSECONDS, "hr": HOUR_NS}


class Stamps(NamedTuple):
    """Times of rows."""

    ns: Integers  # stamps (T,)
    known: Flags  # whether a row has one (T,)
    zero_ns: int  # stamp of the file's own time zero; for dates that of the first row


def unit_of_times(name: str) -> str:
    """The key of `PER_UNIT` at the end of a name, "" for none."""
    found = TIME_UNIT.search(name)
    return found.lastgroup or "" if found else ""


def usual_unit(steps: Floats, said: str = "", first: float = 0.0) -> str:
    """The unit `said` if the steps permit it, else one with usual steps; "" if there is none.

    Units that put the first time after 2038, whatever the clock's origin, are excluded.
    """
    step = float(np.median(steps)) if steps.size else 0.0
    if said and SHORTEST_PERIOD_S <= step * PER_UNIT[said] / NANOSECONDS <= LONGEST_PERIOD_S:
        return said
    periods_s = {unit: step * per / NANOSECONDS for unit, per in PER_UNIT.items()}
    least_s, most_s = USUAL_PERIODS_S
    most_ns = max(EPOCHS_NS) + LAST_NS
    periods_s = {unit: of for unit, of in periods_s.items() if first * PER_UNIT[unit] < most_ns}
    usual = [unit for unit, period_s in periods_s.items() if least_s <= period_s <= most_s]
    return min(usual, key=lambda unit: periods_s[unit] > SLOW_S, default="")


def is_clock(name: str, values: Values) -> bool:
    """Whether a column holds times: by its name, and since it mostly grows by usual steps."""
    if not TIME_NAME.search(name) or values.dtype.kind not in "fiu" or values.size < 2:
        return False
    steps = np.diff(values.astype(np.float64))
    by_one = np.median(steps) == 1.0  # counts rows
    return not by_one and bool(np.mean(steps > 0.0) > 0.9 and usual_unit(steps[steps > 0.0]))


def stamps_ns(values: Values, unit: str, since_ns: int | None, source: Path, name: str) -> Stamps:
    """Times (T,) as stamps, without rounding where the column holds whole numbers or decimal texts.

    Dates, also as text (`DATES`), keep their own origin. In those with slashes or dashes the month
    comes first, unless a first number of the column is above 12; in those with dots the day. Times
    of day continue after midnight, minutes and seconds after an hour. `unit` is a key of
    `PER_UNIT`. Times count from `since_ns`; None selects 1970 or one of `EPOCHS_NS` if they are
    then later than 2001, else `SINCE_NS`.
    """
    per, place = PER_UNIT[unit], f"{source}: {name}"
    known = np.ones(values.size, bool)
    are_dates = values.dtype.kind == "M"
    if values.dtype.kind in "Mm":
        known = ~np.isnat(values)
        exact = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        counts: Any = np.where(known, exact, 0)
    elif values.dtype.kind in "iu":
        counts = values.astype(object) * per
    elif values.dtype.kind == "f":
        known = np.isfinite(values)
        with np.errstate(over="ignore"):
            counts = np.rint(np.where(known, values, 0.0).astype(np.float64) * per)
    else:
        counts = np.zeros(values.size, object)
        rounds = last = 0
        cells = without_thousands([str(cell).strip() for cell in values])
        dates = [_date(text) for text in cells]
        day_first = next((date[0] for date in dates if date and 12 < int(date["first"]) < 100), "")
        for row, (text, date) in enumerate(zip(cells, dates, strict=True)):
            known[row] = text.lower() not in MISSING
            try:
                if date is not None:
                    are_dates, counts[row] = True, _date_ns(date, bool(day_first))
                elif known[row]:
                    counts[row] = _nanoseconds(text, per)
                    if ":" in text:
                        round_ns = DAY_NS if text.count(":") > 1 else HOUR_NS
                        rounds += last - counts[row] > round_ns // 2
                        last, counts[row] = counts[row], counts[row] + rounds * round_ns
            except (ArithmeticError, ValueError) as error:
                got = cell_at(text, row)
                got += f" beside {day_first!r}" * bool(day_first)
                cure = "Name a column of numbers, 10:00:00.5 or 2024-01-31 10:00:00.5 under time."
                raise BagError.about(place, "times", got, cure) from error
    if are_dates:
        is_zero = known.any() and counts[known].min() < DAY_NS  # times saved as dates
        stamps = _checked(counts, known, SINCE_NS if is_zero else 0, place, per)
        return Stamps(stamps, known, int(stamps[known][0]) if known.any() else 0)
    if since_ns is None:
        lowest = counts[known].min() if known.any() else 0
        since_ns = 0 if lowest >= FIRST_CLOCK_NS else SINCE_NS
        for epoch_ns in EPOCHS_NS:
            if FIRST_CLOCK_NS <= int(lowest) - epoch_ns < LAST_NS:
                return Stamps(_checked(counts - epoch_ns, known, 0, place, per), known, -epoch_ns)
    return Stamps(_checked(counts, known, since_ns, place, per), known, since_ns)


def counted_ns(values: Floats, rate_hz: float, since_ns: int | None, source: Path) -> Stamps:
    """Stamps of samples at a rate [Hz] from their numbers (T,); the first is at `since_ns`."""
    known = np.isfinite(values)
    first = values[known][0] if known.any() else 0.0
    ticks = np.rint(np.where(known, values - first, 0.0) * (NANOSECONDS / rate_hz))
    zero_ns = SINCE_NS if since_ns is None else since_ns
    return Stamps(_checked(ticks, known, zero_ns, str(source), NANOSECONDS), known, zero_ns)


def _checked(counts: NDArray[Any], known: Flags, since_ns: int, place: str, per: int) -> Integers:
    """Stamps [ns] from nanoseconds after `since_ns`, which stands for unknown ones."""
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


def _date(text: str) -> re.Match[str] | None:
    """The parts of a date and time; None if the text is none."""
    return next(filter(None, (form.fullmatch(text) for form in DATES)), None)


def _date_ns(date: re.Match[str], day_first: bool) -> int:
    """A date and time as nanoseconds since 1970, in UTC unless it names a zone.

    Raises:
        ValueError: the day does not exist.
    """
    said = {"between": "", "half": "", **date.groupdict()}
    is_named = said["middle"].isalpha()
    middle = 1 + MONTHS.index(said["middle"].lower()) if is_named else int(said["middle"])
    first, last = int(said["first"]), int(said["last"])
    if len(said["first"]) == 4:
        year, month, day = first, middle, last
    elif said["between"] == "." or day_first or is_named:
        year, month, day = last, middle, first
    else:
        year, month, day = last, first, middle
    hour = _of_day(int(said["hour"]), said["half"])
    clock = hour, int(said["minute"]), int(said["second"] or 0)
    moment = datetime(year + 2000 * (year < 100), month, day, *clock, tzinfo=timezone.utc)
    zone_s = 3600 * int(said["off_hours"] or 0) + 60 * int(said["off_minutes"] or 0)
    seconds = int(moment.timestamp()) - (-zone_s if said["sign"] == "-" else zone_s)
    return seconds * NANOSECONDS + int((said["digits"] or "")[:9].ljust(9, "0"))


def _of_day(hour: int, half: str | None) -> int:
    """An hour from 0 to 23; with `half`, from an hour of 1 to 12 before or after noon."""
    if not half:
        return hour
    if not 1 <= hour <= 12:
        raise ValueError(f"{hour} of a half day")
    return hour % 12 + 12 * (half.lower() == "p")


def _nanoseconds(text: str, per: int) -> int:
    """A number or a time of day as nanoseconds; ArithmeticError or ValueError for other texts."""
    if day := TIME_OF_DAY.fullmatch(text):
        hours = _of_day(int(day["hours"] or 0), day["half"])
        minutes, rest = day["minutes"] or day["short"], day["seconds"] or day["rest"]
        seconds = Decimal(re.sub("[,:]", ".", rest))
        hours += 24 * int(day["days"] or 0)
        text, per = str(3600 * hours + 60 * int(minutes) + seconds), NANOSECONDS
    elif said := WITH_UNIT.fullmatch(text):
        text, per = said["count"], PER_WORD[said["unit"]]
    count = Decimal(with_point(text)) * per
    if not abs(count) < 10**30:
        raise OverflowError
    return round(count)


FEWEST = 5
"""Fewest rows of each trial in a table whose times begin anew with every trial."""


def restarts(stamps_ns: Integers, known: Flags) -> list[int]:
    """Rows at which the known stamps (T,) go back to where they began, as in successive trials.

    Times that go back elsewhere, or after which few rows follow, are those of a faulty clock.
    """
    rows = np.flatnonzero(known)
    stamps = stamps_ns[rows]
    back = np.flatnonzero(np.diff(stamps) < 0) + 1
    runs = [stamps[a:b] for a, b in pairwise([0, *back.tolist(), stamps.size])]
    latest = 0.1 * np.ptp(runs[0]) if runs[0].size else 0
    if not back.size or any(run.size < FEWEST or abs(run[0] - stamps[0]) > latest for run in runs):
        return []
    return rows[back].tolist()
