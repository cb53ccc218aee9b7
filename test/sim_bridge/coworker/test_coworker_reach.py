# SPDX-License-Identifier: Apache-2.0
"""The wrist's movement: minimum jerk, hesitation, goal regions, speeds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.coworker.reach import Hesitation, Reach, bow_profile, normalised_time
from sim_bridge.coworker.timeline import quaternions


def reach(nominal_s=2.0, hesitations=(), bow=(0.0, 0.0, 0.0)) -> Reach:
    start, goal = np.zeros(3), np.array([0.4, 0.0, 0.0])
    return Reach("", start, goal, nominal_s, np.array(bow), 1.2, np.zeros(3), hesitations)


def test_straight_reach_has_the_peaks_of_minimum_jerk():
    times = np.linspace(0.0, 2.0, 4001)
    x = reach().positions(times)[:, 0]
    velocity = np.gradient(x, times)
    acceleration = np.gradient(velocity, times)
    assert velocity.max() == pytest.approx(1.875 * 0.4 / 2.0, rel=1e-3)
    assert np.abs(acceleration[5:-5]).max() == pytest.approx(10 / np.sqrt(3) * 0.4 / 4.0, rel=5e-3)
    jerk = np.gradient(acceleration, times)
    assert np.abs(jerk[20:-20]).max() <= 60.0 * 0.4 / 2.0**3 * 1.02


@given(st.floats(1.0, 1.8), st.floats(1.6, 4.0), st.floats(0.3, 0.75), st.floats(0.1, 0.45))
@settings(max_examples=40, deadline=None)
def test_any_reach_rests_at_both_ends_and_takes_its_time(skew, nominal_s, centre, extra_s):
    slow = Hesitation(centre, 0.04, extra_s)
    moved = Reach(
        "", np.zeros(3), np.ones(3) * 0.2, nominal_s, np.ones(3) * 0.1, skew, np.zeros(3), (slow,)
    )
    assert moved.duration_s == pytest.approx(nominal_s + extra_s)
    ends = moved.positions(np.array([-1.0, 0.0, moved.duration_s, moved.duration_s + 1.0]))
    np.testing.assert_allclose(ends, [moved.start_m] * 2 + [moved.goal_m] * 2, atol=1e-12)
    tau = normalised_time(moved, np.linspace(0.0, moved.duration_s, 500))
    assert np.all(np.diff(tau) > 0.0)
    assert bow_profile(np.array(1.0 / (1.0 + skew)), skew) == pytest.approx(1.0)


def test_hesitation_slows_the_hand_and_quaternions_are_unit_and_continuous():
    slow = reach(2.0, (Hesitation(0.5, 0.04, 0.4),))
    times = np.linspace(0.0, slow.duration_s, 2000)
    speed = np.abs(np.gradient(slow.positions(times)[:, 0], times))
    middle = np.argmin(np.abs(normalised_time(slow, times) - 0.5))
    before = np.argmin(np.abs(normalised_time(slow, times) - 0.35))
    assert speed[middle] < 0.5 * speed[before]
    turns = np.linspace(0.0, 1.0, 50)[:, None] * np.array([0.0, 0.0, 3.0])
    q = quaternions(turns)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.99)
    assert 2.0 * np.arccos(np.clip(q[0] @ q[-1], -1, 1)) == pytest.approx(3.0)
