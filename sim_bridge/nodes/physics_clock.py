# SPDX-License-Identifier: Apache-2.0
"""The physics' time: when its steps are due, and what it is on the clock of the graph."""

import time

from builtin_interfaces.msg import Time as TimeMessage
from rclpy.node import Node
from rclpy.time import Time

from intent_recognition.errors import ArgumentError
from sim_bridge.arm import TIME_STEP_S, SimulatedArm

STEP_NS = 1_000_000
"""Physics step [ns]."""
BURST = 8
"""Joint states sent at once when catching up: fewer than their queue holds (`qos.STATE`)."""


LONGEST_LAG_S = 0.1
"""Simulated time to catch up at most [s]. Convention."""


class Pacer:
    """Counts steps due against a clock that the caller reads; pure arithmetic, no clock inside.

    When the physics falls behind by more than `LONGEST_LAG_S` of simulated time, the backlog is
    dropped instead of chased, so that a slow machine gives slow motion and not a spiral.

    Args:
        step_s: simulated time of one step.
        factor: simulated seconds per second of the clock.
        start_s: the clock now.
        largest_batch: most steps to hand out at once, so that messages are served in between.
    """

    def __init__(
        self, step_s: float, factor: float, start_s: float, largest_batch: int = 40
    ) -> None:
        if not (step_s > 0.0 and factor > 0.0):
            raise ArgumentError.about(
                "step_s, factor", "positive numbers", (step_s, factor), "Check them."
            )
        self._step_s, self.factor = step_s, factor
        self._origin_s = start_s
        self._largest_batch = largest_batch
        self._window = (start_s, 0)
        self.dropped_s = 0.0

    def due(self, now_s: float, n_done: int) -> int:
        """Return how many steps to do now, with n_done done since the start."""
        lag_s = self.lag(now_s, n_done)
        if lag_s > LONGEST_LAG_S:
            excess_s = lag_s - LONGEST_LAG_S
            self._origin_s += excess_s / self.factor
            self.dropped_s += excess_s
            lag_s = LONGEST_LAG_S
        elif lag_s < -LONGEST_LAG_S:  # the clock was set back: go on from there
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


class PhysicsClock:
    """Paces the physics by a steady clock, or by another node's `/clock`.

    Stamps are simulated time (from zero at start) if that is published, else ROS time.

    Args:
        node: whose clock ROS time is.
        arm: whose steps count.
        factor: simulated seconds per second.
        publishes: whether simulated time is published.
        rate_hz: of the joint states.

    Attributes:
        publishes: the same.
    """

    def __init__(
        self, node: Node, arm: SimulatedArm, factor: float, publishes: bool, rate_hz: float
    ) -> None:
        self._node, self._arm, self._factor, self._rate_hz = node, arm, factor, rate_hz
        self.publishes = publishes
        self._follows = node.get_parameter("use_sim_time").value and not publishes
        self._pacer: Pacer | None = None

    @property
    def runs(self) -> bool:
        """Whether the clock that paces the physics has a time yet."""
        return self._pacer is not None

    @property
    def dropped_s(self) -> float:
        """Simulated time that was left out."""
        return 0.0 if self._pacer is None else self._pacer.dropped_s

    @property
    def factor(self) -> float:
        """Simulated seconds per second of the clock that paces, as asked for."""
        return 1.0 if self._follows else self._factor

    def change_factor(self, factor: float) -> None:
        """Go on at another pace, unless another clock is followed."""
        self._factor = factor
        if self._pacer is not None and not self._follows:
            self._pacer.change_factor(factor, self.now_s(), self._arm.n_steps)

    def achieved_factor(self) -> float:
        """The pace since this was last asked; 0 before the clock runs."""
        if self._pacer is None:
            return 0.0
        return self._pacer.achieved_factor(self.now_s(), self._arm.n_steps)

    def now_s(self) -> float:
        """The clock that paces the physics [s]."""
        return (
            self._node.get_clock().now().nanoseconds * 1e-9 if self._follows else time.monotonic()
        )

    def due(self) -> int:
        """Steps that are due now."""
        now_s = self.now_s()
        if self._pacer is not None:
            return self._pacer.due(now_s, self._arm.n_steps)
        if now_s > 0.0:
            batch = max(1, int(BURST / (self._rate_hz * TIME_STEP_S)))
            self._pacer = Pacer(TIME_STEP_S, self.factor, now_s, largest_batch=batch)
        return 0

    def ends_period(self) -> bool:
        """Whether the last step ended a period of the joint states."""
        n, period = self._arm.n_steps, TIME_STEP_S * self._rate_hz
        return int(n * period + 1e-9) != int((n - 1) * period + 1e-9)

    def zero_ns(self) -> int:
        """The time of stamps at which the physics' time zero was, were it paced without a gap."""
        if self.publishes or self._pacer is None:
            return 0
        lag_s = self._pacer.lag(self.now_s(), self._arm.n_steps)
        real_s = (lag_s + self._arm.time_s) / self._pacer.factor
        return self._node.get_clock().now().nanoseconds - int(real_s * 1e9)

    def stamp_ns(self, zero_ns: int) -> int:
        """Stamp of the last step, for the time zero of the steps done at once [ns]."""
        factor = 1.0 if self.publishes else self.factor
        return zero_ns + int(self._arm.n_steps * STEP_NS / factor)

    def stamp(self) -> TimeMessage:
        """Stamp of a message now."""
        if self.publishes:
            return Time(nanoseconds=self._arm.n_steps * STEP_NS).to_msg()
        return self._node.get_clock().now().to_msg()

    def start_s(self, at_ns: int) -> float | None:
        """When a stamp is on the physics' clock [s]; None for a zero stamp."""
        if at_ns == 0:
            return None
        if self.publishes:
            return at_ns * 1e-9
        if self._pacer is None:
            return self._arm.time_s + (at_ns - self._node.get_clock().now().nanoseconds) * 1e-9
        return (at_ns - self.zero_ns()) * 1e-9 * self._pacer.factor
