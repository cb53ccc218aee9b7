# SPDX-License-Identifier: Apache-2.0
"""Cutting a recording to the interaction."""

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.signals.onset import OnsetSettings, first_onset
from intent_recognition.signals.segmentation import END_MARGIN_S, movement_span, onset_settings
from intent_recognition.signals.signal import Signal


def moving(begin_s: float, end_s: float, total_s: float = 6.0, rng=None, rate=100.0) -> Signal:
    """One DOF that goes from 0 to 0.4 between two times."""
    times = np.arange(0.0, total_s, 1.0 / rate)
    values = 0.4 * minimum_jerk((times - begin_s) / (end_s - begin_s))[:, None]
    if rng is not None:
        values = values + 0.0005 * rng.normal(size=values.shape)
    return Signal(("x",), START_NS + np.round(times * 1e9).astype(np.int64), values, "m")


def span(observed, controlled, end_s: float = 6.0) -> tuple[float, float]:
    settings = (OnsetSettings(0.5),)
    found = movement_span(
        observed,
        controlled,
        settings * len(observed),
        settings * len(controlled),
        START_NS,
        START_NS + round(end_s * 1e9),
    )
    return (found[0] - START_NS) * 1e-9, (found[1] - START_NS) * 1e-9


def test_from_the_humans_onset_to_the_end_of_the_last_of_both(rng):
    start, end = span([moving(1.0, 2.0, rng=rng)], [moving(1.5, 4.0, rng=rng)])
    assert start == pytest.approx(1.0, abs=0.12)
    assert end == pytest.approx(4.0 + END_MARGIN_S, abs=0.25)
    _, end = span([moving(1.0, 4.5)], [moving(1.5, 3.0)])
    assert end == pytest.approx(4.5 + END_MARGIN_S, abs=0.25)
    signal = moving(1.0, 2.0, rng=rng)
    start, _ = span([signal], [moving(1.5, 3.0)])
    online = first_onset(OnsetSettings(0.5), signal.seconds(START_NS), signal.values)
    assert start == pytest.approx(online, abs=1e-9)


@pytest.mark.parametrize(
    ("observed", "controlled", "begin_s"),
    [([(2.0, 3.0)], (0.5, 4.0), 2.0), ([(2.5, 3.0), (1.0, 2.0)], (2.0, 4.0), 1.0)],
)
def test_the_earliest_observed_signal_begins_it_and_no_robot(observed, controlled, begin_s):
    start, _ = span([moving(*one) for one in observed], [moving(*controlled)])
    assert start == pytest.approx(begin_s, abs=0.12)


def test_a_recording_without_onset_is_kept_whole_and_its_end_is_never_passed():
    still = Signal(("x",), START_NS + np.arange(100) * 10_000_000, np.zeros((100, 1)), "m")
    assert span([still], [still], 0.99) == pytest.approx((0.0, 0.99))
    _, end = span([moving(1.0, 2.0)], [moving(1.0, 7.0)], 5.95)
    assert end == 5.95


def test_reference_speed_is_the_median_of_the_peaks_and_positive_without_any(rng):
    recordings = [(moving(1.0, 1.0 + d),) for d in (1.0, 2.0, 4.0)]
    settings = onset_settings(recordings)
    assert len(settings) == 1
    assert settings[0].reference_speed == pytest.approx(1.875 * 0.4 / 2.0, rel=0.02)
    empty = Signal(("x",), [], np.zeros((0, 1)), "m")
    still = Signal(("x",), [1, 2, 3, 4], np.zeros((4, 1)), "m")
    for signal in (empty, still):
        assert onset_settings([(signal,)])[0].reference_speed > 0


def settled_span(observed, controlled, end_s: float) -> tuple[float, float]:
    """The span by the thresholds that follow from the recording itself."""
    found = movement_span(
        observed,
        controlled,
        onset_settings([observed]),
        onset_settings([controlled]),
        START_NS,
        START_NS + round(end_s * 1e9),
    )
    return (found[0] - START_NS) * 1e-9, (found[1] - START_NS) * 1e-9


@pytest.mark.parametrize("rate", [4.0, 5.0, 10.0, 13.0])
def test_a_tracker_of_few_samples_per_second_shows_the_movement_too(rate, rng):
    observed, controlled = moving(2.0, 4.0, 8.0, rng, rate), moving(2.0, 4.0, 8.0, rng, rate)
    start, end = settled_span([observed], [controlled], 8.0)
    assert start == pytest.approx(2.0, abs=1.0 / rate + 0.1)
    assert end == pytest.approx(4.0 + END_MARGIN_S, abs=3.0 / rate + 0.1)


@pytest.mark.parametrize(("rate", "duration_s"), [(100.0, 30.0), (20.0, 30.0), (20.0, 90.0)])
def test_noise_is_no_movement_however_slow_the_movement_is(rate, duration_s, rng):
    end_s = 10.0 + duration_s
    slow = moving(10.0, end_s, end_s + 10.0, rng, rate)
    start, end = settled_span([slow], [slow], end_s + 10.0)
    # A tenth of a minimum jerk's time, at each end, is slower than 15 % of its peak.
    assert start == pytest.approx(10.0, abs=0.2 * duration_s)
    assert end == pytest.approx(end_s, abs=0.2 * duration_s)


def test_neither_noisy_signals_nor_units_move_the_thresholds(rng):
    times = moving(1.0, 2.0).stamps_ns
    force = Signal(("fx", "fy", "fz"), times, 0.3 * rng.normal(size=(len(times), 3)), "N")
    hand = moving(2.0, 3.0, rng=rng)
    alone = settled_span([hand], [hand], 6.0)
    assert settled_span([hand, force], [hand, force], 6.0) == alone
    metres = moving(1.0, 2.0, rng=rng)
    for scale in (1e-3, 1e3):
        other = Signal(("x",), metres.stamps_ns, scale * metres.values + 1e3, "mm")
        (ours,), (theirs,) = onset_settings([[metres]]), onset_settings([[other]])
        assert theirs.window_s == ours.window_s
        assert theirs.reference_speed == pytest.approx(scale * ours.reference_speed)
