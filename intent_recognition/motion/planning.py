# SPDX-License-Identifier: Apache-2.0
"""The three motions an activation sends: along a predicted interaction, to a stand, and home.

Every plan starts exactly at the reference of the plan before it (position and velocity are
continuous, acceleration is bounded) and ends at rest, and is checked against the limits on the
cubics its receiver will run. The command of an interaction is

    q(t) = p(s(t)) + e(t)

with the predicted path p run by the progress s(t) of `retiming.run` and an offset e(t), the
difference between the running reference and the path, which decays to zero (`blending.decay`).
Path and offset share the limits: what the offset needs is taken off what the path may use.
"""

from dataclasses import dataclass, replace

import numpy as np

from intent_recognition.kinematics import JointLimits
from intent_recognition.motion.blending import Offset, decay
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.plan import JointPlan, JointReference, excess, interval_use
from intent_recognition.motion.retiming import (
    N_GRID,
    NominalTiming,
    PathProgress,
    SpeedLimits,
    largest_rate,
    run,
    speed_limits,
)

# How often a plan is mended where it uses more than the limits, and what it starts with.
_N_ATTEMPTS = 8
_FIRST_SHARE = 0.96


@dataclass(frozen=True)
class PlanSettings:
    """How plans are made.

    Attributes:
        step_s: time between samples of a plan; longer motions get longer steps.
        offset_share: share of the acceleration limit an offset may use.
        offset_velocity_share: share of the velocity limit an offset may use.
        shortest_offset_s: an offset takes at least this long to decay.
        join_within_rad: the path is not run before every joint of the offset is below this.
        max_rate_ratio: at most this many times the predicted speed.
        target_samples: the step grows so that the nominal duration has at most so many samples.
    """

    step_s: float = 0.02
    offset_share: float = 0.4
    offset_velocity_share: float = 0.35
    shortest_offset_s: float = 0.25
    join_within_rad: float = 0.15
    max_rate_ratio: float = 6.0
    target_samples: int = 200


def scaled_limits(
    limits: JointLimits, velocity_scale: float = 0.9, acceleration_scale: float = 1.0
) -> JointLimits:
    """The limits plans are held to: a share of the arm's own."""
    return replace(
        limits,
        velocity=limits.velocity * velocity_scale,
        acceleration=limits.acceleration * acceleration_scale,
    )


def plan_interaction(
    path: JointPath,
    nominal: NominalTiming,
    start: JointReference,
    phase: float,
    phase_rate: float,
    limits: JointLimits,
    settings: PlanSettings = PlanSettings(),
    phase_acceleration: float = 0.0,
) -> JointPlan | None:
    """Follow a predicted interaction from where the arm's reference is.

    Args:
        path: the predicted path.
        nominal: its timing, relative to the plan's start.
        start: the running reference at the plan's start.
        phase: how much of the interaction is done, in [0, 1].
        phase_rate: its rate [1/s].
        limits: position, velocity and acceleration limits, as scaled as wanted.
        settings: see `PlanSettings`.
        phase_acceleration: the rate's derivative [1/s^2] in the plan before; what it explains
            of the start's acceleration is not left to the offset.

    Returns:
        The plan, or None if none keeps the limits from this start: the plan before it ends at
        rest and is safe to go on with.
    """
    progress = (phase, phase_rate, phase_acceleration)
    return _along(path, nominal, start, progress, limits, settings, "interaction")


def stop_plan(
    path: JointPath,
    start: JointReference,
    phase: float,
    phase_rate: float,
    limits: JointLimits,
    settings: PlanSettings = PlanSettings(),
    phase_acceleration: float = 0.0,
) -> JointPlan:
    """Slow to a stand along the path as fast as the limits allow; always gives a plan."""
    progress = (phase, phase_rate, phase_acceleration)
    plan = _along(path, None, start, progress, limits, settings, "stop")
    return plan if plan is not None else brake_plan(start, phase, limits, settings)


