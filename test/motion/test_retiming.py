# SPDX-License-Identifier: Apache-2.0
"""Plans stay within the limits, are continuous over updates, catch up, and end at rest."""

import numpy as np
import pytest
from activation_world import HOME, LIMITS
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from simulation import minimum_jerk

from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics.lwr import LWR_LIMITS
from intent_recognition.motion import BEGINNING, JointPlan, NominalTiming, check_range, make_path
from intent_recognition.motion.blending import Offset, decay
from intent_recognition.motion.plan import (
    JointReference,
    interval_use,
    scaled_limits,
    within,
)
from intent_recognition.motion.planning import _Budget, brake_along, plan_interaction
from intent_recognition.motion.retiming import (
    N_GRID,
    SpeedLimits,
    _under_cap,
    largest_rate,
    run,
    speed_limits,
)


def samples(seed, duration_s, size=0.4, n_via=1, n=50):
    """A smooth path from HOME over n_via points, each part minimum jerk, overlapping."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, n)
    q = np.tile(HOME, (n, 1))
    starts = np.linspace(0.0, 1.0, n_via + 2)[:-1]
    for start in starts:
        width = (1.0 - start) if start == starts[-1] else 1.4 / (n_via + 1)
        q = q + np.outer(minimum_jerk((s - start) / width), rng.normal(0.0, size, 7))
    times = s * duration_s
    v = np.gradient(q, times, axis=0)
    v[[0, -1]] = 0.0
    return times, q, v


def path_of(times, q, v, limits=LIMITS):
    return make_path(times, q, limits, v)


def planned(sampled, onset_s=0.0, start=HOME):
    """Along a sampled prediction, from rest."""
    timing, rest = NominalTiming(onset_s, sampled[0][-1]), JointReference.at_rest(start)
    return plan_interaction(path_of(*sampled), timing, rest, LIMITS)


def check_by_differences(plan: JointPlan, limits=LIMITS):
    """Limits and continuity by differences of finely sampled positions: an independent check."""
    cubic = CubicHermiteSpline(plan.times_s, plan.positions, plan.velocities)
    for x in np.linspace(0.0, plan.duration_s, 7):
        np.testing.assert_allclose(plan.at(x).position, cubic(x), atol=1e-9)
        np.testing.assert_allclose(plan.at(x).velocity, cubic(x, 1), atol=1e-9)
    t = np.arange(0.0, plan.duration_s + 0.1, 1e-3)
    q = cubic(np.minimum(t, plan.duration_s))
    v = np.diff(q, axis=0) / 1e-3
    a = np.diff(v, axis=0) / 1e-3
    assert np.all(q >= limits.lower - 1e-6) and np.all(q <= limits.upper + 1e-6)
    assert np.all(np.abs(v) <= limits.velocity * (1.0 + 1e-6))
    assert np.all(np.abs(a) <= limits.acceleration * (1.0 + 1e-6) + 1e-6)


phases = st.floats(0.05, 0.9)
durations = st.floats(0.8, 6.0)
seeds = st.integers(0, 10_000)
few = settings(max_examples=25, deadline=None)


@few
@given(seeds, durations, phases, st.integers(0, 2), st.floats(0.0, 0.3))
def test_a_late_start_keeps_the_limits_and_ends_at_the_end(seed, duration_s, late, n_via, away):
    times, q, v = samples(seed, duration_s, n_via=n_via)
    path = path_of(times, q, v)
    rng = np.random.default_rng(seed)
    start = JointReference.at_rest(HOME + rng.uniform(-away, away, 7))
    plan = plan_interaction(path, NominalTiming(-late * duration_s, duration_s), start, LIMITS)
    assert plan is not None
    assert plan.kind == "interaction"
    assert plan.times_s[0] == 0.0 and np.all(np.diff(plan.times_s) > 0.0)
    np.testing.assert_allclose(plan.positions[0], start.position, atol=1e-12)
    np.testing.assert_allclose(plan.velocities[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(plan.end, path.spline(1.0), atol=1e-9)
    assert np.all(plan.velocities[-1] == 0.0)
    assert np.all(np.diff(plan.phase) >= 0.0) and plan.phase[-1] == 1.0
    assert within(plan.times_s, plan.positions, plan.velocities, LIMITS)
    check_by_differences(plan)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_long_step_that_speeds_up_ends_within_the_acceleration_that_is_allowed(seed):
    """But for what the grid along the path adds."""
    path, step_s = path_of(*samples(seed, 2.0, n_via=2)), 0.05
    bounds = speed_limits(path, LIMITS.velocity, LIMITS.acceleration, np.ones(N_GRID), None)
    _, s, v = run(bounds, 0.0, 0.0, NominalTiming(-3.0, 2.0), step_s=step_s)
    rise, s, v = np.diff(v)[:, None] / step_s, s[1:], v[1:, None]
    ends = path.derivative(s) * rise + path.derivative(s, 1) * v**2
    assert np.abs(ends / LIMITS.acceleration)[rise[:, 0] > 0.0].max() < 1.1


def test_progress_does_not_brake_harder_than_its_own_bound_where_a_joint_turns():
    """There the path's slope is near zero, and the speed alone decides the acceleration."""
    for seed in range(12):
        path = path_of(*samples(seed, 3.0, n_via=2))
        bounds = speed_limits(path, LIMITS.velocity, LIMITS.acceleration, np.ones(N_GRID), None)
        rates = run(bounds, 0.0, 0.0, NominalTiming(-2.0, 3.0), step_s=0.02).rate
        assert np.abs(np.diff(rates[:-1]) / 0.02).max() <= 15.0 / 3.0 + 1e-9


