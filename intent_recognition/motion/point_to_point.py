# SPDX-License-Identifier: Apache-2.0
"""Time-optimal motions with limited jerk: to a posture at rest, and to a stop.

Ruckig computes them (Berscheid and Kroeger 2021, "Jerk-limited real-time trajectory generation with
arbitrary target states"). Both start at the running reference, at rest or in motion.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError, optional
from intent_recognition.kinematics import POSITION_TOLERANCE_RAD, JointLimits, position_violation
from intent_recognition.motion.plan import (
    STEP_S,
    JointPlan,
    JointReference,
    keeps_limits,
    plan_step,
    position_range,
    sample_times,
    scaled_limits,
)

if TYPE_CHECKING:
    from ruckig import InputParameter

RISE_TIME_S = 0.1
"""Shortest time in which an acceleration rises from zero to its limit [s]. The jerk limit is the
acceleration limit divided by this time: 80 rad/s^3 at 8 rad/s^2. Measurement: docs/decisions,
"Ruckig goes home and brakes"."""


def posture_plan(start: JointReference, posture: Floats, limits: JointLimits) -> JointPlan | None:
    """Go to a posture (n,) [rad], all joints together; from rest straight in joint space.

    A posture outside the position limits is clamped to them (`JointPlan.clamped`). The motion uses
    0.6 of the other limits unless a moving start needs more. None if no plan keeps the limits:
    brake first.

    Raises:
        TrajectoryError: start or posture contain NaN or infinity.
    """
    target = np.clip(posture, limits.lower + 1e-6, limits.upper - 1e-6)
    clamped = tuple(int(j) for j in np.flatnonzero(target != np.asarray(posture, dtype=np.float64)))
    for share in (0.6, 1.0):
        motion = _input(start, limits, scaled_limits(limits, share, share))
        motion.target_position = target
        if not (start.velocity.any() or start.acceleration.any()):
            _make_straight(motion, target - start.position)
        plan = _sampled(motion, limits, "home", 0.0)
        if keeps_limits(plan, start, limits):
            return replace(plan, clamped=clamped)
    return None


def brake_plan(start: JointReference, phase: float, limits: JointLimits) -> JointPlan:
    """Brake all joints to a stop, together, or each on its own if one would leave its limits.

    The brake keeps the velocity and acceleration limits, but a joint that is heading for a position
    limit may pass it; `outside` lists such joints. Joints that are speeding up cease to do so at
    once.

    Raises:
        TrajectoryError: the start contains NaN or infinity.
    """
    speeds_up = start.acceleration * start.velocity > 0.0
    start = start._replace(acceleration=np.where(speeds_up, 0.0, start.acceleration))
    motion = _input(start, limits, limits)
    ruckig = optional("ruckig")
    motion.control_interface = ruckig.ControlInterface.Velocity
    for synchronization in (ruckig.Synchronization.Phase, ruckig.Synchronization.No):
        motion.synchronization = synchronization
        plan = _sampled(motion, limits, "stop", phase)
        reached = np.stack(position_range(plan.times_s, plan.positions, plan.velocities))
        allowed = position_violation(start.position, limits) + POSITION_TOLERANCE_RAD
        outside = np.flatnonzero(position_violation(reached, limits).max(axis=0) > allowed)
        if not outside.size:
            break
    return replace(plan, outside=tuple(int(j) for j in outside))


def _input(start: JointReference, limits: JointLimits, bounds: JointLimits) -> "InputParameter":
    """Ruckig's input for a motion within bounds from the start to rest.

    The limits are lowered by what interpolation between samples adds to accelerations. A start
    acceleration that limited jerk cannot end in time is reduced: the motion then jumps in
    acceleration, never in position or velocity.
    """
    jerk = limits.acceleration / RISE_TIME_S
    # the integral of |3 u^2 - 2 u| over [0, 1], the Peano kernel of a Hermite cubic's acceleration
    largest = limits.acceleration - 8.0 / 27.0 * jerk * STEP_S
    room_up = np.sqrt(2.0 * jerk * np.maximum(limits.velocity - start.velocity, 0.0))
    room_down = np.sqrt(2.0 * jerk * np.maximum(limits.velocity + start.velocity, 0.0))
    ruckig = optional("ruckig")
    motion = ruckig.InputParameter(start.position.size)
    motion.current_position = start.position
    motion.current_velocity = start.velocity
    motion.current_acceleration = np.clip(
        start.acceleration, -np.minimum(largest, room_down), np.minimum(largest, room_up)
    )
    motion.max_velocity = bounds.velocity
    motion.max_acceleration = np.minimum(bounds.acceleration, largest)
    motion.max_jerk = jerk
    motion.synchronization = ruckig.Synchronization.Phase
    return motion


def _make_straight(motion: "InputParameter", way: Floats) -> None:
    """Make the limits proportional to the way, so that phase synchronisation keeps to a line."""
    distance = np.abs(way)
    moves = distance > 1e-6  # the other joints need not keep to the line
    if not moves.any():
        return
    for name in ("max_velocity", "max_acceleration", "max_jerk"):
        limit = np.array(getattr(motion, name))
        rate = (limit[moves] / distance[moves]).min()
        setattr(motion, name, np.where(moves, rate * distance, limit))


def _sampled(motion: "InputParameter", limits: JointLimits, kind: str, phase: float) -> JointPlan:
    ruckig, n = optional("ruckig"), motion.degrees_of_freedom
    trajectory = ruckig.Trajectory(n)
    cure = "Check the reference and the target for values that are not finite."
    try:
        result = ruckig.Ruckig(n).calculate(motion, trajectory)
    except ruckig.RuckigError as error:
        raise TrajectoryError.about("start", "finite values", str(error).strip(), cure) from error
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise TrajectoryError.about("start", "a state to move from", result.name, cure)
    duration_s = max(trajectory.duration, STEP_S)
    times = sample_times(duration_s, plan_step(duration_s, limits))
    rows = [trajectory.at_time(time) for time in times]
    positions, velocities = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    if motion.control_interface == ruckig.ControlInterface.Position:
        positions[-1] = motion.target_position
    velocities[-1] = 0.0
    standing = np.zeros_like(times)
    return JointPlan(times, positions, velocities, standing + phase, standing, kind)
