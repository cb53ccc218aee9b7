# SPDX-License-Identifier: Apache-2.0
"""Motions along a predicted path: to its end in time with the human, and to a stop.

Every plan starts exactly at the reference of the plan before it (position and velocity are
continuous, acceleration is bounded) and ends at rest, and is checked against the limits on the
cubics its receiver will run. The command of an interaction is

    q(t) = p(s(t)) + e(t)

with the predicted path p run by the progress s(t) of `retiming.run` and an offset e(t), the
difference between the running reference and the path, which decays to zero (`blending.decay`).
Path and offset share the limits: the path may use what the offset leaves.
"""

from dataclasses import dataclass, replace

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion.blending import Offset, decay
from intent_recognition.motion.path import SLIVER_S, JointPath, way_of
from intent_recognition.motion.plan import (
    BEGINNING,
    JointPlan,
    JointReference,
    PhaseState,
    interval_use,
    keeps_limits,
    kept_inside,
    plan_step,
    reaching,
)
from intent_recognition.motion.point_to_point import brake_plan
from intent_recognition.motion.retiming import (
    N_GRID,
    NominalTiming,
    PathProgress,
    SpeedLimits,
    largest_rate,
    run,
    shortest_s,
    speed_limits,
)


def plan_interaction(
    path: JointPath,
    nominal: NominalTiming | None,
    start: JointReference,
    limits: JointLimits,
    progress: PhaseState = BEGINNING,
    rate_ceiling: Floats | None = None,
    stretch: float = 1.0,
) -> JointPlan | None:
    """Follow a predicted interaction from where the arm's reference is.

    Path and offset are each bounded on their own; if their sum exceeds a limit, another attempt
    lowers both bounds.

    Args:
        path: the predicted path.
        nominal: its timing, relative to the plan's start; None brakes along the path.
        start: the running reference at the plan's start.
        limits: position, velocity and acceleration limits, already scaled.
        progress: phase state of the plan before. The offset takes only the part of the start's
            motion that this progress along the path does not explain.
        rate_ceiling: largest phase rate in each interval of the path's grid (G,) [1/s].
        stretch: factor on the time in which the start's offset from the path decays.

    Returns:
        The plan, or None if none keeps the limits from this start: the plan before it ends at
        rest and is safe to go on with.
    """
    share = 1.0 if nominal is None else 0.96  # sampling the progress adds a few percent
    budget = _Budget(np.full(N_GRID, share), stretch)
    for attempt in range(8):  # nearly all that succeed do so by the fourth
        tried = _attempt(path, nominal, start, progress, limits, budget, rate_ceiling)
        if tried is None:
            return None
        plan, offset = tried
        if keeps_limits(plan, start, limits):
            return replace(plan, slowed=nominal is not None and _too_fast(path, limits))
        # first slow the path only where it exceeded a limit
        everywhere = 1.0 if attempt < 3 else 0.8
        budget = budget.tightened(plan, offset, limits, everywhere)
    return None


def stop_plan(
    path: JointPath, start: JointReference, limits: JointLimits, progress: PhaseState = BEGINNING
) -> JointPlan:
    """Slow to a stop along the path as fast as the limits allow; always returns a plan."""
    plan = plan_interaction(path, None, start, limits, progress)
    return plan if plan is not None else brake_plan(start, progress.phase, limits)


def brake_along(plan: JointPlan, time_s: float, limits: JointLimits) -> JointPlan:
    """Slow to a stop along a plan, as fast as the limits allow; always returns a plan.

    The brake begins `time_s` after the plan's start. It follows the plan itself, which is off the
    predicted path while it joins that path or brakes.
    """
    start, phase = plan.at(time_s), plan.phase_at(time_s).phase
    if time_s + SLIVER_S >= plan.duration_s:
        return brake_plan(start, phase, limits)
    # twice as long as a brake takes at the speed limits, but to a later sample at least
    way = way_of(plan, time_s, time_s + max(1.0, 2.0 * float(np.diff(plan.times_s).max())))
    rate = 1.0 / way.duration_s
    on_way = start._replace(acceleration=way.derivative(0.0, 1) * rate**2)
    brake = stop_plan(way, on_way, limits, PhaseState(rate=rate))
    if not brake.phase_rate.any():
        return replace(brake, phase=np.full_like(brake.phase, phase))
    return brake.with_phases_of(plan, time_s, way.duration_s)