@pytest.mark.parametrize("factor", [180.0 / np.pi, 1.0])
def test_a_prediction_of_another_range_is_refused(factor):
    """In degrees; or of an arm one joint of which begins and stays elsewhere."""
    q = samples(8, 3.0)[1]
    q = q * factor + (np.array([0, 0, 0, 3.0, 0, 0, 0]) if factor == 1.0 else 0.0)
    with pytest.raises(TrajectoryError, match=r"rad, got .* rad\. Train with this arm's"):
        check_range(q, LIMITS)
    for end in (HOME, LIMITS.upper + 0.1):
        check_range(np.stack([HOME, end]), LIMITS)


@pytest.mark.slow
@few
@given(seeds, durations, phases, st.lists(st.integers(1, 12), min_size=1, max_size=12))
def test_updates_of_path_and_timing_never_jump(seed, duration_s, late, gaps):
    rng = np.random.default_rng(seed)
    times, q, _ = samples(seed, duration_s)
    onset = -late * duration_s
    now, start, progress = 0.0, JointReference.at_rest(HOME + 0.02), BEGINNING
    n_refused = 0
    plan, since = None, 0.0
    for gap in [0, *gaps]:
        dt = 0.04 * gap
        now += dt
        since += dt
        if plan is not None:
            start, progress = plan.at(since), plan.phase_at(since)
        q = q + np.outer(np.linspace(0.0, 1.0, len(q)), rng.normal(0.0, 0.015, 7))
        scale = 1.0 + rng.normal(0.0, 0.03)
        path = path_of(times * scale, q, np.gradient(q, times * scale, axis=0))
        nominal = NominalTiming(onset - now, duration_s * scale)
        new = plan_interaction(path, nominal, start, LIMITS, progress)
        if new is None:  # the plan in force goes on; no plan follows a path outside the limits
            n_refused += bool(np.all((q > LIMITS.lower) & (q < LIMITS.upper)))
            continue
        np.testing.assert_allclose(new.positions[0], start.position, atol=1e-12)
        np.testing.assert_allclose(new.velocities[0], start.velocity, atol=1e-9)
        assert new.phase[0] == pytest.approx(progress.phase)
        assert within(new.times_s, new.positions, new.velocities, LIMITS)
        plan, since = new, 0.0
    assert n_refused <= 1 + len(gaps) // 4
    assume(plan is not None)
    check_by_differences(plan)
    assert np.all(plan.velocities[-1] == 0.0)
    np.testing.assert_allclose(plan.positions[-1], plan.end)


