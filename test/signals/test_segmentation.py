# SPDX-License-Identifier: Apache-2.0
"""Cutting a recording to the interaction, and interactions proposed from motion alone."""

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.signals import Signal, propose_spans
from intent_recognition.signals.onset import OnsetSettings, first_onset
from intent_recognition.signals.segmentation import END_MARGIN_S, movement_span, onset_settings


def moving(begin_s: float, end_s: float, total_s: float = 6.0, rng=None, rate=100.0) -> Signal:
    """One DOF that goes from 0 to 0.4 between two times."""
    times = np.arange(0.0, total_s, 1.0 / rate)
    values = 0.4 * minimum_jerk((times - begin_s) / (end_s - begin_s))[:, None]
    if rng is not None:
        values = values + 0.0005 * rng.normal(size=values.shape)
    return Signal(("x",), START_NS + np.round(times * 1e9).astype(np.int64), values, "m")


def span(observed, controlled, end_s: float = 6.0, settled: bool = False) -> tuple[float, float]:
    """Start and end [s], by given thresholds or by those that follow from the recording itself."""
    settings = [
        onset_settings([side]) if settled else [OnsetSettings(0.5)] * len(side)
        for side in (observed, controlled)
    ]
    found = movement_span(observed, controlled, *settings, START_NS, START_NS + round(end_s * 1e9))
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


@pytest.mark.parametrize("rate", [4.0, 5.0, 10.0, 13.0])
def test_a_tracker_of_few_samples_per_second_shows_the_movement_too(rate, rng):
    observed, controlled = moving(2.0, 4.0, 8.0, rng, rate), moving(2.0, 4.0, 8.0, rng, rate)
    start, end = span([observed], [controlled], 8.0, settled=True)
    assert start == pytest.approx(2.0, abs=1.0 / rate + 0.1)
    assert end == pytest.approx(4.0 + END_MARGIN_S, abs=3.0 / rate + 0.1)


@pytest.mark.parametrize(("rate", "duration_s"), [(100.0, 30.0), (20.0, 30.0), (20.0, 90.0)])
def test_noise_is_no_movement_however_slow_the_movement_is(rate, duration_s, rng):
    end_s = 10.0 + duration_s
    slow = moving(10.0, end_s, end_s + 10.0, rng, rate)
    start, end = span([slow], [slow], end_s + 10.0, settled=True)
    # A tenth of a minimum jerk's time, at each end, is slower than 15 % of its peak.
    assert start == pytest.approx(10.0, abs=0.2 * duration_s)
    assert end == pytest.approx(end_s, abs=0.2 * duration_s)


def test_neither_noisy_signals_nor_units_move_the_thresholds(rng):
    times = moving(1.0, 2.0).stamps_ns
    force = Signal(("fx", "fy", "fz"), times, 0.3 * rng.normal(size=(len(times), 3)), "N")
    hand = moving(2.0, 3.0, rng=rng)
    alone = span([hand], [hand], 6.0, settled=True)
    assert span([hand, force], [hand, force], 6.0, settled=True) == alone
    metres = moving(1.0, 2.0, rng=rng)
    for scale in (1e-3, 1e3):
        other = Signal(("x",), metres.stamps_ns, scale * metres.values + 1e3, "mm")
        (ours,), (theirs,) = onset_settings([[metres]]), onset_settings([[other]])
        assert theirs.window_s == ours.window_s
        assert theirs.reference_speed == pytest.approx(scale * ours.reference_speed)


RATE_HZ = 100.0
HOME = np.array([1.0, 0.0])
TOLERANCE_S = 0.1


def course(start, moves, length_s):
    """(onset, duration, goal) of each movement to positions (T, 2), with a sensor's noise."""
    times = np.arange(0.0, length_s, 1.0 / RATE_HZ)
    place, path = np.asarray(start, float), np.tile(np.asarray(start, float), (len(times), 1))
    for onset_s, duration_s, goal in moves:
        done = minimum_jerk((times - onset_s) / duration_s)[:, None]
        path = path + done * (np.asarray(goal, float) - place)
        place = np.asarray(goal, float)
    noise = 0.0005 * np.random.default_rng(0).standard_normal(path.shape)
    return Signal(("x", "y"), (times * 1e9).astype(np.int64), path + noise, "m")


def seconds(spans):
    return np.array([[span.start_ns, span.end_ns] for span in spans]) * 1e-9


def test_a_way_there_and_back_is_one_interaction_up_to_the_way_back():
    moves = []
    for k in range(4):
        moves += [(1.0 + 6.0 * k, 2.0, (0.6, 0.1 * k)), (4.2 + 6.0 * k, 1.2, HOME)]
    found = seconds(propose_spans([course(HOME, moves, 26.0)], []))
    wanted = [[1.0 + 6.0 * k, 3.0 + 6.0 * k] for k in range(4)]
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE_S)


def test_an_interaction_lasts_until_both_agents_rest_and_pauses_divide_none():
    human, robot = [], []
    for t in (1.0, 11.0, 21.0):
        human += [(t, 1.0, (0.7, 0.3)), (t + 1.5, 1.2, (0.6, 0.0)), (t + 6.0, 1.0, HOME)]
        robot += [(t + 0.5, 1.0, (0.2, 0.2)), (t + 3.1, 1.5, (0.5, 0.1)), (t + 6.0, 1.0, (0, 0))]
    spans = propose_spans([course(HOME, human, 30.0)], [course((0, 0), robot, 30.0)])
    wanted = [[t, t + 4.6] for t in (1.0, 11.0, 21.0)]
    np.testing.assert_allclose(seconds(spans), wanted, atol=TOLERANCE_S)


def test_movements_that_begin_and_end_at_home_are_interactions_each():
    """As a wave or a handshake, recorded from rest to rest."""
    times = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    path = np.tile(HOME, (len(times), 1))
    for t in (1.0, 6.0, 11.0, 16.0):
        done = minimum_jerk((times - t) / 1.2) - minimum_jerk((times - t - 1.2) / 1.2)
        path = path + done[:, None] * np.array([-0.4, 0.1])
    path += 0.0005 * np.random.default_rng(0).standard_normal(path.shape)
    signal = Signal(("x", "y"), (times * 1e9).astype(np.int64), path, "m")
    found = seconds(propose_spans([signal], []))
    wanted = [[t, t + 2.4] for t in (1.0, 6.0, 11.0, 16.0)]
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE_S)


@pytest.mark.parametrize("length_s", [0.02, 5.0])
def test_rest_alone_proposes_nothing(length_s):
    times = np.arange(0.0, length_s, 1.0 / RATE_HZ)
    still = Signal(("x",), (times * 1e9).astype(np.int64), np.ones((len(times), 1)), "m")
    assert propose_spans([still], []) == []
