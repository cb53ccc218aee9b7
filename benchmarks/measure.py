# SPDX-License-Identifier: Apache-2.0
"""Timing, and one result."""

import time
from collections.abc import Callable
from statistics import median
from typing import NamedTuple


class Result(NamedTuple):
    """One line: what was measured, what is required, and why.

    `direction` is "at most" or "at least"; `remark` says what stands behind the number.
    """

    name: str
    measured: float
    required: float
    direction: str
    unit: str
    remark: str = ""

    @property
    def verdict(self) -> str:
        """`ok` or `falls short`."""
        good = self.measured <= self.required
        if self.direction == "at least":
            good = self.measured >= self.required
        return "ok" if good else "falls short"

    def line(self) -> str:
        """The result as printed."""
        measured = f"{_digits(self.measured)} {self.unit}"
        required = f"{self.direction} {_digits(self.required)} {self.unit}"
        return f"{self.name:<54} {measured:>14}   {required:<20} {self.verdict:<11} {self.remark}"

    def to_dict(self) -> dict[str, object]:
        """The result for JSON."""
        return self._asdict() | {"verdict": self.verdict}


def at_most(name: str, measured: float, required: float, unit: str, remark: str = "") -> Result:
    """A result that is to be no larger than required."""
    return Result(name, measured, required, "at most", unit, remark)


def at_least(name: str, measured: float, required: float, unit: str, remark: str = "") -> Result:
    """A result that is to be no smaller than required."""
    return Result(name, measured, required, "at least", unit, remark)


def _digits(number: float) -> str:
    """Three digits, or all before the point."""
    return f"{number:.0f}" if 1e3 <= abs(number) < 1e6 else f"{number:.3g}"


def seconds(work: Callable[[], object], repeats: int = 5) -> float:
    """Median time of one call, after one that is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return median(times)


def seconds_of_both(
    first: Callable[[], object], second: Callable[[], object], repeats: int = 5
) -> tuple[float, float]:
    """Median times of two calls taken in turn, so that a busy machine slows both alike."""
    first(), second()
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        for work, found in zip((first, second), times, strict=True):
            start = time.perf_counter()
            work()
            found.append(time.perf_counter() - start)
    return median(times[0]), median(times[1])