def test_the_timing_is_the_nominal_one_also_after_a_late_start_or_before_the_onset():
    plan = planned(samples(3, 4.0), -1.6)
    nominal = (plan.times_s + 1.6) / 4.0
    lag = nominal - plan.phase
    together = np.flatnonzero(np.abs(lag) < 0.01)
    assert together.size and nominal[together[0]] < 0.75
    assert np.all(np.abs(lag[together[0] : -10]) < 0.012)
    assert plan.times_s[plan.phase >= 1.0 - 1e-9][0] < 2.4 + 0.1
    assert not plan.slowed
    plan = planned(samples(4, 3.0))
    assert plan.phase[-2] < 1.0 == plan.phase_at(9.0).phase  # and no sample after the end
    assert np.all(plan.phase <= plan.times_s / 3.0 + 0.01)
    assert plan.times_s[plan.phase >= 1.0 - 1e-9][0] == pytest.approx(3.0, abs=0.1)
    plan = planned(samples(4, 3.0), 0.5)
    assert np.all(plan.phase[plan.times_s < 0.45] == 0.0)
    assert plan.phase[-1] == 1.0


def test_follows_the_path_from_its_start_and_does_not_cut_it():
    sampled = samples(5, 2.0, n_via=1)
    plan = planned(sampled, -1.2)
    fine = path_of(*sampled).spline(np.linspace(0.0, 1.0, 2000))
    for t in np.linspace(0.0, plan.duration_s, 200):
        assert np.min(np.abs(fine - plan.at(t).position).max(axis=1)) < 2e-3
    plan = planned(samples(6, 2.0), -1.0, HOME - 0.8)
    far = np.abs(plan.positions - HOME).max(axis=1) > 0.05
    assert np.all(plan.phase[: np.flatnonzero(~far)[0]] == 0.0)
    check_by_differences(plan)


def test_what_is_too_fast_or_outside_is_slowed_or_clamped_and_said_to_be():
    plan = planned(samples(7, 0.5, size=1.0))
    assert plan.slowed and plan.duration_s > 0.6
    check_by_differences(plan)
    times, q, _ = samples(8, 3.0)
    q = q + np.outer(minimum_jerk(times / 3.0), [0, 0, 0, 1.5, 0, 0, -4.0])
    plan = planned((times, q, np.gradient(q, times, axis=0)), -1.0)
    assert set(plan.clamped) == {3, 6}
    np.testing.assert_allclose(plan.end[[3, 6]], [LIMITS.upper[3], LIMITS.lower[6]], atol=0.02)
    check_by_differences(plan)
    others = [0, 1, 2, 4, 5]
    np.testing.assert_allclose(plan.end[others], q[-1, others], atol=1e-9)


@pytest.mark.parametrize("acceleration", [1.0, 0.01])
@pytest.mark.parametrize("duration_s", [1.0, 6.0])
def test_a_slow_arm_may_take_minutes(acceleration, duration_s):
    slow = scaled_limits(LWR_LIMITS, 0.01, acceleration)
    times, q, v = samples(1, duration_s)
    path, start = path_of(times, q, v, slow), JointReference.at_rest(HOME)
    plan = plan_interaction(path, NominalTiming(0.0, duration_s), start, slow)
    assert plan is not None and 30.0 < plan.duration_s < 120.0
    fastest = np.abs(plan.velocities / slow.velocity).max(axis=1)
    assert np.median(fastest) > 0.8  # no slower than it must be
    check_by_differences(plan, slow)


def test_a_brake_between_samples_that_are_seconds_apart_keeps_to_the_way():
    slow = scaled_limits(LIMITS, 1.0, 0.03 / LIMITS.acceleration.max())
    path, start = path_of(*samples(1, 900.0), slow), JointReference.at_rest(HOME)
    plan = plan_interaction(path, NominalTiming(0.0, 900.0), start, slow)
    assert plan.times_s[1] > 1.5
    brake = brake_along(plan, 0.2 * plan.duration_s, slow)
    assert brake.phase_rate.any() and 0.2 < brake.phase[-1] < 0.21
    check_by_differences(brake, slow)


