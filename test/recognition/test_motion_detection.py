# SPDX-License-Identifier: Apache-2.0
"""Onset and end of movements from trackers of any rate, with thresholds learned from recordings."""

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.filtering.posterior import TaskPosterior
from intent_recognition.recognition.motion_detection import HISTORY_S, MotionDetector, past_s
from intent_recognition.signals import Observation, OnsetSettings, Signal, onset_settings
from intent_recognition.signals.segmentation import LEAST_RATE_HZ


def reach(rate: float, begin_s: float, end_s: float, total_s: float, rng) -> Signal:
    """Three DOFs that move by 0.4 each, with noise of a millimetre."""
    times_s = np.arange(0.0, total_s, 1.0 / rate)
    done = minimum_jerk((times_s - begin_s) / (end_s - begin_s))[:, None]
    values = 0.4 * done + 0.001 * rng.normal(size=(len(times_s), 3))
    return Signal(("x", "y", "z"), START_NS + np.round(times_s * 1e9).astype(np.int64), values, "m")


def half_way(duration_s: float) -> TaskPosterior:
    """Surely the first of one task, half done."""
    sure = np.array([1.0, 0.0])
    half, length = np.full(2, 0.5), np.full(2, duration_s)
    return TaskPosterior(sure, np.zeros(2), half, length, np.ones((2, 1)))


@pytest.mark.parametrize(
    ("rate", "duration_s"), [(4.0, 3.0), (5.0, 2.0), (12.0, 1.0), (100.0, 1.0), (100.0, 30.0)]
)
def test_a_movement_begins_once_and_is_over_where_it_stops(rate, duration_s, rng):
    begin_s, end_s, total_s = 5.0, 5.0 + duration_s, 12.0 + duration_s
    settings = onset_settings([[reach(rate, begin_s, end_s, total_s, rng)]])
    signal = reach(rate, begin_s, end_s, total_s, rng)
    detector = MotionDetector([3], settings)
    onset_s = over_s = None
    for stamp_ns, values in zip(signal.stamps_ns, signal.values, strict=True):
        detector.add(Observation(int(stamp_ns), 0, values))
        now_s = (stamp_ns - START_NS) * 1e-9
        if onset_s is None:
            onset_ns = detector.find_onset_ns()
            onset_s = None if onset_ns is None else (onset_ns - START_NS) * 1e-9
        elif over_s is None and detector.ends(now_s - onset_s, half_way(duration_s)):
            over_s = now_s
    assert onset_s == pytest.approx(begin_s, abs=0.3 + 0.15 * duration_s)
    assert over_s == pytest.approx(end_s + 1.5, abs=0.8 + 0.15 * duration_s)


def test_usual_windows_keep_the_usual_past_and_one_sample_is_not_sparse():
    assert past_s(OnsetSettings(1.0)) == HISTORY_S
    assert past_s(OnsetSettings(1.0, window_s=0.6)) > HISTORY_S + 0.5
    detector = MotionDetector([3], [OnsetSettings(1.0)])
    assert detector.too_sparse() is None
    detector.add(Observation(START_NS, 0, np.zeros(3)))
    assert detector.too_sparse() is None
    detector.waits_for_rest = True
    detector.change_past(lambda one: one._replace(values=one.values + 1.0))
    (changed,) = detector.since(START_NS)
    assert detector.waits_for_rest and changed.values.tolist() == [1.0] * 3


@pytest.mark.parametrize("trained_hz", [4.0, 100.0])
def test_a_signal_that_has_an_onset_is_not_called_sparse(trained_hz, rng):
    """And one that has none for its rate is."""
    settings = onset_settings([[reach(trained_hz, 2.0, 4.0, 7.0, rng)]])
    for rate in (1.0, 2.0, 4.0, 8.0, 20.0, 50.0):
        detector, found = MotionDetector([3], settings), False
        signal = reach(rate, 5.0, 7.0, 8.0, rng)
        for stamp_ns, values in zip(signal.stamps_ns, signal.values, strict=True):
            detector.add(Observation(int(stamp_ns), 0, values))
            found = found or detector.find_onset_ns() is not None
        sparse = detector.too_sparse()
        assert sparse is None or not found
        if rate < LEAST_RATE_HZ or (rate < 10.0 and trained_hz == 100.0):
            assert sparse is not None and not found
            assert sparse.rate_hz == pytest.approx(rate) and sparse.least_hz > rate
            assert "wrist/pose" in sparse.warning("wrist/pose")
