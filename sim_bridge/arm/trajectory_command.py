# SPDX-License-Identifier: Apache-2.0
"""A joint trajectory that was sent, checked as a whole before it is executed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError, describe
from intent_recognition.kinematics import (
    JOINT_NAMES,
    LWR_LIMITS,
    POSITION_TOLERANCE_RAD,
    RATE_TOLERANCE,
    JointLimits,
    position_violation,
)

REASONS = (
    "wrong_joint_names",
    "empty",
    "wrong_size",
    "not_finite",
    "time_not_increasing",
    "outside_position_limits",
    "outside_velocity_limits",
    "outside_acceleration_limits",
    "velocity_at_end",
    "ends_in_past",
    "starts_too_late",
    "cannot_join",
)


CommandRows = Sequence[Sequence[float]] | Floats
"""One row of values per point of a trajectory, (n, n_joints)."""


class RejectedTrajectoryError(TrajectoryError):
    """A trajectory was rejected as a whole; `reason` is one of `REASONS`."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True, eq=False)
class TrajectoryCommand:
    """A valid trajectory in the arm's joint order."""

    times_s: Floats  # time of each point after the start (n,), increasing
    positions: Floats  # (n, n_joints) [rad]
    velocities: Floats  # (n, n_joints) [rad/s], estimated from the positions if none were sent
    accelerations: Floats | None  # (n, n_joints) [rad/s^2], or None if none were sent
    start_s: float | None  # when it starts; None = on acceptance

    @classmethod
    def validated(
        cls,
        names: Sequence[str],
        times_s: Sequence[float] | Floats,
        positions: CommandRows,
        velocities: CommandRows | None = None,
        accelerations: CommandRows | None = None,
        *,
        start_s: float | None = None,
        now_s: float = 0.0,
        joint_names: Sequence[str] = JOINT_NAMES,
        limits: JointLimits = LWR_LIMITS,
        position: Floats | None = None,
    ) -> "TrajectoryCommand":
        """Check a trajectory and sort its columns into the arm's joint order.

        Each point has a row [rad], [rad/s], [rad/s^2]; if all rows are empty, none were sent. Times
        are relative to `start_s` (None for now), not negative and increasing. All values and the
        mean speeds between points must be inside the limits. Only a joint that was pushed outside,
        as shown by `position` (rows of the arm's measured and reference position), may be about as
        far outside before the last point.

        Raises:
            RejectedTrajectoryError: anything is wrong; `reason` names the kind of error.
        """
        if sorted(names) != sorted(joint_names):
            expected = f"each of {list(joint_names)} once"
            _reject("wrong_joint_names", "joint_names", expected, list(names))
        order = [list(names).index(name) for name in joint_names]
        times = _checked_times(times_s)
        shape = (len(times), len(order))
        q = _rows("positions", positions, shape)[:, order]
        sent = (("velocities", velocities), ("accelerations", accelerations))
        qd, qdd = (
            _rows(field, rows, shape)[:, order]
            if rows is not None and any(map(len, rows))
            else None
            for field, rows in sent
        )
        _check_limits(times, q, qd, qdd, limits, joint_names, position)
        qd = _smooth_velocities(times, q) if qd is None else qd
        if np.any(np.abs(qd[-1]) > 1e-6):
            _reject("velocity_at_end", "velocities", "zero in the last point", qd[-1].tolist())
        if start_s is not None:
            _check_start(start_s, times[-1], now_s)
        return cls(times, q, qd, qdd, start_s)


def _reject(reason: str, argument: str, expected: str, got: object) -> None:
    cure = "The arm keeps what it was doing; correct the trajectory and send it again."
    raise RejectedTrajectoryError(reason, describe(argument, expected, got, cure))


def _checked_times(times_s: Sequence[float] | Floats) -> Floats:
    times = np.array(times_s, dtype=np.float64)
    if times.ndim != 1 or times.size == 0:
        _reject("empty", "points", "at least one point", f"{times.size} points")
    if not np.all(np.isfinite(times)):
        _reject("not_finite", "time_from_start", "finite times", times.tolist())
    if times[0] < 0.0 or np.any(np.diff(times) <= 0.0):
        k = 0 if times[0] < 0.0 else int(np.argmax(np.diff(times) <= 0.0)) + 1
        place, expected = f"points[{k}].time_from_start", "times from zero on that increase"
        _reject("time_not_increasing", place, expected, f"{times[k]:g} s")
    return times