@few
@given(seeds, durations, phases, st.floats(0.0, 1.0))
@example(508, 2.3386, 0.25, 0.588)  # where the acceleration of the plan jumps
@example(1530, 2.6886, 0.2127, 0.6972)  # near a position limit
def test_a_brake_keeps_to_the_way_of_a_plan_that_is_joining_a_path(seed, duration_s, late, share):
    running = planned(samples(seed, duration_s), -late * duration_s, HOME + 0.3)
    t = share * running.duration_s
    brake = brake_along(running, t, LIMITS)
    assert brake.kind == "stop" and not brake.outside and np.all(brake.velocities[-1] == 0.0)
    np.testing.assert_allclose(brake.positions[0], running.at(t).position, atol=1e-12)
    np.testing.assert_allclose(brake.velocities[0], running.at(t).velocity, atol=1e-9)
    check_by_differences(brake)
    way_s = np.linspace(t, running.duration_s, 3000)
    way, rates, _ = running.sampled(way_s)
    for position, phase in zip(brake.positions, brake.phase, strict=True):
        away = np.abs(way - position).max(axis=1)
        assert away.min() < 2e-3
        at = running.phase_at(way_s[np.argmin(away)]).phase
        assert abs(phase - at) < 0.02
    done = np.gradient(brake.phase, brake.times_s)
    np.testing.assert_allclose(brake.phase_rate[2:-2], done[2:-2], atol=0.1)
    fastest = np.abs(rates[way_s <= t + brake.duration_s]).max(axis=0)
    assert np.all(np.abs(brake.velocities) <= 1.02 * fastest + 0.02)


