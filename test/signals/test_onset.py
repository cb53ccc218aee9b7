# SPDX-License-Identifier: Apache-2.0
"""Onset and rest: causal, equal online and offline, silent on noise, right at any speed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulation import minimum_jerk

from intent_recognition.errors import ArgumentError
from intent_recognition.signals import OnsetSettings, at_rest, detect_onset
from intent_recognition.signals.onset import (
    first_onset,
    last_motion,
    peak_speed,
    speed_noise,
    windowed_velocity,
)

REFERENCE = OnsetSettings(reference_speed=0.5)
seeds = st.integers(0, 2**32 - 1)


def reach(
    rng: np.random.Generator,
    *,
    duration_s: float = 1.0,
    distance_m: float = 0.4,
    before_s: float = 1.0,
    after_s: float = 1.0,
    rate_hz: float = 100.0,
    noise_m: float = 0.001,
) -> tuple[np.ndarray, np.ndarray]:
    """Rest, a minimum-jerk reach that begins at `before_s`, rest: times (T,) and values (T, 3)."""
    times = np.arange(0.0, before_s + duration_s + after_s, 1.0 / rate_hz)
    direction = np.array([0.6, 0.0, 0.8])
    values = np.outer(minimum_jerk((times - before_s) / duration_s) * distance_m, direction)
    return times, values + noise_m * rng.normal(size=values.shape)


def streamed(settings: OnsetSettings, times, values) -> tuple[float | None, int]:
    """First answer of the online detector and the sample at which it came."""
    for end in range(1, len(times) + 1):
        onset = detect_onset(settings, times[:end], values[:end])
        if onset is not None:
            return onset, end
    return None, len(times)


def test_windowed_velocity_equals_a_line_fitted_to_each_window(rng):
    times = np.cumsum(rng.uniform(0.002, 0.03, size=80))
    values = rng.normal(size=(80, 2))
    found = windowed_velocity(times, values, 0.15)
    for i in range(80):
        window = (times >= times[i] - 0.15 - 1e-9) & (times <= times[i])
        if window.sum() < 3 or times[i] - times[window][0] < 0.075:
            assert np.all(np.isnan(found[i]))
        else:
            slope = np.polyfit(times[window] - times[i], values[window], 1)[0]
            np.testing.assert_allclose(found[i], slope, rtol=1e-6, atol=1e-8)


def test_velocity_far_from_the_origin_and_late_in_a_recording():
    times = 3600.0 + np.arange(0.0, 4 * 3600.0, 0.02)
    values = 1e4 + 0.3 * (times[:, None] - 3600.0)
    np.testing.assert_allclose(windowed_velocity(times, values, 0.15)[50:], 0.3, rtol=1e-6)


@given(seeds)
@settings(max_examples=15)
def test_offline_equals_streamed_on_irregular_samples_and_repeated_starts(seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.004, 0.03, size=250))
    values = np.cumsum(rng.normal(size=(250, 2)) * 0.004, axis=0)
    assert first_onset(REFERENCE, times, values) == streamed(REFERENCE, times, values)[0]


@pytest.mark.parametrize("rate_hz", [30.0, 100.0, 300.0])
@pytest.mark.parametrize("noise_m", [0.0, 0.002])
def test_noise_alone_never_triggers(noise_m, rate_hz):
    for seed in range(5):
        times, values = reach(
            np.random.default_rng(seed),
            distance_m=0.0,
            before_s=30.0,
            rate_hz=rate_hz,
            noise_m=noise_m,
        )
        assert first_onset(REFERENCE, times, values) is None


@pytest.mark.parametrize("speed", [1 / 2.5, 1 / 1.6, 1.0, 1.6, 2.5])
def test_onset_of_a_minimum_jerk_reach_is_found_over_a_range_of_speeds(speed):
    """A reach of 0.5 m/s peak at factor 1; the onset is put where the movement began."""
    duration = 1.5 / speed
    errors = []
    for seed in range(10):
        times, values = reach(np.random.default_rng(seed), duration_s=duration, before_s=1.5)
        onset = first_onset(REFERENCE, times, values)
        assert onset is not None
        errors.append(onset - 1.5)
    assert np.abs(errors).max() < 0.15 * duration
    assert -0.1 * duration < np.mean(errors) < 0.06 * duration


def test_a_twitch_is_ignored_and_of_too_large_movements_the_onset_is_found():
    times = np.arange(0.0, 3.0, 0.01)
    values = np.zeros((300, 1))
    values[150] = 0.02  # one outlier of a tracker
    assert first_onset(OnsetSettings(0.5, window_s=0.05), times, values) is None
    times_s = np.arange(0.0, 1.0, 0.01)
    values = 1e200 * np.maximum(times_s - 0.5, 0.0)[:, None]
    with np.errstate(over="ignore"):
        onset_s = detect_onset(REFERENCE, times_s, values)
    assert onset_s is not None and 0.0 <= onset_s <= 0.6


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_too_few_samples_are_no_movement(n):
    times, values = np.arange(n) * 0.1, np.zeros((n, 2))
    assert detect_onset(REFERENCE, times, values) is None
    assert first_onset(REFERENCE, times, values) is None
    assert not at_rest(REFERENCE, times, values)
    assert peak_speed(times, values) == 0.0


def test_rest_needs_its_time_and_ends_with_movement(rng):
    times, values = reach(rng, before_s=1.0, duration_s=1.0, after_s=1.0)
    resting = np.array(
        [at_rest(REFERENCE, times[:end], values[:end]) for end in range(1, len(times) + 1)]
    )
    assert not resting[times < 0.3].any()
    assert resting[(times > 0.6) & (times < 1.0)].all()
    assert not resting[(times > 1.3) & (times < 2.0)].any()
    assert resting[times > 2.6].all()
    assert not at_rest(REFERENCE, times, values, rest_s=2.5)


@pytest.mark.parametrize("noise_m", [0.0, 0.001, 0.003])
@pytest.mark.parametrize("duration_s", [0.6, 1.5, 3.0])
def test_last_motion_is_the_end_of_the_reach_however_long_the_rest(duration_s, noise_m):
    for seed, after_s in enumerate((1.0, 5.0, 20.0)):
        times, values = reach(
            np.random.default_rng(seed), duration_s=duration_s, after_s=after_s, noise_m=noise_m
        )
        assert last_motion(REFERENCE, times, values) == pytest.approx(1.0 + duration_s, abs=0.25)


@pytest.mark.parametrize("name", ["reference_speed", "window_s", "persistence_s", "rest_share"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_settings_that_cannot_be_are_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name}: expected a positive number.*OnsetSettings"):
        OnsetSettings(**{"reference_speed": 1.0, name: value})


@pytest.mark.parametrize(("rate", "window_s"), [(100.0, 0.15), (30.0, 0.2), (5.0, 0.6)])
def test_speed_noise_is_what_white_noise_gives(rate, window_s, rng):
    times = np.arange(0.0, 20_000 / rate, 1.0 / rate)
    noise = rng.normal(size=(len(times), 3)) * [1.0, 2.0, 0.5]
    velocity = windowed_velocity(times, noise, window_s)
    measured = np.sqrt(np.nanmean(np.sum(velocity**2, axis=1)))
    assert speed_noise(times, noise, window_s) == pytest.approx(measured, rel=0.05)


def test_a_straight_line_has_no_speed_noise_whenever_it_is_sampled(rng):
    times = np.cumsum(rng.uniform(0.005, 0.02, 500))
    line = 1e5 + 0.3 * times[:, None]
    assert speed_noise(times, line) == pytest.approx(0.0, abs=1e-8)
    assert speed_noise(times[:3], line[:3]) == 0.0