def brake_plan(
    start: JointReference,
    phase: float,
    limits: JointLimits,
    settings: PlanSettings = PlanSettings(),
) -> JointPlan:
    """Constant deceleration of all joints to a stand, straight on in joint space.

    A last resort: it keeps the velocity and acceleration limits, but a joint already heading for
    a position limit may end beyond it; such joints are listed in `clamped`.
    """
    share = np.abs(start.velocity) / limits.acceleration
    duration_s = max(float(share.max()), settings.step_s)
    times = _times(duration_s, settings)
    left = 1.0 - times / duration_s
    positions = start.position + np.outer(duration_s / 2.0 * (1.0 - left**2), start.velocity)
    velocities = np.outer(left, start.velocity)
    velocities[-1] = 0.0
    outside = (positions[-1] < limits.lower) | (positions[-1] > limits.upper)
    standing = np.zeros_like(times)
    joints = tuple(int(j) for j in np.flatnonzero(outside))
    return JointPlan(times, positions, velocities, standing + phase, standing, "stop", joints)


def home_plan(
    start: JointReference,
    home: np.ndarray,
    limits: JointLimits,
    settings: PlanSettings = PlanSettings(),
    *,
    speed_share: float = 0.6,
    longest_s: float = 30.0,
) -> JointPlan | None:
    """Minimum jerk from point to point, all joints together, also from a moving start.

    Args:
        start: the running reference.
        home: where to go, (n,) [rad]; held inside the position limits (reported as clamped).
        limits: position, velocity and acceleration limits.
        settings: see `PlanSettings`.
        speed_share: share of the velocity and acceleration limits to use from a stand.
        longest_s: longest motion tried.

    Returns:
        The quickest plan that keeps the limits, or None (brake first) if there is none.
    """
    target = np.clip(home, limits.lower + 1e-6, limits.upper - 1e-6)
    clamped = tuple(int(j) for j in np.flatnonzero(target != np.asarray(home, dtype=float)))
    for share in (speed_share, 1.0):
        bounds = scaled_limits(limits, share, share)
        shortest_s, offset = settings.shortest_offset_s, None
        while shortest_s < longest_s:
            offset = decay(
                start.position - target,
                start.velocity,
                start.acceleration,
                max_velocity=bounds.velocity,
                max_acceleration=bounds.acceleration,
                shortest_s=shortest_s,
                longest_s=longest_s,
                n_candidates=64,
            )
            plan = _home_samples(offset, target, settings, clamped)
            if _keeps(plan, start, limits):
                return plan
            shortest_s = max(offset.duration_s, shortest_s) * 1.2
    return None


def _home_samples(offset: Offset, target, settings, clamped) -> JointPlan:
    times = _times(offset.duration_s, settings)
    q, v = offset.sample(times)
    standing = np.zeros_like(times)
    return JointPlan(times, target + q, v, standing, standing, "home", clamped)


def _along(path, nominal, start, progress, limits, settings, kind) -> JointPlan | None:
    """A plan along the path; where the sum exceeds a limit, path and offset are slowed there."""
    phase, phase_rate, _ = progress
    share, stretch = np.full(N_GRID, _FIRST_SHARE if nominal is not None else 1.0), 1.0
    step_s = settings.step_s
    if nominal is not None:
        step_s = max(step_s, nominal.duration_s / settings.target_samples)
    for attempt in range(_N_ATTEMPTS):
        offset = _join(path, start, progress, limits, settings)
        bounds = _path_bounds(path, offset, limits, settings, share)
        rate = min(phase_rate, largest_rate(bounds, phase))
        if rate < phase_rate:
            offset = _join(path, start, (phase, rate, progress[2]), limits, settings)
        offset = offset._replace(duration_s=offset.duration_s * stretch)
        hold_s = _hold(offset, settings) if phase_rate <= 0.0 else 0.0
        done = run(bounds, phase, rate, nominal, step_s=step_s, hold_s=hold_s)
        if done is None:
            return None
        plan = _compose(path, done, offset, step_s, kind)
        if _keeps(plan, start, limits):
            return replace(plan, slowed=nominal is not None and _too_fast(path, limits))
        share, stretch = _mend(plan, offset, limits, share, stretch)
        share = share * (0.8 if attempt >= 3 else 1.0)  # mending in places was not enough
    return None


