# SPDX-License-Identifier: Apache-2.0
"""The reference curve: interpolation, stamps, replacement without a jump, holding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import composite, floats, integers, lists, none, one_of

from intent_recognition.kinematics.lwr import JOINT_NAMES, LWR_LIMITS
from sim_bridge.arm import RejectedTrajectoryError, TrajectoryCommand, trajectory_follower
from sim_bridge.arm.trajectory_follower import ACCELERATION_SHARE, TrajectoryFollower

REST = np.zeros(7)


def quintic_rows(start, goal, duration_s, n):
    """Times and rows of positions, velocities and accelerations from rest to rest."""
    z = np.linspace(0.0, 1.0, n)[:, None]
    way = goal - start
    q = start + way * (10 * z**3 - 15 * z**4 + 6 * z**5)
    qd = way * (30 * z**2 - 60 * z**3 + 30 * z**4) / duration_s
    qdd = way * (60 * z - 180 * z**2 + 120 * z**3) / duration_s**2
    return z[:, 0] * duration_s, q, qd, qdd


def command(*rows, **options):
    return TrajectoryCommand.validated(JOINT_NAMES, *rows, **options)


def following(*rows, since_s=0.0, **options):
    """At rest, and then given such a command."""
    follower = TrajectoryFollower(REST)
    follower.accept(command(*rows, **options), since_s)
    return follower


def samples(follower, times):
    return [*map(np.array, zip(*(follower.sample(t) for t in times), strict=True))]


def test_points_are_the_quintic_or_the_cubic_through_them_or_do_not_overshoot():
    times, q, qd, qdd = quintic_rows(REST, np.full(7, 0.5), 2.0, 5)
    follower = following(times, q, qd, qdd)
    fine, *expected = quintic_rows(REST, np.full(7, 0.5), 2.0, 401)
    for found, wanted in zip(samples(follower, fine), expected, strict=True):
        assert np.allclose(found, wanted, atol=1e-9)
    times, q, qd, _ = quintic_rows(REST, np.full(7, 0.5), 2.0, 9)
    follower = following(times, q, qd, since_s=3.0)
    found_q, found_qd, _ = samples(follower, 3.0 + times)
    assert np.allclose(found_q, q, atol=1e-12)
    assert np.allclose(found_qd, qd, atol=1e-12)
    q = np.outer([0.0, 0.3, 0.35, 0.35, 0.1], np.ones(7))
    follower = following([0.0, 0.5, 1.0, 1.5, 2.0], q)
    found, velocities, _ = samples(follower, np.linspace(0.0, 2.0, 500))
    assert found.max() <= 0.35 + 1e-9
    assert found.min() >= -1e-9
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.05


def test_a_single_point_is_reached_at_its_time_and_held_or_later_within_the_limits():
    goal = np.full(7, 0.4)
    follower = following([2.0], [goal], since_s=1.0)
    for t in (3.0, 3.5, 100.0):
        reference = follower.sample(t)
        assert np.allclose(reference.position, goal, atol=1e-9)
        assert np.allclose(reference.velocity, 0.0, atol=1e-9)
    assert np.all(follower.sample(2.0).position > 0.1)
    follower = following([0.001], [np.full(7, 0.8)])
    q, qd, qdd = samples(follower, np.linspace(0.0, 3.0, 3000))
    assert np.all(np.abs(qd) <= LWR_LIMITS.velocity)
    assert np.all(np.abs(qdd) <= LWR_LIMITS.acceleration)
    assert np.allclose(q[-1], 0.8)


def test_commands_wait_are_late_or_replace_one_that_waits():
    times, q, qd, qdd = quintic_rows(REST, np.full(7, 0.5), 2.0, 9)
    follower = following(times, q, qd, qdd)
    alone = samples(follower, np.linspace(0.0, 1.0, 100))
    later = command(times, q * -1.0, -qd, -qdd, start_s=1.0)
    follower.accept(later, 0.5)
    both = samples(follower, np.linspace(0.5, 0.9999, 50))
    assert np.allclose(both[0], np.interp(np.linspace(0.5, 0.9999, 50),
                       np.linspace(0.0, 1.0, 100), alone[0][:, 0])[:, None], atol=1e-4)  # fmt: skip
    assert np.allclose(follower.sample(10.0).position, -0.5)
    follower = TrajectoryFollower(q[4])
    follower.accept(command(times, q, qd, qdd, start_s=4.0, now_s=5.0), 5.0)
    # The second half is followed once the difference in velocity has faded.
    assert np.allclose(follower.sample(5.9).position, q[-1], atol=2e-2)
    assert np.allclose(follower.sample(6.5).position, q[-1], atol=1e-9)
    follower = following([1.0], [np.full(7, 0.5)], start_s=5.0)
    follower.accept(command([1.0], [np.full(7, -0.3)], start_s=2.0), 0.0)
    assert np.allclose(follower.sample(20.0).position, -0.3)
    assert np.allclose(follower.sample(1.9).position, 0.0)
    follower = following([1.0], [np.full(7, 0.5)])
    follower.hold(np.full(7, 0.2))
    assert np.array_equal(follower.sample(5.0).position, np.full(7, 0.2))


@composite
def scripts(draw):
    """Commands with their moments of arrival: gaps, goals, durations, stamps."""
    script = []
    now = 0.0
    for _ in range(draw(integers(1, 5))):
        now += draw(floats(0.0, 1.5))
        goal = np.array(draw(lists(floats(-1.0, 1.0), min_size=7, max_size=7)))
        begin = np.array(draw(lists(floats(-1.0, 1.0), min_size=7, max_size=7)))
        delay = draw(one_of(none(), floats(-0.5, 1.0)))
        script.append((now, begin, goal, draw(floats(2.5, 4.0)), draw(integers(2, 6)), delay))
    return script


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(scripts())
def test_replacement_is_continuous_and_its_acceleration_bounded(script):
    follower = TrajectoryFollower(REST)
    switches, own = [], 0.0
    for now, begin, goal, duration, n, delay in script:
        times, q, qd, qdd = quintic_rows(begin, goal, duration, n)
        start = None if delay is None else now + delay
        new = command(times, q, qd, qdd, start_s=start, now_s=now)
        switch = now if delay is None else max(now, now + delay)
        before = follower.sample(switch) if switch == now else None
        follower.accept(new, now)
        after = follower.sample(switch)
        if before is not None:
            assert np.allclose(before.position, after.position, atol=1e-9)
            assert np.allclose(before.velocity, after.velocity, atol=1e-9)
        switches.append(switch)
        own = max(
            own,
            float(np.abs(qdd).max()),
            10 / np.sqrt(3) * np.abs(goal - begin).max() / duration**2,
        )
        # What is still to come is smooth everywhere, across switches that wait as well.
        grid = np.arange(now, now + 8.0, 0.005)
        found_q, found_qd, found_qdd = samples(follower, grid)
        bound = own * len(switches) + ACCELERATION_SHARE * 8.0 * len(switches) + 1e-6
        assert np.abs(found_qdd).max() <= bound
        assert np.abs(np.diff(found_qd, axis=0)).max() <= bound * 0.005 + 1e-9
        speed = np.abs(found_qd).max()
        assert np.abs(np.diff(found_q, axis=0)).max() <= speed * 0.005 + bound * 0.005**2
    assert np.allclose(follower.sample(50.0).velocity, 0.0)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(lists(floats(-1.5, 1.5), min_size=7, max_size=7))
def test_blend_alone_keeps_its_share_of_the_acceleration(goal):
    follower = following([0.0], [goal])
    _, _, qdd = samples(follower, np.linspace(0.0, 5.0, 2000))
    assert np.all(np.abs(qdd) <= ACCELERATION_SHARE * LWR_LIMITS.acceleration * (1.0 + 1e-9))


def test_one_that_cannot_be_joined_within_the_limits_is_rejected_and_changes_nothing(monkeypatch):
    """Where it accelerates as it may, nothing is left to make up with in a short time."""
    monkeypatch.setattr(trajectory_follower, "LONGEST_FADE_S", 0.1)
    follower = TrajectoryFollower(REST, LWR_LIMITS)
    follower.accept(command([0.0, 1.0], [REST, REST + 0.1]), 0.0)
    before = [follower.sample(t) for t in (0.5, 2.0)]
    acceleration, seconds = LWR_LIMITS.acceleration[0], 0.2
    q, qd = np.zeros((3, 7)), np.zeros((3, 7))
    q[1:, 0] = acceleration * seconds**2 * np.array([0.5, 1.0])
    qd[1, 0] = acceleration * seconds
    late = command([0.0, seconds, 2 * seconds], q, qd, start_s=-0.1, now_s=0.0)
    with pytest.raises(RejectedTrajectoryError, match="joined within the limits") as caught:
        follower.accept(late, 0.0)
    assert caught.value.reason == "cannot_join"
    for t, reference in zip((0.5, 2.0), before, strict=True):
        np.testing.assert_array_equal(follower.sample(t).position, reference.position)


def test_names_in_any_order():
    order = [3, 0, 6, 1, 5, 2, 4]
    goal = np.arange(7) * 0.1
    times, q, qd, qdd = quintic_rows(REST, goal, 2.0, 5)
    shuffled = TrajectoryCommand.validated(
        [JOINT_NAMES[i] for i in order], times, q[:, order], qd[:, order], qdd[:, order]
    )
    assert np.array_equal(shuffled.positions, q)
    assert np.array_equal(shuffled.velocities, qd)
    assert np.array_equal(shuffled.accelerations, qdd)
