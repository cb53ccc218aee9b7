# SPDX-License-Identifier: Apache-2.0
"""When a joint state was measured, by a clock that may not be ours.

A stamp that is behind its arrival may come from a message that is late or from a clock that is
behind; one direction of messages does not tell which. The arm's own motion does: a late message
shows the arm where its reference was at the stamp, a clock that is behind where it is now.
"""

from collections.abc import Callable

import numpy as np

from intent_recognition.array_types import Floats

TELLING_RAD = 0.02
"""Difference of two references that tells which of both an arm follows [rad]. Convention: several
times the noise of encoders, less than what an arm lags behind."""

_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Where between stamp and arrival the arm's reference is looked at. Convention: the least that
shows an arm that lags by most of the time between both, while it speeds up."""


class ArmClock:
    """Estimates how far the stamps of joint states are behind their arrivals, and why.

    Attributes:
        offset_ns: least time from stamp to arrival lately [ns]; below zero where the sender's clock
            is ahead.
        late: whether the arm's motion has shown the messages to be late (True) or the sender's
            clock to be behind (False); None where it has not moved yet.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.late: bool | None = None
        self._since_ns: int | None = None
        self._least_ns = self._before_ns = 0

    def hear(self, arrival_ns: int, stamp_ns: int) -> None:
        """Take the times of a message."""
        behind_ns = arrival_ns - stamp_ns
        if self._since_ns is None:
            self._since_ns, self._least_ns, self._before_ns = arrival_ns, behind_ns, behind_ns
        elif arrival_ns - self._since_ns > 2_000_000_000:  # at 10 Hz 20 messages
            self._since_ns, self._before_ns, self._least_ns = arrival_ns, self._least_ns, behind_ns
        self._least_ns = min(self._least_ns, behind_ns)
        self.offset_ns = min(self._least_ns, self._before_ns)

    def compare(
        self, stamp_ns: int, position: Floats, reference: Callable[[int], Floats | None]
    ) -> None:
        """Take where the arm was measured (n,), and what gives its reference at a time.

        No arm is ahead of its reference, and real ones lag: one that is past where its reference
        was at the stamp shows that its clock is behind.
        """
        ends = [reference(stamp_ns), reference(stamp_ns + self.offset_ns)]
        if ends[0] is None or ends[1] is None or np.abs(ends[0] - ends[1]).max() < TELLING_RAD:
            return
        times_ns = stamp_ns + np.rint(_SHARES[1:-1] * self.offset_ns).astype(np.int64)
        asked = [ends[0], *map(reference, times_ns.tolist()), ends[1]]
        errors = np.abs(np.array(asked) - position).max(axis=1)
        share = _SHARES[int(np.argmin(errors))]
        if errors.min() < 0.5 * errors.max() and share != 0.25:
            self.late = bool(share < 0.25)

    def by_stamp(self, max_age_ns: float) -> bool:
        """Whether stamps say when a joint state was measured, and not how they come in.

        Where the motion has not shown it, an offset that makes every joint state stale counts as
        that of a clock.
        """
        if self.late is None:
            return 0 <= self.offset_ns <= max_age_ns
        return self.late and self.offset_ns >= 0

    def measured_ns(self, arrival_ns: int, stamp_ns: int, max_age_ns: float) -> int:
        """When it was measured by our clock [ns], at the latest when it came."""
        offset_ns = 0 if self.by_stamp(max_age_ns) else max(self.offset_ns, 0)
        return min(stamp_ns + offset_ns, arrival_ns)
