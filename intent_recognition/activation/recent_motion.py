# SPDX-License-Identifier: Apache-2.0
"""How the arm has moved of late, which shows whether it rests at one place."""

from collections import deque
from itertools import pairwise

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JointLimits

REST_RAD_S = 0.05
"""Largest joint speed of an arm at rest [rad/s]: several times the noise of a measured velocity. A
plan that begins there may be off by `lead_s` times this speed."""
SEEN_NS = 20_000_000
"""Least time for which an arm must be seen before a motion begins [ns]: at twice `REST_RAD_S` it
moves by 2 mrad, more than the steps of encoders."""
_WINDOW_NS = 100_000_000
"""Time over which positions show an arm at rest [ns]: ten joint states at 100 Hz."""


class RecentMotion:
    """Joint positions of the last 0.1 s, and the newest one from before."""

    def __init__(self) -> None:
        self._positions: deque[tuple[int, Floats]] = deque()

    def remember(self, time_ns: int, position: Floats) -> None:
        """Take positions, (n,) [rad], in order of time."""
        recent = self._positions
        recent.append((time_ns, position))
        while len(recent) > 2 and recent[1][0] <= time_ns - _WINDOW_NS:
            recent.popleft()

    def speed(
        self, limits: JointLimits, max_gap_s: float, least_ns: int = _WINDOW_NS
    ) -> float | None:
        """Largest mean speed of a joint between both halves of the positions [rad/s].

        None if they cover less than `least_ns` or have a longer gap than `max_gap_s`.
        """
        times_ns, positions = zip(*self._positions, strict=True)
        table = np.column_stack([(np.array(times_ns) - times_ns[0]) * 1e-9, positions])
        gap_s, half = max(np.diff(table[:, 0]), default=0.0), len(table) // 2
        if times_ns[-1] - times_ns[0] < least_ns or gap_s > max_gap_s:
            return None
        way = table[half:].mean(axis=0) - table[:half].mean(axis=0)
        return float(limits.largest(way[1:]) / way[0])

    def apart(self) -> Floats:
        """How far apart the positions of each joint are, (n,) [rad]."""
        return np.asarray(np.ptp([position for _, position in self._positions], axis=0))

    def gaps(self, max_gap_s: float) -> dict[int, float]:
        """Gaps between positions that are longer than `max_gap_s` [s], by their beginning [ns]."""
        times_ns = [time_ns for time_ns, _ in self._positions]
        gaps = {before: (after - before) * 1e-9 for before, after in pairwise(times_ns)}
        return {before: gap_s for before, gap_s in gaps.items() if gap_s > max_gap_s}