@few
@given(seeds, st.floats(0.0, 0.5), st.floats(0.0, 0.9))
def test_an_offset_decays_within_its_bounds(seed, size, speed):
    rng = np.random.default_rng(seed)
    position, velocity = rng.uniform(-size, size, 7), rng.uniform(-speed, speed, 7)
    acceleration = rng.uniform(-2.0, 2.0, 7)
    bound_v, bound_a = np.full(7, 0.6), np.full(7, 3.0)
    offset = decay(
        position,
        velocity,
        acceleration,
        max_velocity=bound_v,
        max_acceleration=bound_a,
        shortest_s=0.2,
    )
    assert offset.duration_s < 8.0  # not the longest, which is tried whether it fits or not
    t = np.linspace(0.0, offset.duration_s, 2001)
    q, v = offset.sample(t)
    np.testing.assert_allclose(q[0], position, atol=1e-12)
    np.testing.assert_allclose(v[0], velocity, atol=1e-12)
    np.testing.assert_allclose(q[-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[1:-1], v[1:-1], atol=2e-3)
    a = np.gradient(v, t, axis=0)
    assert np.all(np.abs(a) <= bound_a * 1.03)
    assert np.all(np.abs(v) <= np.maximum(bound_v, np.abs(velocity)) * 1.03)


@pytest.mark.parametrize(("decays_s", "stretch"), [(0.5, 1.0), (0.95, 1.25)])
def test_where_a_plan_exceeds_a_limit_the_path_gets_less_and_an_offset_more_time(decays_s, stretch):
    times, rates, fast = np.linspace(0.0, 1.0, 11), np.ones(11), np.zeros((11, 7))
    fast[9] = 2.0 * LIMITS.velocity
    plan = JointPlan(times, np.tile(HOME, (11, 1)), fast, times, rates, "interaction")
    offset = Offset(*np.zeros((3, 7)), decays_s)
    found = _Budget(np.ones(N_GRID), 1.0).tightened(plan, offset, LIMITS, 0.9)
    assert found.stretch == stretch
    less = np.flatnonzero(found.share < 0.9)
    assert (less[0], less[-1]) == (round(0.8 * N_GRID) - 2, N_GRID - 1)
    use = np.maximum(*interval_use(times, plan.positions, fast, LIMITS)).max()
    assert found.share.min() == pytest.approx(0.9 * 0.97 / use)


@pytest.mark.slow
@pytest.mark.parametrize("slowest", [1, 10, 40])
def test_cubics_of_excess_agree_with_dense_sampling(slowest):
    rng = np.random.default_rng(slowest)
    times = np.cumsum(rng.uniform(0.02, 0.05, slowest + 2)) - 0.01
    times[0] = 0.0
    q, v = rng.normal(0, 0.01, (len(times), 7)), rng.normal(0, 0.2, (len(times), 7))
    plan = JointPlan(times, q, v, 0 * times, 0 * times, "stop")
    velocity, acceleration = interval_use(times, q, v, LIMITS)
    _, speeds, accelerations = plan.sampled(np.linspace(0.0, times[-1] - 1e-9, 20000))
    assert np.abs(speeds / LIMITS.velocity).max() == pytest.approx(velocity.max(), rel=1e-3)
    sharpest = np.abs(accelerations / LIMITS.acceleration).max()
    assert sharpest == pytest.approx(acceleration.max(), rel=1e-2)


TIMES, Q, V = samples(1, 2.0)


@pytest.mark.parametrize(
    ("times", "q", "v"),
    [
        (TIMES[:1], Q[:1], V[:1]),
        (TIMES, Q[:, :6], V),
        (TIMES, np.where(Q == Q[3, 2], np.nan, Q), V),
        (TIMES, Q, np.where(V == V[3, 2], np.inf, V)),
        (np.r_[TIMES[:5], TIMES[4:-1]], Q, V),
        (TIMES, Q, V[:-1]),
    ],
    ids=["short", "size", "nan", "velocities that are not finite", "times", "velocities"],
)
def test_what_is_no_trajectory_is_refused(times, q, v):
    with pytest.raises(TrajectoryError):
        make_path(times, q, LIMITS, v)


def test_two_samples_without_velocities_are_enough_and_no_motion_is_a_plan():
    path = make_path(np.array([0.0, 2.0]), np.stack([HOME, HOME - 0.3]), LIMITS)
    plan = plan_interaction(path, NominalTiming(0.0, 2.0), JointReference.at_rest(HOME), LIMITS)
    np.testing.assert_allclose(plan.end, HOME - 0.3)
    check_by_differences(plan)
    path = make_path(np.linspace(0, 1, 10), np.tile(HOME, (10, 1)), LIMITS)
    plan = plan_interaction(path, NominalTiming(-0.4, 1.0), JointReference.at_rest(HOME), LIMITS)
    np.testing.assert_allclose(plan.positions, np.tile(HOME, (len(plan.positions), 1)))
    assert plan.phase[-1] == 1.0


@pytest.mark.parametrize("half_step_s", [0.01, 0.05])
def test_the_rate_under_the_cap_is_the_largest_of_those_tried(rng, half_step_s):
    """Also where the cap jumps, so that a rate above one that is not allowed may be."""
    for _ in range(300):
        cap = np.abs(np.cumsum(rng.normal(0.0, 0.05, N_GRID + 1)))
        cap[50:] *= rng.choice([1.0, 30.0])
        cap[-1] = 0.0
        limits = SpeedLimits(np.empty(0), np.empty(0), tuple(cap.tolist()))
        s, most = float(rng.choice([rng.random(), 0.4995])), float(rng.uniform(0.0, 1.5))
        found = _under_cap(limits, s, most, half_step_s)
        ends = [min(s + half_step_s * rate, 1.0) for rate in (found, *np.linspace(0.0, most, 500))]
        allowed = [largest_rate(limits, end) for end in ends]
        assert 0.0 <= found <= min(most, allowed[0] + 1e-9)
        tried = [r for r, a in zip(np.linspace(0.0, most, 500), allowed[1:], strict=True) if r <= a]
        assert found >= max(tried, default=0.0) - 1e-9


def test_a_long_step_does_not_leap_over_where_the_cap_is_zero():
    """Below 1 until phase .01, then s'^2 <= 2 - 100 s with s = .05 s', hence s'^2 + 5 s' = 2."""
    cap = np.zeros(N_GRID + 1)
    cap[:4] = 1.0, 1.0, 0.0, 0.33
    found = _under_cap(SpeedLimits(np.empty(0), np.empty(0), tuple(cap.tolist())), 0.0, 1.0, 0.05)
    assert found == pytest.approx((33.0**0.5 - 5.0) / 2.0)
