# SPDX-License-Identifier: Apache-2.0
"""Spectra and sizes of what disturbs the wrist and its measurement."""

import numpy as np
import pytest
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
