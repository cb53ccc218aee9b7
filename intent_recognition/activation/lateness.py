# SPDX-License-Identifier: Apache-2.0
"""How late commands reach the arm, told from how an arm follows that lags.

An arm that lags is where its reference was a while ago as long as that moves. One that has not got
a command goes on by the one before, falls behind, and catches up once the command has come.
"""

from collections import deque

import numpy as np

from intent_recognition.activation.arm_clock import TELLING_RAD
from intent_recognition.array_types import Floats

LARGEST_LATENESS_NS = 500_000_000
"""Commands later than this [ns] count as lost. Convention: above the delays of networks on which
an arm should move."""
_CAUGHT_UP = 0.33
"""An arm has caught up if its error is below this share of what the largest lag would make it.
Measurement: `test_late_commands.py`."""
_STEP_NS = 9_000_000
"""Least time between two looks [ns]. Convention: those at 100 Hz all count."""


class Lateness:
    """Compares a measured arm with what it was asked for in the last `LARGEST_LATENESS_NS`."""

    def __init__(self) -> None:
        self._asked: deque[tuple[int, Floats]] = deque()  # the newest first
        self._behind_ns = 0  # the most since the reference stood
        self._caught_up_ns: int | None = None

    def shown_ns(self, time_ns: int, position: Floats, asked: Floats, before: list[Floats]) -> int:
        """By how much a command came late as the arm's motion shows now [ns]; 0 for nothing.

        Args:
            time_ns: of the measurement, above that of the last.
            position: measured (n,) [rad].
            asked: of the arm then (n,) [rad].
            before: where it would be then had it not got one of the last commands, (n,) each.
        """
        if self._asked and time_ns - self._asked[0][0] < _STEP_NS:
            return 0
        self._asked.appendleft((time_ns, asked))
        while time_ns - self._asked[-1][0] > LARGEST_LATENESS_NS:
            self._asked.pop()
        times_ns, rows = map(np.array, zip(*self._asked, strict=True))
        ages_ns = time_ns - times_ns
        errors = np.abs(rows - position).max(axis=1)
        moved = np.abs(rows - asked).max(axis=1)
        if errors[0] >= TELLING_RAD:
            nearest = np.argmax(np.diff(errors, append=np.inf) >= 0.0)
            if any(np.abs(position - one).max() < 0.5 * errors[0] for one in before):
                self._behind_ns = max(self._behind_ns, int(ages_ns[nearest]))
        elif moved.max() < TELLING_RAD:
            self._behind_ns = 0
        lagging = moved[np.searchsorted(ages_ns, self._behind_ns, "right") - 1]
        if errors[0] > _CAUGHT_UP * lagging:
            self._caught_up_ns = None
        elif self._caught_up_ns is None:
            self._caught_up_ns = time_ns
        elif lagging >= TELLING_RAD and 2 * (time_ns - self._caught_up_ns) >= self._behind_ns:
            return self._behind_ns
        return 0
