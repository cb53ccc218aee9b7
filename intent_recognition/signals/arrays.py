# SPDX-License-Identifier: Apache-2.0
"""Arrays that a caller passes: numbers, and times in seconds."""

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError

LATEST_S = 9.2e9
"""Latest time of a sample [s]: nanoseconds since then fill 64 bits."""


def as_numbers(argument: str, values: ArrayLike) -> Floats:
    """A copy as an array of numbers.

    Args:
        argument: its name, for the message.
        values: of any shape.

    Raises:
        ShapeError: they are no numbers, or rows differ in length.
    """
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        got, cure = f"something else ({error})", "Pass an array, with rows of the same length."
        raise ShapeError.about(argument, "an array of numbers", got, cure) from error


def as_stamp_ns(argument: str, time_s: float) -> int:
    """A time [s] as a stamp in nanoseconds.

    Raises:
        ArgumentError: it is no finite number of seconds.
    """
    try:
        known = np.ndim(time_s) == 0 and abs(time_s) < LATEST_S  # False also for NaN
    except TypeError:
        known = False
    if not known:
        expected = f"seconds, a finite number below {LATEST_S:g}"
        cure = "Pass the time of one measurement; divide nanoseconds by 1e9."
        raise ArgumentError.about(argument, expected, repr(time_s), cure)
    return round(time_s * 1e9)


def check_times(argument: str, times_s: Floats) -> None:
    """Make sure that times (T,) are seconds and increase.

    Raises:
        ArgumentError: one is not finite, in nanoseconds, or not later than the one before.
    """
    usable = np.abs(times_s) < LATEST_S  # False also for NaN
    if not np.all(usable):
        row = int(np.argmin(usable))
        got, cure = f"{times_s[row]:g} in row {row}", "Pass seconds; divide nanoseconds by 1e9."
        raise ArgumentError.about(argument, f"seconds, finite and below {LATEST_S:g}", got, cure)
    if not np.all(np.diff(times_s) > 0):
        row = 1 + int(np.argmax(np.diff(times_s) <= 0))
        got = f"{times_s[row]:.9g} after {times_s[row - 1]:.9g} in row {row}"
        cure = "Sort the samples and drop duplicates."
        raise ArgumentError.about(argument, "strictly increasing times", got, cure)
