# SPDX-License-Identifier: Apache-2.0
"""Limits hold on the curve between the samples, and the simulated arm takes what is planned."""

import numpy as np
import pytest
from activation_world import HOME, LIMITS
from clearance_world import accept
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline

from intent_recognition.motion import (
    NominalTiming,
    make_path,
    plan_interaction,
    posture_plan,
    way_of,
)
from intent_recognition.motion.plan import (
    BEGINNING,
    JointReference,
    position_range,
    sample_times,
    scaled_limits,
    within,
)
from intent_recognition.motion.planning import _join, _path_bounds
from intent_recognition.motion.point_to_point import brake_plan
from intent_recognition.motion.retiming import N_GRID, speed_limits
from sim_bridge.arm import RejectedTrajectoryError

seeds = st.integers(0, 10_000)
few = settings(max_examples=25, deadline=None)


def curve(plan, per_interval=40):
    """Positions on the cubics through a plan's samples, (M, n)."""
    cubic = CubicHermiteSpline(plan.times_s, plan.positions, plan.velocities)
    shares = np.linspace(0.0, 1.0, per_interval)
    starts, h = plan.times_s[:-1, None], np.diff(plan.times_s)[:, None]
    return cubic((starts + shares * h).ravel())


def outside(q):
    return float(np.maximum(LIMITS.lower - q, q - LIMITS.upper).max())


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 0.5])
def test_long_plans_stay_inside_between_their_samples(late):
    """Someone rests for minutes and reaches within a second, up to the limit of a joint."""
    n_planned = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        s, duration_s = np.linspace(0.0, 1.0, 300), (20.0, 60.0, 120.0)[seed % 3]
        width = rng.uniform(0.5, 2.5, 7) / duration_s
        reach = np.exp(-0.5 * ((s[:, None] - rng.uniform(0.2, 0.8, 7)) / width) ** 2)
        path = make_path(s * duration_s, HOME + reach * rng.uniform(-2.5, 2.5, 7), LIMITS)
        nominal = NominalTiming(-late * duration_s, duration_s)
        plan = plan_interaction(path, nominal, JointReference.at_rest(HOME), LIMITS)
        if plan is not None:
            n_planned += 1
            assert outside(curve(plan)) <= 1e-9
            accept(plan)
    assert n_planned > 20


@few
@given(seeds, st.integers(3, 6))
def test_a_spline_that_overshoots_between_few_points_is_bent(seed, n):
    rng = np.random.default_rng(seed)
    q = rng.uniform(LIMITS.lower + 0.011, LIMITS.upper - 0.011, (n, 7))
    path = make_path(np.linspace(0.0, 4.0, n), q, LIMITS)
    assert outside(path.spline(np.linspace(0.0, 1.0, 5000))) < 0.0


@few
@given(seeds)
def test_the_range_of_positions_is_that_of_the_curve(seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.5, 8)) - 0.05
    q, v = rng.normal(size=(8, 3)), rng.normal(0.0, 5.0, (8, 3))
    v[3] = 0.0
    q[5], v[5:7] = q[6], 0.0
    lowest, highest = position_range(times, q, v)
    for j in range(3):
        cubic = CubicHermiteSpline(times, q[:, j], v[:, j])
        turns = cubic.derivative().roots(extrapolate=False)
        reached = cubic(np.concatenate([times, turns[np.isfinite(turns)]]))
        assert lowest[j] == pytest.approx(reached.min(), abs=1e-9)
        assert highest[j] == pytest.approx(reached.max(), abs=1e-9)


def test_joining_a_path_leaves_it_more_than_half_of_the_limits():
    path = make_path(np.linspace(0.0, 2.0, 9), HOME + np.linspace(0.0, 0.3, 9)[:, None], LIMITS)
    start = JointReference.at_rest(path.spline(0.0))
    np.testing.assert_array_equal(_join(path, start, BEGINNING, LIMITS).largest(), 0.0)
    shares = []
    for far_rad in np.geomspace(0.01, 3.0, 80):
        away = start._replace(position=start.position + far_rad * np.eye(7)[3])
        speed, acceleration = _join(path, away, BEGINNING, LIMITS).largest()
        shares.append((speed / LIMITS.velocity, acceleration / LIMITS.acceleration))
    away = start._replace(position=start.position + 3.0)
    over = _join(path, away, BEGINNING, LIMITS)._replace(duration_s=0.01)  # takes more than all
    tenth, share = scaled_limits(LIMITS, 0.1, 0.1), np.ones(N_GRID)
    left = speed_limits(path, tenth.velocity, tenth.acceleration, share, None)
    np.testing.assert_allclose(_path_bounds(path, over, LIMITS, share, None).cap, left.cap)
    most = np.max(shares, axis=(0, 2))
    assert np.all(most <= [0.35, 0.4]) and np.all(most >= [0.345, 0.39])