def _join(path, start, progress, limits, settings) -> Offset:
    """The offset between a reference and the path run through at this progress."""
    phase, rate, acceleration = progress
    slope, bend = path.derivative(phase), path.derivative(phase, 1)
    return decay(
        start.position - path.spline(phase),
        start.velocity - slope * rate,
        start.acceleration - bend * rate**2 - slope * acceleration,
        max_velocity=settings.offset_velocity_share * limits.velocity,
        max_acceleration=settings.offset_share * limits.acceleration,
        shortest_s=settings.shortest_offset_s,
    )


def _mend(plan: JointPlan, offset: Offset, limits, share, stretch):
    """Lower the share of the path's bounds where the plan exceeds a limit; stretch the offset."""
    use = np.maximum(*interval_use(plan.times_s, plan.positions, plan.velocities, limits))
    over = np.flatnonzero(use > 1.0)
    factor = np.ones_like(share)
    for k in over:
        first = max(int(plan.phase[k] * N_GRID) - 2, 0)
        last = min(int(plan.phase[k + 1] * N_GRID) + 3, N_GRID)
        factor[first:last] = np.minimum(factor[first:last], 0.97 / use[k])
    in_offset = bool(np.any(plan.times_s[over] < offset.duration_s)) or not over.size
    return share * factor, stretch * (1.25 if in_offset else 1.0)


def _path_bounds(path, offset: Offset, limits, settings, share) -> SpeedLimits:
    """Bounds along the path with what the offset leaves, at least a tenth of the limits."""
    speed, acceleration = offset.largest()
    return speed_limits(
        path,
        np.maximum(limits.velocity - speed, 0.1 * limits.velocity),
        np.maximum(limits.acceleration - acceleration, 0.1 * limits.acceleration),
        share=share,
        max_rate_ratio=settings.max_rate_ratio,
    )


def _hold(offset: Offset, settings) -> float:
    """When the offset is small enough to move on along the path [s]."""
    times = np.linspace(0.0, offset.duration_s, 33)
    q, _ = offset.sample(times)
    far = np.flatnonzero(np.abs(q).max(axis=1) > settings.join_within_rad)
    return float(times[far[-1]]) if far.size else 0.0


def _compose(path, progress: PathProgress, offset: Offset, step_s: float, kind: str) -> JointPlan:
    """Sum of path and offset on the progress's times, prolonged until the offset is gone."""
    end_s = float(progress.times_s[-1])
    n_more = max(int(np.ceil((offset.duration_s - end_s) / step_s)), 0)
    n_more = max(n_more, 1) if len(progress.times_s) < 2 else n_more
    times = np.concatenate([progress.times_s, end_s + step_s * np.arange(1, n_more + 1)])
    phase = np.concatenate([progress.phase, np.full(n_more, progress.phase[-1])])
    rate = np.concatenate([progress.rate, np.zeros(n_more)])
    q, slope = path.at(phase)
    e, e_velocity = offset.sample(times)
    velocities = slope * rate[:, None] + e_velocity
    velocities[-1] = 0.0
    return JointPlan(times, q + e, velocities, phase, rate, kind, path.clamped)


def _keeps(plan: JointPlan, start: JointReference, limits: JointLimits) -> bool:
    """Whether a plan keeps the limits; a start outside the positions may come back in."""
    room = np.maximum(np.maximum(limits.lower - start.position, start.position - limits.upper), 0.0)
    if room.any():
        room = room + 1e-3
        limits = replace(limits, lower=limits.lower - room, upper=limits.upper + room)
    return excess(plan.times_s, plan.positions, plan.velocities, limits).within()


def _too_fast(path: JointPath, limits: JointLimits) -> bool:
    """Whether the path at its own speed breaks a velocity or acceleration limit."""
    phase = np.linspace(0.0, 1.0, 101)
    velocity = path.derivative(phase) / path.duration_s
    acceleration = path.derivative(phase, 1) / path.duration_s**2
    too_fast = np.abs(velocity) > limits.velocity
    return bool(np.any(too_fast | (np.abs(acceleration) > limits.acceleration)))


def _times(duration_s: float, settings) -> np.ndarray:
    step_s = max(settings.step_s, duration_s / settings.target_samples)
    n = max(int(np.ceil(duration_s / step_s - 1e-9)), 1)
    return np.linspace(0.0, duration_s, n + 1)
