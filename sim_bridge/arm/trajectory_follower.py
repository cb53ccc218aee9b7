# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories as reference curves: validation, interpolation, replacement, holding.

The semantics are those of ros2_control's joint_trajectory_controller: a trajectory with a zero
stamp starts now, one with a later stamp starts then (the old one continues until then), points in
the past are skipped, and the last point is held. There are three differences, which spare the arm.
Positions without velocities are joined by a smooth curve instead of straight lines. If a new
trajectory does not begin at the current reference, the difference fades out instead of jumping, so
slowly that the sum keeps the limits. A trajectory is rejected if that would take too long.
"""

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import LWR_LIMITS, RATE_TOLERANCE, JointLimits
from intent_recognition.motion import JointReference
from sim_bridge.arm.trajectory_command import RejectedTrajectoryError, TrajectoryCommand

# Peaks over [0, 1] of the quintic that fades a unit offset or a unit velocity to rest.
_OFFSET_ACCELERATION = 10.0 / np.sqrt(3.0)
_VELOCITY_ACCELERATION = 3.941
_OFFSET_VELOCITY = 1.875
ACCELERATION_SHARE = 0.5
"""Share of the joints' acceleration limit with which the difference to a new trajectory may fade
out, on top of the trajectory's own acceleration."""
LONGEST_FADE_S = 8.0
"""A trajectory that cannot be joined in this time [s] is rejected; the activation lets an offset
fade in at most this time."""


class _Curve:
    """Quintics through a command's points, straight before the first, at rest after the last."""

    def __init__(self, command: TrajectoryCommand, start_s: float) -> None:
        self.knots_s = command.times_s + start_s
        first, last = command.positions[0], command.positions[-1]
        pieces = [_polynomial(first, command.velocities[0])]
        for k, duration in enumerate(np.diff(command.times_s)):
            pieces.append(_segment(command, k, float(duration)))
        pieces.append(_polynomial(last))
        self._knots = self.knots_s.tolist()
        self._origins = [self._knots[0], *self._knots]
        self._pieces = pieces

    def sample(self, time_s: float) -> JointReference:
        piece = bisect_right(self._knots, time_s)
        return _evaluate(self._pieces[piece], time_s - self._origins[piece])


class _Entry(NamedTuple):
    """A curve that is followed from start_s on, plus an offset that fades by start_s + fade_s."""

    start_s: float
    curve: _Curve | JointReference
    offset: Floats  # polynomial (6, n)
    fade_s: float

    def sample(self, time_s: float) -> JointReference:
        base = self.curve if isinstance(self.curve, JointReference) else self.curve.sample(time_s)
        elapsed = time_s - self.start_s
        if elapsed >= self.fade_s:
            return base
        extra = _evaluate(self.offset, max(elapsed, 0.0))
        return JointReference(*map(np.add, base, extra))