def test_a_curve_that_leaves_the_limits_between_its_samples_is_in_excess():
    q = np.stack([HOME, HOME])
    q[:, 1] = LIMITS.upper[1] - 0.01
    v = np.zeros((2, 7))
    v[:, 1] = 0.2, -0.2
    times = np.array([0.0, 1.0])
    _, highest = position_range(times, q, v)
    assert highest[1] == pytest.approx(q[0, 1] + 0.05)  # a parabola of height v h / 4
    assert not within(times, q, v, LIMITS)


@few
@given(seeds, st.floats(1e-4, 0.4))
def test_an_arm_pushed_past_a_limit_is_led_back_by_plans_it_accepts(seed, far_rad):
    rng = np.random.default_rng(seed)
    pushed = HOME.copy()
    joint = int(rng.integers(7))
    pushed[joint] = LIMITS.upper[joint] + far_rad
    start = JointReference.at_rest(pushed)
    s = np.linspace(0.0, 1.0, 50)
    q = HOME + np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), rng.normal(0.0, 0.2, 7))
    path = make_path(2.0 * s, q, LIMITS)
    to_interaction = plan_interaction(path, NominalTiming(0.0, 2.0), start, LIMITS)
    for plan in (posture_plan(start, HOME, LIMITS), to_interaction):
        assert plan is not None
        assert outside(plan.end) <= 0.0
        assert curve(plan)[:, joint].max() <= pushed[joint] + 1e-9
        accept(plan, position=pushed)
        accept(plan, position=np.stack([HOME, pushed]))  # asked to be there, held elsewhere
        with pytest.raises(RejectedTrajectoryError, match="rad"):
            accept(plan, position=HOME)


@pytest.mark.parametrize("rate_hz", [0.3, 0.1, 0.03])
def test_a_slow_way_to_a_limit_stays_inside_between_its_samples(rate_hz):
    """Long steps strayed by .4 mrad; from a start just outside, 1 mrad was permitted."""
    for beyond_rad, joint in [(0.0, 1), (1e-8, 3), (0.0, 5)]:
        edge = np.where(np.arange(7) == joint, LIMITS.upper, HOME)
        start = edge + beyond_rad * np.eye(7)[joint]
        for begin, end in ((HOME, edge), (start, HOME)):
            way = way_of(posture_plan(JointReference.at_rest(begin), end, LIMITS))
            rest, timing = JointReference.at_rest(begin), NominalTiming(0.0, way.duration_s)
            ceiling = np.full(N_GRID, rate_hz)
            plan = plan_interaction(way, timing, rest, LIMITS, rate_ceiling=ceiling)
            assert plan is not None and plan.duration_s > 0.9 / rate_hz
            assert outside(curve(plan)) <= max(outside(begin), 0.0) + 1e-9


@pytest.mark.parametrize("beyond_rad", [0.0, 5e-7, 1e-6, 9.0])
def test_a_home_at_the_limit_is_accepted_by_the_arm(beyond_rad):
    """The planner's tolerance was a thousand times the arm's: it made what the arm refused."""
    home = np.where(np.arange(7) == 1, LIMITS.upper + beyond_rad, HOME)
    plan = posture_plan(JointReference.at_rest(HOME), home, LIMITS)
    accept(plan)
    assert outside(plan.positions) <= 1e-9


def test_times_are_whole_nanoseconds_and_brakes_that_leave_the_limits_say_so():
    plan = posture_plan(JointReference.at_rest(HOME), HOME + 0.31, LIMITS)
    np.testing.assert_array_equal(np.round(plan.times_s * 1e9) * 1e-9, plan.times_s)
    np.testing.assert_allclose(sample_times(1.2, 0.35), 0.3 * np.arange(5))  # no more than it takes
    start = JointReference(
        np.where(np.arange(7) == 1, LIMITS.upper - 0.01, HOME), 0.5 * np.eye(7)[1], np.zeros(7)
    )
    assert brake_plan(start, 0.0, LIMITS).outside == (1,)
    away = start._replace(velocity=-start.velocity)
    assert brake_plan(away, 0.0, LIMITS).outside == ()
