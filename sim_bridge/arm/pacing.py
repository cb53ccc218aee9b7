# SPDX-License-Identifier: Apache-2.0
"""How many physics steps are due: simulated time kept to real time times a factor."""

from intent_recognition.errors import ArgumentError


class Pacer:
    """Counts steps due against a clock that the caller reads; pure arithmetic, no clock inside.

    When the physics falls behind by more than `longest_lag_s` of simulated time, the backlog is
    dropped instead of chased, so that a slow machine gives slow motion and not a spiral; the
    factor achieved is reported.

    Args:
        step_s: simulated time of one step.
        factor: simulated seconds per second of the clock.
        start_s: the clock now.
        longest_lag_s: simulated time to catch up at most.
        largest_batch: most steps to hand out at once, so that messages are served in between.
    """

    def __init__(
        self,
        step_s: float,
        factor: float,
        start_s: float,
        *,
        longest_lag_s: float = 0.1,
        largest_batch: int = 40,
    ) -> None:
        if not (step_s > 0.0 and factor > 0.0):
            raise ArgumentError.about(
                "step_s, factor", "positive numbers", (step_s, factor), "Check them."
            )
        self._step_s, self.factor = step_s, factor
        self._origin_s = start_s
        self._longest_lag_s, self._largest_batch = longest_lag_s, largest_batch
        self._window = (start_s, 0)
        self.dropped_s = 0.0

    def due(self, now_s: float, n_done: int) -> int:
        """Return how many steps to do now, with n_done done since the start."""
        lag_s = self.lag(now_s, n_done)
        if lag_s > self._longest_lag_s:
            excess_s = lag_s - self._longest_lag_s
            self._origin_s += excess_s / self.factor
            self.dropped_s += excess_s
            lag_s = self._longest_lag_s
        elif lag_s < -self._longest_lag_s:  # the clock was set back: go on from there
            self._origin_s += lag_s / self.factor
            lag_s = 0.0
        return max(0, min(int(lag_s / self._step_s + 1e-6), self._largest_batch))

    def lag(self, now_s: float, n_done: int) -> float:
        """Return the simulated time by which the physics is behind the clock [s]."""
        return (now_s - self._origin_s) * self.factor - n_done * self._step_s

    def change_factor(self, factor: float, now_s: float, n_done: int) -> None:
        """Go on at another factor from now; the lag, in simulated time, stays what it is."""
        lag_s = self.lag(now_s, n_done)
        self.factor = factor
        self._origin_s = now_s - (n_done * self._step_s + lag_s) / factor

    def achieved_factor(self, now_s: float, n_done: int) -> float:
        """Return simulated seconds per second of the clock since this was last asked."""
        since_s, n_then = self._window
        self._window = (now_s, n_done)
        return (n_done - n_then) * self._step_s / max(now_s - since_s, 1e-9)
