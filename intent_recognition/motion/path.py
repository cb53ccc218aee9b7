# SPDX-License-Identifier: Apache-2.0
"""A predicted joint path over the phase of its interaction, smooth and inside the limits."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics import JointLimits, position_violation
from intent_recognition.motion.plan import POSITION_MARGIN_RAD, JointPlan


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint positions over phase [0, 1] as a twice differentiable spline."""

    spline: CubicSpline  # phase -> (n,) [rad]
    derivative: CubicSpline  # its first derivative
    duration_s: float  # time for the whole path at its own (nominal) speed
    clamped: tuple[int, ...]  # joints that left their position limits and were bent back inside

    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Positions and derivatives with respect to phase, each (..., n)."""
        return self.spline(phase), self.derivative(phase)

    def shifted(self, phases: Floats, away: Floats, limits: JointLimits) -> "JointPath":
        """The path moved smoothly by `away` (T, n) [rad] at phases (T,) from 0 to 1.

        It is bent inside the position limits like any predicted path.
        """
        change = CubicSpline(phases, away)
        dense = np.linspace(0.0, 1.0, 201)
        moved = make_path(
            dense * self.duration_s,
            self.spline(dense) + change(dense),
            limits,
            (self.derivative(dense) + change(dense, 1)) / self.duration_s,
        )
        return replace(moved, clamped=tuple(sorted({*self.clamped, *moved.clamped})))


def make_path(
    times_s: Floats, positions: Floats, limits: JointLimits, velocities: Floats | None = None
) -> JointPath:
    """Turn the samples (T, n) [rad] of a predicted trajectory into a path over phase.

    Phase is 0 at the first of the times (T,) and 1 at the last. Velocities (T, n) [rad/s] in the
    first and last row are the spline's end slopes; without them the path has no curvature at its
    ends. Where a joint leaves its position limits less a margin of 10 mrad, it is bent back inside
    by a saturation without kinks (identity, then tanh), so that the path stays traversable. An
    overshoot of the spline between samples is bent in the same way.

    Raises:
        TrajectoryError: fewer than two samples, wrong sizes, times that do not increase, or a
            value that is not finite.
    """
    times_s, positions = np.asarray(times_s, float), np.asarray(positions, float)
    _check(times_s, positions, velocities, limits.lower.size)
    duration_s = float(times_s[-1] - times_s[0])
    phase = (times_s - times_s[0]) / duration_s
    phase[-1] = 1.0
    slopes = None if velocities is None else np.array(velocities, float)[[0, -1]] * duration_s
    spline = _spline(phase, positions, slopes)
    dense = np.linspace(0.0, 1.0, max(401, 2 * phase.size - 1))
    bent, clamped = _bend_inside(spline(dense), limits)
    if clamped:
        if slopes is not None:
            slopes[:, list(clamped)] = 0.0
        spline = _spline(dense, bent, slopes)
    return JointPath(spline, spline.derivative(), duration_s, clamped)


SLIVER_S = 0.002
"""Least time between two knots of a way [s]. Numerical safeguard: the spline divides by it."""


def way_of(plan: JointPlan, since_s: float = 0.0, until_s: float = np.inf) -> JointPath:
    """The path of a plan from a time to its last sample before `until_s`, evenly in time."""
    ahead = (plan.times_s > since_s + SLIVER_S) & (plan.times_s < until_s)
    start, times_s = plan.at(since_s), np.append(since_s, plan.times_s[ahead])
    duration_s = float(times_s[-1] - since_s)
    positions = np.vstack([start.position, plan.positions[ahead]])
    slopes = np.stack([start.velocity, plan.velocities[ahead][-1]]) * duration_s
    spline = _spline((times_s - since_s) / duration_s, positions, slopes)
    return JointPath(spline, spline.derivative(), duration_s, plan.clamped)


def check_range(positions: Floats, limits: JointLimits) -> None:
    """Check that a prediction (T, n) can belong to an arm with these limits [rad, m].

    Raises:
        TrajectoryError: a joint is never inside its limits, or leaves them by more than its range.
    """
    outside = position_violation(positions, limits)
    far = np.any(outside > limits.upper - limits.lower, axis=0) | np.all(outside > 0.0, axis=0)
    if not far.any():
        return
    joint = int(np.flatnonzero(far)[0])
    lower, upper, unit = limits.lower[joint], limits.upper[joint], limits.unit(joint)
    expected = f"joint {joint + 1} in [{lower:.3g}, {upper:.3g}] {unit}"
    low, high = positions[:, joint].min(), positions[:, joint].max()
    cure = f"Train with this arm's recordings, in {unit} (`intent inspect` names others)."
    raise TrajectoryError.about("positions", expected, f"{low:.3g} to {high:.3g} {unit}", cure)


def _spline(phase: Floats, positions: Floats, slopes: Floats | None) -> CubicSpline:
    ends: Any = "natural" if slopes is None else ((1, slopes[0]), (1, slopes[1]))
    return CubicSpline(phase, positions, bc_type=ends)


def _bend_inside(positions: Floats, limits: JointLimits) -> tuple[Floats, tuple[int, ...]]:
    """Saturate the joints that leave their limits, and return their indices."""
    lower, upper = limits.lower + POSITION_MARGIN_RAD, limits.upper - POSITION_MARGIN_RAD
    outside = np.any((positions < lower) | (positions > upper), axis=0)
    if not outside.any():
        return positions, ()
    band = np.minimum(0.06, (upper - lower) / 4.0)
    over, under = positions - (upper - band), (lower + band) - positions
    bent = np.where(over > 0.0, upper - band + band * np.tanh(over / band), positions)
    bent = np.where(under > 0.0, lower + band - band * np.tanh(under / band), bent)
    joints = tuple(int(j) for j in np.flatnonzero(outside))
    return np.where(outside, bent, positions), joints


def _check(times_s: Floats, positions: Floats, velocities: Floats | None, n_joints: int) -> None:
    shape = (times_s.size, n_joints)
    if times_s.ndim != 1 or times_s.size < 2 or positions.shape != shape:
        _refuse("positions", f"at least two rows of {n_joints} joints", positions.shape)
    if velocities is not None and np.shape(velocities) != shape:
        _refuse("velocities", f"shape {shape}", np.shape(velocities))
    if not (np.all(np.isfinite(times_s)) and np.all(np.isfinite(positions))):
        _refuse("trajectory", "finite times and positions", "NaN or infinity")
    if velocities is not None and not np.all(np.isfinite(velocities)):
        _refuse("velocities", "finite values", "NaN or infinity")
    if np.min(np.diff(times_s)) <= 0.0:
        _refuse("times_s", "strictly increasing times", "a step backwards or a repeated time")


def _refuse(argument: str, expected: str, got: object) -> None:
    cure = "Send the whole trajectory again, one row per time."
    raise TrajectoryError.about(argument, expected, got, cure)
