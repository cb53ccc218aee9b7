# SPDX-License-Identifier: Apache-2.0
"""Time of the physics: which steps are due, and their stamps on the graph's clock."""

import time

from builtin_interfaces.msg import Time as TimeMessage
from rclpy.node import Node
from rclpy.time import Time

from sim_bridge.arm import TIME_STEP_S, SimulatedArm

STEP_NS = 1_000_000
"""Physics step [ns]."""

LONGEST_LAG_S = 0.1
"""Largest lag of simulated time that is caught up [s]; anything beyond is dropped."""


class Pacer:
    """Counts due steps against a clock that the caller reads, from its first time above zero on.

    When the physics lags by more than `LONGEST_LAG_S` of simulated time, the rest of the backlog is
    dropped, so that a slow machine shows slow motion instead of falling ever further behind.

    Args:
        factor: simulated seconds per second of the clock; also an attribute.
        largest_batch: most steps to return at once, so that messages are handled in between.

    Attributes:
        dropped_s: simulated time that was dropped.
    """

    def __init__(self, factor: float, largest_batch: int) -> None:
        self.factor, self._largest_batch = factor, largest_batch
        self.begun, self.dropped_s = False, 0.0
        self._origin_s, self._window = 0.0, (0.0, 0)

    def due(self, now_s: float, n_done: int) -> int:
        """Return the number of steps to do now, after n_done steps since the start."""
        if not self.begun:
            self.begun = now_s > 0.0
            self._origin_s, self._window = now_s, (now_s, n_done)
            return 0
        lag_s = self.lag(now_s, n_done)
        if lag_s > LONGEST_LAG_S:
            excess_s = lag_s - LONGEST_LAG_S
            self._origin_s += excess_s / self.factor
            self.dropped_s += excess_s
            lag_s = LONGEST_LAG_S
        elif lag_s < -LONGEST_LAG_S:  # the clock was set back: go on from there
            self._origin_s += lag_s / self.factor
            lag_s = 0.0
        return max(0, min(int(lag_s / TIME_STEP_S + 1e-6), self._largest_batch))

    def lag(self, now_s: float, n_done: int) -> float:
        """Return the simulated time by which the physics is behind the clock [s]."""
        return (now_s - self._origin_s) * self.factor - n_done * TIME_STEP_S

    def change_factor(self, factor: float, now_s: float, n_done: int) -> None:
        """Change the factor from now on; the lag in simulated time stays the same."""
        lag_s = self.lag(now_s, n_done)
        self.factor = factor
        self._origin_s = now_s - (n_done * TIME_STEP_S + lag_s) / factor

    def achieved_factor(self, now_s: float, n_done: int) -> float:
        """Return simulated seconds per second of the clock since the last call."""
        since_s, n_then = self._window
        self._window = (now_s, n_done)
        return (n_done - n_then) * TIME_STEP_S / max(now_s - since_s, 1e-9)


class PhysicsClock:
    """Paces the physics by a steady clock, or by another node's `/clock`.

    Stamps are simulated time (from zero at start) if that is published, else ROS time.

    Attributes:
        publishes: whether simulated time is published.
        follows: whether the physics follows another node's clock.
        pacer: counts the steps.
    """

    def __init__(
        self, node: Node, arm: SimulatedArm, factor: float, publishes: bool, rate_hz: float
    ) -> None:
        self._node, self._arm, self._rate_hz, self.publishes = node, arm, rate_hz, publishes
        self.follows = node.get_parameter("use_sim_time").value and not publishes
        # fewer messages than a queue holds (`qos.STATE`)
        batch = max(1, int(8 / (rate_hz * TIME_STEP_S)))
        self.pacer = Pacer(1.0 if self.follows else factor, batch)

    def now_s(self) -> float:
        """Time of the clock that paces the physics [s]."""
        return self._ros_ns() * 1e-9 if self.follows else time.monotonic()

    def due(self) -> int:
        """Number of steps that are due now."""
        return self.pacer.due(self.now_s(), self._arm.n_steps)

    def ends_period(self) -> bool:
        """Whether the last step ended a period of the joint states."""
        n, period = self._arm.n_steps, TIME_STEP_S * self._rate_hz
        return int(n * period + 1e-9) != int((n - 1) * period + 1e-9)

    def zero_ns(self) -> int:
        """Stamp of the physics' time zero, if no time had been dropped [ns]."""
        if self.publishes:
            return 0
        for _ in range(5):  # again if the process was interrupted between reading the two clocks
            now_s, ros_ns = self.now_s(), self._ros_ns()
            if self.now_s() - now_s < 1e-3:
                break
        lag_s = self.pacer.lag(now_s, self._arm.n_steps)
        return ros_ns - int((lag_s + self._arm.time_s) / self.pacer.factor * 1e9)

    def stamp_ns(self, zero_ns: int) -> int:
        """Stamp of the last step, given the `zero_ns` of its batch [ns]."""
        factor = 1.0 if self.publishes else self.pacer.factor
        return zero_ns + int(self._arm.n_steps * STEP_NS / factor)

    def stamp(self) -> TimeMessage:
        """Stamp of a message sent now."""
        simulated_ns = self._arm.n_steps * STEP_NS
        return Time(nanoseconds=simulated_ns if self.publishes else self._ros_ns()).to_msg()

    def start_s(self, at_ns: int) -> float | None:
        """Time of a stamp on the physics' clock [s]; None for a zero stamp."""
        if at_ns == 0:
            return None
        if self.publishes:
            return at_ns * 1e-9
        if not self.pacer.begun:
            return self._arm.time_s + (at_ns - self._ros_ns()) * 1e-9
        return (at_ns - self.zero_ns()) * 1e-9 * self.pacer.factor

    def _ros_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)
