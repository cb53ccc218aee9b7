# SPDX-License-Identifier: Apache-2.0
"""When a joint state was measured, and how late commands reach the arm, by the arm's motion.

An arm that lags is at a weighted mean of its recent references. Those depend on how late the
commands came, and the weights are unknown: for each lateness and joint they are fitted to the
motion by non-negative least squares. The motion of a joint at its top speed does not depend on its
reference, so those samples are left out.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening
from scipy.optimize import nnls

from intent_recognition.array_types import Floats

TELLING_RAD = 0.02
"""Least difference of two references that shows which of them an arm follows [rad]: several times
the noise of encoders, less than an arm's lag."""

_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Shares of the time from stamp to arrival at which the reference is compared: the fewest that
show an arm which lags by most of that time while it speeds up."""


class ArmClock:
    """Estimates how far the stamps of joint states are behind their arrivals, and why.

    Either the messages are late or the sender's clock is behind. A late message shows the arm at
    its reference of the stamp; if the clock is behind, the arm is at its reference of the arrival.

    Attributes:
        offset_ns: least time from stamp to arrival in the last 2 to 4 s [ns]; below zero if the
            sender's clock is ahead.
        late: whether the arm's motion has shown the messages to be late (True) or the sender's
            clock to be behind (False); None until it has shown either.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.late: bool | None = None
        self._since_ns: int | None = None
        self._least_ns = self._before_ns = 0

    def hear(self, arrival_ns: int, stamp_ns: int) -> None:
        """Take the arrival and the stamp of a message."""
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
        """Compare a measured posture (n,) with the references around its time.

        No arm is ahead of its reference, and real arms lag: an arm that is past its reference of
        the stamp shows that the sender's clock is behind.
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
        """Whether a joint state was measured at its stamp, rather than `offset_ns` later.

        Until the motion has shown it, an offset that makes every joint state stale counts as one
        of the clock.
        """
        if self.late is None:
            return 0 <= self.offset_ns <= max_age_ns
        return self.late and self.offset_ns >= 0

    def measured_ns(self, arrival_ns: int, stamp_ns: int, max_age_ns: float) -> int:
        """When a joint state was measured by this node's clock [ns], at the latest its arrival."""
        offset_ns = 0 if self.by_stamp(max_age_ns) else max(self.offset_ns, 0)
        return min(stamp_ns + offset_ns, arrival_ns)


LATENESSES_NS = np.arange(0, 450_000_000, 50_000_000)
"""Latenesses that are compared [ns], up to the delays of networks on which an arm should move."""
_N_LOOKS, _N_BEFORE, _N_AGAIN = 180, 30, 10
"""Number of samples kept, of the first of them that only explain the others, and of samples
between two comparisons: 3.6 s, 0.6 s and 0.2 s of joint states at 100 Hz."""
_AGES = np.subtract.outer(np.arange(_N_LOOKS), np.arange(_N_LOOKS))
_LAGGED = np.array(
    [(1.0 - k) * np.tril(k ** np.abs(_AGES)) for k in np.exp(-1.0 / np.array([2.5, 5, 10, 20]))]
)
"""First-order lags of 2.5 to 20 samples, as matrices (4, samples, samples); their upper left
corners serve fewer samples."""
_TOP_SPEED, _N_AT_TOP, _N_LEFT = 0.99, 12, 20
"""Share of its largest speed from which a joint is at top speed, for how many samples, and how
many other samples such a joint needs to count. Minimum jerk motions of up to 2 s stay above that
share for fewer samples; the samples left outnumber the weights."""


class Lateness:
    """Compares a measured arm with its references under each lateness."""

    def __init__(self) -> None:
        self._looks: deque[tuple[int, Floats, Floats]] = deque(maxlen=_N_LOOKS)
        self._last_ns = self._n = 0

    def is_due(self, time_ns: int) -> bool:
        """Whether a measurement at a time is far enough from the last one that was compared."""
        return time_ns - self._last_ns >= 19_000_000  # at 100 Hz every second state

    def shown_ns(self, time_ns: int, position: Floats, asked: Floats) -> int:
        """Lateness of commands that the arm's motion shows now [ns]; 0 if it shows none.

        Args:
            time_ns: time of the measurement, for which `is_due` holds.
            position: measured position (n,) [rad].
            asked: reference then under each of `LATENESSES_NS` (n_latenesses, n) [rad].
        """
        self._last_ns, self._n = time_ns, self._n + 1
        self._looks.append((time_ns, position, asked))
        if self._n % _N_AGAIN or len(self._looks) < _N_BEFORE + 2 * _N_AGAIN:
            return 0
        times_ns, positions, references = map(np.array, zip(*self._looks, strict=True))
        if np.ptp(references[:, 0], axis=0).max() < TELLING_RAD:
            return 0
        in_time, *late = references.swapaxes(0, 1)
        tells = ~at_top_speed(times_ns, positions)
        error = unexplained(positions, in_time, tells)
        # third differences of a motion are far smaller than those of noise, which have 20 times its
        # variance; 0.5 mrad are several times the noise of most encoders
        noise = np.sqrt(np.mean(np.diff(positions, 3, axis=0) ** 2) / 20.0)
        if error <= max(5e-4, 2.0 * noise):
            return 0
        errors = [error, *(unexplained(positions, one, tells) for one in late)]
        if min(errors) > 0.6 * error:  # measured: `test_late_commands.py`
            return 0
        self._looks.clear()
        return int(LATENESSES_NS[np.argmin(errors)])


def at_top_speed(times_ns: NDArray, positions: Floats) -> NDArray[np.bool_]:
    """Whether each joint of positions (T, n) [rad] moves steadily at its largest speed, (T, n)."""
    speed = np.abs(np.diff(positions, axis=0) / np.diff(times_ns)[:, None])
    top = binary_opening(
        speed >= _TOP_SPEED * speed.max(axis=0), np.ones((_N_AT_TOP, 1), dtype=bool)
    )
    return np.concatenate([top[:1], top])


def unexplained(positions: Floats, asked: Floats, tells: NDArray[np.bool_]) -> float:
    """Root mean square of the motion that no lag and constant offset explain [rad].

    `positions` were measured and `asked` was the reference at the same times, both (T, n) [rad];
    `tells` (T, n) selects the samples that count.
    """
    rows = np.arange(len(asked))
    # a lag is a mixture of pure delays, up to 0.5 s at 100 Hz, and of `_LAGGED`
    late = [asked[np.maximum(rows - delay, 0)] for delay in range(0, 26, 2)]
    late.extend(asked[0] + _LAGGED[:, : len(asked), : len(asked)] @ (asked - asked[0]))
    tables = np.array([*late, positions])[:, _N_BEFORE::2].transpose(2, 1, 0)  # one per joint
    counts = tells[_N_BEFORE::2].T[:, :, None]
    n = counts.sum(axis=1, keepdims=True)
    counts = counts & ((n >= _N_LEFT) | (n == counts.shape[1]))
    mean = (tables * counts).sum(axis=1, keepdims=True) / np.maximum(n, 1)
    tables = (tables - mean) * counts
    # lags are nearly collinear: the ridge lets the solver converge
    ridge = np.tile(1e-3 * np.eye(len(late), len(late) + 1), (len(tables), 1, 1))
    small = np.linalg.qr(np.concatenate([tables, ridge], axis=1), mode="r")
    squares = sum(nnls(one[:, :-1], one[:, -1])[1] ** 2 for one in small)
    return float(np.sqrt(squares / max(counts.sum(), 1)))
