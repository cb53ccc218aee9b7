# SPDX-License-Identifier: Apache-2.0
"""Check and convert arrays passed by a caller: numbers, and times in seconds."""

from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError

LATEST_S = 9.2e9
"""Upper bound of times [s]: in nanoseconds, later times overflow 64 bits."""
FIRST_CLOCK_S = 1e9
"""Time from which on times are taken as seconds since 1970 [s], in September 2001; no recording
lasts 32 years."""
OFTEN_TIMES = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
"""Units of time often recorded instead of seconds, with their number per second."""


def as_numbers(
    argument: str, values: ArrayLike, cure: str = "Pass an array, with rows of the same length."
) -> Floats:
    """Copy values of any shape as floats; masked values and pandas' missing values become NaN.

    Raises:
        ShapeError: the values are not numbers, or rows differ in length.
    """
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        if isinstance(values, np.ma.MaskedArray):  # masked values were not measured
            values = np.ma.filled(values.astype(np.float64), np.nan)
        try:
            return np.array(values, dtype=np.float64)
        except TypeError:
            table: Any = values
            if not hasattr(table, "to_numpy"):
                raise
            return np.array(table.to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError, RuntimeError) as error:  # torch raises RuntimeError
        got = f"something else ({error})"
        raise ShapeError.about(argument, "an array of numbers", got, cure) from error


def as_seconds(argument: str, times: ArrayLike) -> Floats:
    """Copy times as seconds, converting dates and durations; missing times become NaN.

    Raises:
        ShapeError: the times are neither numbers nor dates nor durations.
    """
    cure = "Pass seconds as numbers, or datetime64."
    try:
        array = np.asarray(times)
    except (TypeError, ValueError, RuntimeError):
        return as_numbers(argument, times, cure)  # raises an error with the reason
    if array.dtype == object:
        seconds = np.array([_seconds(one) for one in array.flat], object)
        return as_numbers(argument, seconds.reshape(array.shape), cure)
    if array.dtype.kind not in "mM":
        return as_numbers(argument, times, cure)
    missing = np.isnat(array) | np.ma.getmaskarray(np.ma.asarray(times))
    count = array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64).astype(np.float64)
    return np.where(missing, np.nan, count * 1e-9)


def _seconds(one: object) -> object:
    """Convert a date (UTC without a time zone) or duration to seconds; keep any other value."""
    if isinstance(one, np.datetime64 | np.timedelta64):
        one = one.astype(f"{one.dtype.kind}8[us]").item()  # None for NaT
    if isinstance(one, datetime):
        return (one if one.tzinfo else one.replace(tzinfo=timezone.utc)).timestamp()
    return one.total_seconds() if isinstance(one, timedelta) else one


def _cure(time: float) -> str:
    """Advice for a time that is not in seconds."""
    if not np.isfinite(time):
        return "Leave that sample out."
    for name, factor in OFTEN_TIMES.items():
        if FIRST_CLOCK_S <= time / factor < LATEST_S:
            return f"Likely {name} since 1970: divide them by {factor:g}."
    return "Divide nanoseconds by 1e9."


def as_stamp_ns(argument: str, time_s: float) -> int:
    """A time [s] as a stamp in nanoseconds.

    Raises:
        ArgumentError: the time is not a finite number of seconds.
    """
    try:
        known = np.ndim(time_s) == 0 and abs(time_s) < LATEST_S  # False also for NaN
    except TypeError:
        known = False
    if not known:
        expected = f"seconds, a finite number below {LATEST_S:g}"
        is_number = isinstance(time_s, int | float | np.number)
        cure = _cure(float(time_s)) if is_number else "Pass the time of one measurement in seconds."
        got = f"an array of shape {np.shape(time_s)}" if np.ndim(time_s) else repr(time_s)
        raise ArgumentError.about(argument, expected, got, cure)
    return round(time_s * 1e9)


def check_times(argument: str, times_s: Floats) -> None:
    """Make sure that times (T,) are seconds and increase.

    Raises:
        ArgumentError: a time is not finite, in nanoseconds, or not later than the one before.
    """
    usable = np.abs(times_s) < LATEST_S  # False also for NaN
    if not np.all(usable):
        row = int(np.argmin(usable))
        got, cure = f"{times_s[row]:g} in row {row}", _cure(float(times_s[row]))
        raise ArgumentError.about(argument, f"seconds, finite and below {LATEST_S:g}", got, cure)
    if not np.all(np.diff(times_s) > 0):
        row = 1 + int(np.argmax(np.diff(times_s) <= 0))
        got = f"{times_s[row]:.9g} after {times_s[row - 1]:.9g} in row {row}"
        cure = "Sort the samples and drop duplicates."
        if times_s[row] == times_s[row - 1] >= FIRST_CLOCK_S:
            cure = "Likely they were kept with 32 bits, which are too few since 1970: use float64."
        raise ArgumentError.about(argument, "strictly increasing times", got, cure)
