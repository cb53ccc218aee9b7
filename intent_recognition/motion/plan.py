# SPDX-License-Identifier: Apache-2.0
"""A joint-space plan as its receiver sees it, samples joined by cubics, and checks of limits."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from intent_recognition.array_types import Floats, settle
from intent_recognition.kinematics import (
    POSITION_TOLERANCE_RAD,
    RATE_TOLERANCE,
    JointLimits,
    position_violation,
)

POSITION_MARGIN_RAD = 0.01
"""Distance of paths from position limits [rad]; no cubic strays farther between its samples
(`plan_step`)."""
STEP_S = 0.02
"""Time between the samples of a plan [s]; longer motions get longer steps (`plan_step`). With it a
cubic strays from a path of 8 rad/s^2 by 0.4 mrad at most."""


class JointReference(NamedTuple):
    """Position, velocity and acceleration that a plan asks of the arm at one time, each (n,)."""

    position: Floats
    velocity: Floats
    acceleration: Floats

    @classmethod
    def at_rest(cls, position: Floats) -> "JointReference":
        """The reference of an arm at rest at `position` [rad]."""
        q = np.array(position, dtype=np.float64)
        return cls(q, np.zeros_like(q), np.zeros_like(q))


class PhaseState(NamedTuple):
    """Phase of an interaction in [0, 1], its rate [1/s] and acceleration [1/s^2]."""

    phase: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0


BEGINNING = PhaseState()
"""Phase state at the start of an interaction, at rest."""


@dataclass(frozen=True, eq=False)
class JointPlan:
    """A motion from its first sample's reference to rest at its last sample.

    Between samples the motion is the cubic with the samples' positions and velocities (Hermite),
    which is what a joint trajectory controller does with a message without accelerations: limits
    are checked on that cubic, not on an ideal the receiver never sees.

    Attributes:
        times_s: (T,) seconds after the plan's start, from 0, strictly increasing; whole
            nanoseconds, as a message holds them.
        positions: (T, n) [rad].
        velocities: (T, n) [rad/s]; the last row is zero.
        phase: (T,) phase of the predicted interaction, in [0, 1].
        phase_rate: (T,) rate of the phase [1/s].
        kind: "interaction", "stop", "home", "pretrigger" or "yield" (to a person's lead).
        clamped: indices of joints whose prediction left the position limits and was held inside.
        outside: indices of joints that leave the position limits; empty but for a brake.
        slowed: whether the prediction at its own speed would break a velocity or acceleration
            limit.
    """

    times_s: Floats
    positions: Floats
    velocities: Floats
    phase: Floats
    phase_rate: Floats
    kind: str
    clamped: tuple[int, ...] = ()
    slowed: bool = False
    outside: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        settle(self, times_s=np.round(np.multiply(self.times_s, 1e9)) * 1e-9)
        for name in ("times_s", "positions", "velocities", "phase", "phase_rate"):
            settle(self, **{name: np.array(getattr(self, name), dtype=np.float64)})

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.times_s[-1])

    @property
    def end(self) -> Floats:
        """Posture in which the plan comes to rest, (n,) [rad]."""
        return self.positions[-1]

    @cached_property
    def _cubics(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.times_s, self.positions, self.velocities)

    @cached_property
    def _progress(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.times_s, self.phase, self.phase_rate)

    def at(self, time_s: float) -> JointReference:
        """The reference `time_s` after the start; at rest after the end."""
        if time_s >= self.duration_s:
            return JointReference.at_rest(self.positions[-1])
        return JointReference(*self.sampled(max(time_s, 0.0)))

    def subdivided(self, n: int) -> tuple[Floats, Floats]:
        """Positions n times as dense, and a bound on each joint's turn between them [rad].

        Both follow the cubics: positions ((T - 1) n + 1, n_joints), turns with one row less.
        """
        h = np.diff(self.times_s)[:, None]
        times = self.times_s[:-1, None] + h * np.linspace(0.0, 1.0, n, endpoint=False)
        q, v, _ = self.sampled(times.ravel())
        q, v = np.vstack([q, self.positions[-1]]), np.vstack([v, self.velocities[-1]])
        part_s = np.repeat(h / n, n, axis=0)
        return q, part_s * _fastest(part_s, q[:-1], v[:-1], q[1:], v[1:])

    def sampled(self, times_s: Floats | float) -> tuple[Floats, ...]:
        """Positions, velocities and accelerations, each (S, n), at times (S,) from 0 to the end.

        Where two cubics meet, at a sample, the values are those of the later one.
        """
        return tuple(self._cubics(times_s, order) for order in range(3))

    def progress(self, times_s: Floats | float) -> tuple[Floats, Floats]:
        """Phase and phase rate [1/s], each (S,), at times (S,) from 0 to the end."""
        done, rate = self._progress(times_s), self._progress(times_s, 1)
        return np.clip(done, 0.0, 1.0), np.maximum(rate, 0.0)

    def with_phases_of(self, plan: "JointPlan", since_s: float, duration_s: float) -> "JointPlan":
        """This motion along a part of another plan, with the phases of that plan.

        Its present phases are shares of that part, from `since_s` on for `duration_s`.
        """
        done, rate = plan.progress(since_s + self.phase * duration_s)
        return replace(self, phase=done, phase_rate=rate * self.phase_rate * duration_s)

    def phase_at(self, time_s: float) -> PhaseState:
        """The phase state `time_s` after the start; at rest after the end."""
        if time_s >= self.duration_s:
            return PhaseState(float(self.phase[-1]))
        time_s = max(time_s, 0.0)
        phase, rate = map(float, self.progress(time_s))
        return PhaseState(phase, rate, float(self._progress(time_s, 2)))


def _end_accelerations(h: Any, q0: Any, v0: Any, q1: Any, v1: Any) -> tuple[Any, Any]:
    """Accelerations at both ends of a cubic, where they are largest since they are linear."""
    mean = (q1 - q0) / h
    return (6.0 * mean - 4.0 * v0 - 2.0 * v1) / h, (-6.0 * mean + 2.0 * v0 + 4.0 * v1) / h


def _fastest(h: Any, q0: Any, v0: Any, q1: Any, v1: Any) -> Any:
    """Largest speed on a cubic, at its ends or where its acceleration changes sign."""
    begin, end = _end_accelerations(h, q0, v0, q1, v1)
    turns = begin * end < 0.0
    turn_s = np.where(turns, begin * h / np.where(turns, begin - end, 1.0), 0.0)
    return np.maximum(np.maximum(np.abs(v0), np.abs(v1)), np.abs(v0 + begin * turn_s / 2.0))


def interval_use(
    times_s: Floats, positions: Floats, velocities: Floats, limits: JointLimits
) -> tuple[Floats, Floats]:
    """Shares of the velocity and acceleration limits that each interval uses, each (T - 1,).

    These are the exact extremes of the cubics through the samples, for the worst joint.
    """
    h = np.diff(times_s)[:, None]
    q0, q1, v0, v1 = positions[:-1], positions[1:], velocities[:-1], velocities[1:]
    begin, end = _end_accelerations(h, q0, v0, q1, v1)
    sharpest = np.maximum(np.abs(begin), np.abs(end))
    return (
        (_fastest(h, q0, v0, q1, v1) / limits.velocity).max(axis=1),
        (sharpest / limits.acceleration).max(axis=1),
    )


def within(times_s: Floats, positions: Floats, velocities: Floats, limits: JointLimits) -> bool:
    """Whether the cubics through the samples keep the limits, within an arm's tolerances."""
    use = np.max(interval_use(times_s, positions, velocities, limits))
    reached = np.stack(position_range(times_s, positions, velocities))
    outside = position_violation(reached, limits).max()
    return bool(outside <= POSITION_TOLERANCE_RAD and use <= 1.0 + RATE_TOLERANCE)


def position_range(times_s: Floats, positions: Floats, velocities: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest position of each joint on the cubics through the samples, each (n,)."""
    h = np.diff(times_s)[:, None]
    q0, q1, v0, v1 = positions[:-1], positions[1:], velocities[:-1], velocities[1:]
    begin, end = _end_accelerations(h, q0, v0, q1, v1)
    slope, turns = (end - begin) / h, []
    for tau in _roots(0.5 * (end - begin) * h, begin * h, v0):
        t = tau * h
        turns.append(q0 + t * (v0 + t * (begin / 2.0 + t * slope / 6.0)))
    reached = np.concatenate([positions, *turns])
    return reached.min(axis=0), reached.max(axis=0)


def _roots(a: Any, b: Any, c: Any) -> tuple[Any, Any]:
    """Roots of a t^2 + b t + c within [0, 1]; an end of the interval instead of a missing root."""
    with np.errstate(divide="ignore", invalid="ignore"):
        half = -0.5 * (b + np.copysign(np.sqrt(b * b - 4.0 * a * c), b))
        roots = half / a, c / half
    return tuple(np.clip(np.nan_to_num(root), 0.0, 1.0) for root in roots)


def keeps_limits(plan: JointPlan, start: JointReference, limits: JointLimits) -> bool:
    """Whether a plan keeps the limits; from outside the position limits it must return inside."""
    if np.any(position_violation(plan.end, limits) > POSITION_TOLERANCE_RAD):
        return False
    return within(plan.times_s, plan.positions, plan.velocities, reaching(limits, start.position))


def reaching(limits: JointLimits, position: Floats) -> JointLimits:
    """Limits whose position range is widened to hold a position (n,) [rad] that is outside."""
    if np.all(position_violation(position, limits) <= POSITION_TOLERANCE_RAD):
        return limits
    lower, upper = np.minimum(limits.lower, position), np.maximum(limits.upper, position)
    return replace(limits, lower=lower, upper=upper)


def kept_inside(
    times_s: Floats, positions: Floats, velocities: Floats, limits: JointLimits
) -> tuple[Floats, Floats]:
    """Samples, each (T, n), of which the cubics in between keep to the position range.

    Each cubic is inside the hull of its control points q0, q0 + v0 h / 3, q1 - v1 h / 3, q1: they
    are kept in the range, but for the velocity of the first sample.
    """
    q = np.clip(positions, limits.lower, limits.upper)
    above, below = 3.0 * (limits.upper - q), 3.0 * (q - limits.lower)
    h, v = np.diff(times_s)[:, None], velocities.copy()
    v[1:] = np.clip(v[1:], -above[1:] / h, below[1:] / h)
    v[1:-1] = np.clip(v[1:-1], -below[1:-1] / h[1:], above[1:-1] / h[1:])
    return q, v


def scaled_limits(
    limits: JointLimits, velocity_scale: float = 0.9, acceleration_scale: float = 1.0
) -> JointLimits:
    """Limits for plans: shares of the arm's own."""
    return replace(
        limits,
        velocity=limits.velocity * velocity_scale,
        acceleration=limits.acceleration * acceleration_scale,
    )


def plan_step(duration_s: float, limits: JointLimits) -> float:
    """Time between the samples of a plan [s].

    Longer motions get longer steps, up to the step h at which a cubic with the largest acceleration
    a strays from the line between its samples by a h^2 / 8 = `POSITION_MARGIN_RAD`.
    """
    longest_s = float(np.sqrt(8.0 * POSITION_MARGIN_RAD / limits.acceleration.max()))
    return max(STEP_S, min(duration_s / 200, longest_s))  # about 200 points in a message


def sample_times(duration_s: float, step_s: float) -> Floats:
    """Evenly spaced times from 0 to a duration, (T,) [s], at most step_s apart."""
    n = max(int(np.ceil(duration_s / step_s - 1e-9)), 1)
    return np.linspace(0.0, duration_s, n + 1)