def _rows(field: str, rows: CommandRows, shape: tuple[int, int]) -> Floats:
    if len(rows) != shape[0]:
        _reject("wrong_size", field, f"{shape[0]} rows", f"{len(rows)} rows")
    for k, row in enumerate(rows):
        if len(row) != shape[1]:
            _reject("wrong_size", f"points[{k}].{field}", f"{shape[1]} values", len(row))
    array = np.array(rows, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        k = int(np.argmin(np.all(np.isfinite(array), axis=1)))
        _reject("not_finite", f"points[{k}].{field}", "finite values", array[k].tolist())
    return array


def _smooth_velocities(times: Floats, q: Floats) -> Floats:
    """Return velocities (n, n_joints) that are zero at both ends and never overshoot a point.

    Between two segments of the same direction, the velocity is the harmonic mean of their slopes,
    otherwise zero (Fritsch and Butland 1984).
    """
    velocities = np.zeros_like(q)
    if len(times) > 2:
        slopes = np.diff(q, axis=0) / np.diff(times)[:, None]
        before, after = slopes[:-1], slopes[1:]
        same = before * after > 0.0
        total = np.where(same, before + after, 1.0)
        velocities[1:-1] = np.where(same, 2.0 * before * after / total, 0.0)
    return velocities


def _check_limits(
    times: Floats,
    q: Floats,
    qd: Floats | None,
    qdd: Floats | None,
    limits: JointLimits,
    names: Sequence[str],
    position: Floats | None,
) -> None:
    """Reject a trajectory outside the limits, or too fast on average, naming point and joint."""
    outside = position_violation(q, limits)
    if position is not None:
        pushed = position_violation(np.atleast_2d(position), limits).max(axis=0)
        if len(q) > 1:  # a brake may end out there
            outside[-1] -= np.minimum(pushed, outside[0])
        # an arm at rest moves as far in 0.2 s
        outside[:-1] -= np.where(pushed > 0.0, pushed + 0.01, 0.0)
    means = np.zeros_like(q)
    means[1:] = np.diff(q, axis=0) / np.diff(times)[:, None]
    bounds = f"[{limits.lower.round(4).tolist()}, {limits.upper.round(4).tolist()}] rad"
    speeds = f"speeds up to {limits.velocity.round(4).tolist()} rad/s"
    found = [("position", q, outside, bounds)]
    for kind, values, limit, expected in (
        ("velocity", qd, limits.velocity, speeds),
        ("velocity", means, limits.velocity, speeds),
        ("acceleration", qdd, limits.acceleration, "accelerations up to {} rad/s^2"),
    ):
        if values is not None:
            excess = np.abs(values) - limit * (1.0 + RATE_TOLERANCE)
            found.append((kind, values, excess, expected.format(limit.tolist())))
    for kind, values, excess, expected in found:
        if np.any(excess > POSITION_TOLERANCE_RAD):
            k, joint = divmod(int(np.argmax(excess)), excess.shape[1])
            at, got = f"points[{k}] {names[joint]}", f"{values[k, joint]:.4f}"
            _reject(f"outside_{kind}_limits", at, expected, got)


def _check_start(start_s: float, duration_s: float, now_s: float) -> None:
    if not np.isfinite(start_s):
        _reject("not_finite", "header.stamp", "a finite start", start_s)
    if start_s + duration_s < now_s:
        expected = "a trajectory that ends in the future"
        got = f"one that ended {now_s - start_s - duration_s:.3f} s ago"
        _reject("ends_in_past", "header.stamp", expected, got)
    if start_s - now_s > 60.0:
        expected = "a start within 60 s (is the sender on the same clock?)"
        _reject(
            "starts_too_late", "header.stamp", expected, f"one {start_s - now_s:.3f} s from now"
        )
