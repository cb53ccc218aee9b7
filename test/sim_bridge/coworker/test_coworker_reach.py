# SPDX-License-Identifier: Apache-2.0
"""The wrist's movement, and what disturbs it and its measurement."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import welch

from intent_recognition.promp import minimum_jerk
from sim_bridge.coworker import draw_reach, draw_rest, sample_wrist
from sim_bridge.coworker.noise import (
    TREMOR_STD_M,
    occlusions,
    signal_dependent,
    smooth_noise,
    tremor,
)
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


def test_tremor_is_below_a_millimetre_and_peaks_between_8_and_12_hz():
    shaken = tremor(np.random.default_rng(0), 20_000)
    frequency, power = welch(shaken, fs=100.0, nperseg=1024, axis=0)
    assert np.all(frequency[np.argmax(power, axis=0)] > 8.0)
    assert np.all(frequency[np.argmax(power, axis=0)] < 12.0)
    np.testing.assert_allclose(shaken.std(axis=0), TREMOR_STD_M, rtol=0.15)
    assert np.abs(shaken).max() < 0.0025


def test_tremor_is_seen_in_the_measured_wrist_at_rest():
    rng = np.random.default_rng(1)
    reach = draw_reach(rng, "plate_handover", draw_rest(rng))
    samples = sample_wrist(rng, [(400.0, reach)], 405.0, gaps_per_s=0.0)
    frequency, power = welch(samples.positions_m[:40_000], fs=100.0, nperseg=1024, axis=0)
    total = power.sum(axis=1)
    band = total[(frequency > 9) & (frequency < 11)].mean()
    floor = total[(frequency > 20) & (frequency < 40)].mean()
    assert band > 2.0 * floor
    # The floor is the tracker's white noise of 1 mm on each of three axes.
    assert floor == pytest.approx(3 * 2 * 0.001**2 / 100.0, rel=0.1)


def test_noise_is_smooth_and_occlusions_are_gaps_of_the_stated_length():
    values = smooth_noise(np.random.default_rng(2), 50_000, 1.5)
    np.testing.assert_allclose(values.std(axis=0), 1.0, rtol=0.1)
    frequency, power = welch(values, fs=100.0, nperseg=1024, axis=0)
    assert np.all(power[frequency > 15.0].max(axis=0) < 1e-3 * power.max(axis=0))
    rng = np.random.default_rng(4)
    lengths = []
    for _ in range(200):
        hidden = ~occlusions(rng, 1000, 0.1, 0.0)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], hidden, [0]))))
        lengths += list(edges[1::2] - edges[::2])
    assert 100 < len(lengths) < 300
    assert np.median(lengths) == pytest.approx(20, abs=4)
    assert occlusions(rng, 500, 0.0, 0.0).all()


@pytest.mark.slow
def test_signal_dependent_noise_grows_with_speed_and_keeps_the_ends():
    tau = np.linspace(0.0, 1.0, 301)
    path = np.outer(minimum_jerk(tau), [0.4, 0.0, 0.0])

    def spread(positions):
        drawn = [signal_dependent(np.random.default_rng(k), positions) for k in range(200)]
        return np.std([d[150] for d in drawn]), np.array(drawn)

    slow, drawn = spread(0.5 * path)
    fast, _ = spread(path)
    assert fast == pytest.approx(2.0 * slow, rel=1e-6)
    assert 0.0005 < fast < 0.01
    np.testing.assert_allclose(drawn[:, -1], 0.0, atol=1e-12)
    assert np.abs(drawn[:, 0]).max() < 1e-4