@dataclass(frozen=True, eq=False)
class _Budget:
    """Share of the path's bounds in each interval (N_GRID,), factor on the offset's duration."""

    share: Floats
    stretch: float

    def tightened(
        self, plan: JointPlan, offset: Offset, limits: JointLimits, everywhere: float
    ) -> "_Budget":
        """Less for the path where the plan exceeded a limit, more time for an offset there."""
        use = np.maximum(*interval_use(plan.times_s, plan.positions, plan.velocities, limits))
        exceeded = np.flatnonzero(use > 1.0)
        factor = np.ones_like(self.share)
        for k in exceeded:  # with two intervals on each side
            first = max(int(plan.phase[k] * N_GRID) - 2, 0)
            last = min(int(plan.phase[k + 1] * N_GRID) + 3, N_GRID)
            factor[first:last] = np.minimum(factor[first:last], 0.97 / use[k])
        decaying = bool(np.any(plan.times_s[exceeded] < offset.duration_s))
        stretch = 1.25 if decaying or not exceeded.size else 1.0
        return _Budget(self.share * factor * everywhere, self.stretch * stretch)


def _attempt(
    path: JointPath,
    nominal: NominalTiming | None,
    start: JointReference,
    progress: PhaseState,
    limits: JointLimits,
    budget: _Budget,
    rate_ceiling: Floats | None,
) -> tuple[JointPlan, Offset] | None:
    """A plan within the budget, and its offset; None if the path takes too long."""
    offset = _join(path, start, progress, limits)
    bounds = _path_bounds(path, offset, limits, budget.share, rate_ceiling)
    longest_s = 0.0
    if nominal is not None:
        longest_s = max(nominal.duration_s, shortest_s(bounds, progress.phase))
    step_s = plan_step(longest_s, limits)
    rate = min(progress.rate, largest_rate(bounds, progress.phase))
    if rate < progress.rate:
        offset = _join(path, start, progress._replace(rate=rate), limits)
    offset = offset._replace(duration_s=offset.duration_s * budget.stretch)
    hold_s = _hold(offset) if progress.rate <= 0.0 else 0.0
    way = run(bounds, progress.phase, rate, nominal, step_s=step_s, hold_s=hold_s)
    if way is None:
        return None
    kind = "stop" if nominal is None else "interaction"
    inside = reaching(limits, start.position)
    return _compose(path, way, offset, step_s, kind, inside), offset


def _join(
    path: JointPath, start: JointReference, progress: PhaseState, limits: JointLimits
) -> Offset:
    """The offset of a reference from the path at the phase of its progress."""
    slope, bend = path.derivative(progress.phase), path.derivative(progress.phase, 1)
    return decay(
        start.position - path.spline(progress.phase),
        start.velocity - slope * progress.rate,
        start.acceleration - bend * progress.rate**2 - slope * progress.acceleration,
        max_velocity=0.35 * limits.velocity,  # the path keeps more than half
        max_acceleration=0.4 * limits.acceleration,
        shortest_s=0.25,  # several updates of a running plan
    )


def _path_bounds(
    path: JointPath, offset: Offset, limits: JointLimits, share: Floats, rate_ceiling: Floats | None
) -> SpeedLimits:
    """Bounds along the path with what the offset leaves of the limits."""
    speed, acceleration = offset.largest()
    least = 0.1  # whatever the offset takes, so that the path never stands still for good
    return speed_limits(
        path,
        np.maximum(limits.velocity - speed, least * limits.velocity),
        np.maximum(limits.acceleration - acceleration, least * limits.acceleration),
        share,
        rate_ceiling,
    )


def _hold(offset: Offset) -> float:
    """When the offset is small enough to move on along the path [s]."""
    times = np.linspace(0.0, offset.duration_s, 33)
    q, _ = offset.sample(times)
    far = np.flatnonzero(np.abs(q).max(axis=1) > 0.03)  # 2 cm at the hand, near enough to fetch
    return float(times[far[-1]]) if far.size else 0.0


def _compose(
    path: JointPath,
    progress: PathProgress,
    offset: Offset,
    step_s: float,
    kind: str,
    limits: JointLimits,
) -> JointPlan:
    """Sum of path and offset at the times of the progress, prolonged until the offset is zero.

    It is kept inside the position limits, which hold its start.
    """
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
    positions, velocities = kept_inside(times, q + e, velocities, limits)
    return JointPlan(times, positions, velocities, phase, rate, kind, path.clamped)


def _too_fast(path: JointPath, limits: JointLimits) -> bool:
    """Whether the path at its own speed breaks a velocity or acceleration limit."""
    phase = np.linspace(0.0, 1.0, 101)
    velocity = path.derivative(phase) / path.duration_s
    acceleration = path.derivative(phase, 1) / path.duration_s**2
    too_fast = np.abs(velocity) > limits.velocity
    return bool(np.any(too_fast | (np.abs(acceleration) > limits.acceleration)))