class TrajectoryFollower:
    """Computes the reference at any time from the commands accepted so far, without clock or ROS.

    Position and velocity of the reference are continuous; its velocity and acceleration keep the
    limits unless a trajectory itself exceeds them. Times are seconds of any one clock, and must not
    run backward. Before the first command, the reference is a fixed position (n_joints,) [rad].
    """

    def __init__(self, position: Floats, limits: JointLimits = LWR_LIMITS) -> None:
        self._limits = limits
        self.hold(position)

    def hold(self, position: Floats) -> None:
        """Forget all commands and rest at position (n_joints,) [rad], without a blend."""
        rest = JointReference.at_rest(position.copy())
        self._entries = [_Entry(-np.inf, rest, np.zeros((6, len(position))), 0.0)]

    def accept(self, command: TrajectoryCommand, now_s: float) -> None:
        """Follow this command from its start on; the running one continues until then.

        A waiting command with a later start than this one's is dropped.

        Raises:
            RejectedTrajectoryError: the command is too far from the current reference to be joined
                within the limits; nothing has changed.
        """
        start_s = now_s if command.start_s is None else command.start_s
        switch_s = max(start_s, now_s)
        while len(self._entries) > 1 and self._entries[1].start_s <= now_s:
            self._entries.pop(0)
        kept = [e for k, e in enumerate(self._entries) if k == 0 or e.start_s < switch_s]
        old = _sample(kept, switch_s)
        curve = _Curve(command, start_s)
        new = curve.sample(switch_s)
        offset, velocity = old.position - new.position, old.velocity - new.velocity
        shortest_s = max(self._fade_time(offset, velocity), curve.knots_s[0] - switch_s)
        self._entries = [*kept, self._joined(curve, switch_s, offset, velocity, shortest_s)]

    def _joined(
        self, curve: _Curve, switch_s: float, offset: Floats, velocity: Floats, fade_s: float
    ) -> _Entry:
        """Follow the curve from switch_s on, with an offset that fades as fast as limits allow."""
        rest = np.zeros_like(offset)
        bounds = np.stack([self._limits.velocity, self._limits.acceleration])
        longest_s = max(LONGEST_FADE_S, fade_s)
        while True:
            fading = _quintic(offset, velocity, rest, rest, rest, rest, fade_s)
            entry = _Entry(switch_s, curve, fading, fade_s)
            if max(np.abs(offset).max(), np.abs(velocity).max()) < 1e-9:
                return entry
            times = switch_s + fade_s * np.linspace(0.0, 1.0, 65)
            knots = curve.knots_s[(curve.knots_s > switch_s) & (curve.knots_s < times[-1])]
            times = np.concatenate([times, knots, np.nextafter(knots, -np.inf)])
            alone = np.array([curve.sample(time) for time in times])[:, 1:]
            both = np.array([entry.sample(time) for time in times])[:, 1:]
            largest = np.maximum(bounds, np.abs(alone).max(axis=0))  # or the trajectory's own
            if np.all(np.abs(both) <= largest * (1.0 + RATE_TOLERANCE)):
                return entry
            if fade_s >= longest_s:
                text = f"cannot be joined within the limits from {np.abs(offset).max():.3f} rad off"
                raise RejectedTrajectoryError("cannot_join", f"joint_trajectory {text}")
            fade_s = min(1.15 * fade_s, longest_s)

    def sample(self, time_s: float) -> JointReference:
        """Return the reference at a time not before the last accepted command's `now_s`."""
        return _sample(self._entries, time_s)

    def _fade_time(self, offset: Floats, velocity: Floats) -> float:
        """Return the shortest fade [s] whose acceleration stays within its share.

        Solves c1 |offset| / T^2 + c2 |velocity| / T <= a for each joint; the slowest counts.
        """
        bound = ACCELERATION_SHARE * self._limits.acceleration
        by_offset = _OFFSET_ACCELERATION * np.abs(offset)
        by_velocity = _VELOCITY_ACCELERATION * np.abs(velocity)
        root = np.sqrt(by_velocity**2 + 4.0 * bound * by_offset)
        fade = (by_velocity + root) / (2.0 * bound)
        speed = 0.5 * self._limits.velocity
        fade = np.maximum(fade, _OFFSET_VELOCITY * np.abs(offset) / speed)
        return max(float(fade.max()), 0.05)


def _sample(entries: list[_Entry], time_s: float) -> JointReference:
    for entry in reversed(entries):
        if entry.start_s <= time_s:
            return entry.sample(time_s)
    return entries[0].sample(time_s)


def _polynomial(*coefficients: Floats) -> Floats:
    """Return coefficients (6, n) by rising power, zero where not given."""
    polynomial = np.zeros((6, len(coefficients[0])))
    for power, values in enumerate(coefficients):
        polynomial[power] = values
    return polynomial


def _segment(command: TrajectoryCommand, k: int, duration_s: float) -> Floats:
    """Return the polynomial (6, n) from point k to the next: cubic, quintic if accelerated."""
    q0, q1 = command.positions[k], command.positions[k + 1]
    v0, v1 = command.velocities[k], command.velocities[k + 1]
    if command.accelerations is None:
        slope = (q1 - q0) / duration_s
        square = (3.0 * slope - 2.0 * v0 - v1) / duration_s
        return _polynomial(q0, v0, square, (v0 + v1 - 2.0 * slope) / duration_s**2)
    return _quintic(
        q0, v0, command.accelerations[k], q1, v1, command.accelerations[k + 1], duration_s
    )


def _quintic(
    q0: Floats, v0: Floats, a0: Floats, q1: Floats, v1: Floats, a1: Floats, T: float
) -> Floats:
    """Return the quintic (6, n) from a position, velocity and acceleration to others after T."""
    rest = q1 - q0 - v0 * T - 0.5 * a0 * T**2  # what is left for powers 3 to 5
    speed = (v1 - v0 - a0 * T) * T
    bend = (a1 - a0) * T**2
    return _polynomial(
        q0,
        v0,
        0.5 * a0,
        (10.0 * rest - 4.0 * speed + 0.5 * bend) / T**3,
        (-15.0 * rest + 7.0 * speed - bend) / T**4,
        (6.0 * rest - 3.0 * speed + 0.5 * bend) / T**5,
    )


def _evaluate(polynomial: Floats, t: float) -> JointReference:
    t2 = t * t
    t3, t4 = t2 * t, t2 * t2
    value = np.array([1.0, t, t2, t3, t4, t4 * t])
    first = np.array([0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t4])
    second = np.array([0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3])
    return JointReference(value @ polynomial, first @ polynomial, second @ polynomial)
