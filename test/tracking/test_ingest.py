# SPDX-License-Identifier: Apache-2.0
"""What pose ingest lets through, what it drops and how it recovers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError
from intent_recognition.tracking.ingest import (
    IngestSettings,
    IngestState,
    Rejected,
    TrackedPose,
    ingest_pose,
)

T0 = 10**18
STEP = 10**7
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
DEFAULT = IngestSettings()
LATE, JUMP, NEW = "stamp_not_increasing", "jump", "a new track"
REASONS = {"not_finite", "zero_stamp", "stamp_not_increasing", "jump", "unknown_frame"}


def feed(samples, setting=DEFAULT, state=None, frame="world"):
    """Results of (index, position) samples at 100 Hz, and the last state."""
    state = state or IngestState()
    results = []
    for index, position in samples:
        state, result = ingest_pose(
            setting, state, T0 + round(index * STEP), np.array(position), UPRIGHT, frame
        )
        results.append(result)
    return results, state


def walk(count, start=0, offset=0.0):
    """A point moving at 1 m/s along x."""
    return [(start + i, [offset + 0.01 * (start + i), 0.2, 0.3]) for i in range(count)]


def reasons(results):
    return [result.reason if isinstance(result, Rejected) else None for result in results]


def test_steady_motion_passes_unchanged():
    results, _ = feed(walk(50))
    assert reasons(results) == [None] * 50
    np.testing.assert_array_equal(results[7].position, [0.07, 0.2, 0.3])
    assert results[7].stamp_ns == T0 + 7 * STEP
    np.testing.assert_allclose(results[-1].velocity.mean, [1.0, 0.0, 0.0], atol=1e-9)
    assert results[1].velocity is None


def test_velocity_covariance_holds_its_sample_variance():
    generator = np.random.default_rng(1)
    errors, variances = [], []
    for _ in range(200):
        samples = [(i, np.array(p) + generator.normal(0.0, 0.002, 3)) for i, p in walk(11)]
        results, _ = feed(samples)
        errors.append(results[-1].velocity.mean - [1.0, 0.0, 0.0])
        variances.append(np.diag(results[-1].velocity.covariance))
    ratio = np.mean(np.square(errors)) / np.mean(variances)
    assert 0.8 < ratio < 1.25


@pytest.mark.parametrize("count", [3, 30, 300])
def test_zeros_of_a_hidden_body_never_begin_a_track(count):
    hidden = [(50 + k, [0.0, 0.0, 0.0]) for k in range(count)]
    results, _ = feed([*walk(50), *hidden, *walk(50, 50 + count)])
    assert reasons(results) == [None] * 50 + [JUMP] * count + [None] * 50
    results, _ = feed([*hidden, *walk(50, 50 + count)])  # a body may rest there from the beginning
    assert reasons(results)[:count] == [None] * count and results[-1].position[0] > 0.5


def test_a_body_may_come_back_to_zero():
    share = np.clip(np.arange(120) / 100, 0.0, 1.0)
    x = 0.4 * (1.0 - share**3 * (10 - 15 * share + 6 * share**2))
    results, _ = feed([(k, [x[k], 0.0, 0.0]) for k in range(120)])
    assert reasons(results) == [None] * 120


@pytest.mark.parametrize("rate_hz", [25, 100, 333, 1000])
def test_velocity_at_any_rate(rate_hz):
    step = 100 / rate_hz
    samples = [(i * step, [2.0 * i / rate_hz, 0.2, 0.3]) for i in range(500)]
    results, state = feed(samples)
    np.testing.assert_allclose(results[-1].velocity.mean, [2.0, 0.0, 0.0], atol=1e-6)
    assert 3 <= len(state.recent) <= 42
    assert state.recent[-1][0] == results[-1].stamp_ns


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("place", range(3))
def test_unusable_position(bad, place):
    position = np.zeros(3)
    position[place] = bad
    state, result = ingest_pose(DEFAULT, IngestState(), T0, position, UPRIGHT, "world")
    assert result.reason == "not_finite"
    assert state == IngestState()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"orientation": np.array([0.0, 0.0, np.nan, 1.0])}, "not_finite"),
        ({"stamp_ns": 0}, "zero_stamp"),
        ({"stamp_ns": -5}, "zero_stamp"),
        ({"frame": "camera"}, "unknown_frame"),
        ({"frame": "/world"}, None),
    ],
)
def test_what_else_is_dropped(changes, reason):
    usual = {"stamp_ns": T0, "position": np.zeros(3), "orientation": UPRIGHT, "frame": "world"}
    _, result = ingest_pose(DEFAULT, IngestState(), *(usual | changes).values())
    assert reasons([result]) == [reason]


def test_zero_orientation_is_an_unmeasured_one():
    _, result = ingest_pose(DEFAULT, IngestState(), T0, np.zeros(3), np.zeros(4), "world")
    assert isinstance(result, TrackedPose)
    assert not result.orientation_measured
    np.testing.assert_array_equal(result.orientation, UPRIGHT)


def test_known_frame_is_transformed():
    turn = Rotation.from_euler("z", 90, degrees=True).as_quat()
    setting = IngestSettings(
        extrinsics={"camera": (np.array([1.0, 2.0, 3.0]), turn)},
        position_std_m=np.array([0.001, 0.002, 0.003]),
    )
    results, _ = feed([(0, [0.5, 0.0, 0.0])], setting, frame="camera")
    np.testing.assert_allclose(results[0].position, [1.0, 2.5, 3.0], atol=1e-12)
    np.testing.assert_allclose(results[0].orientation, turn, atol=1e-12)
    np.testing.assert_allclose(
        results[0].position_covariance, np.diag([4e-6, 1e-6, 9e-6]), atol=1e-15
    )


def test_single_outlier_is_dropped_and_forgotten():
    samples = walk(20)
    samples[10] = (10, [3.0, 0.2, 0.3])
    results, _ = feed(samples)
    assert reasons(results) == [None] * 10 + ["jump"] + [None] * 9
    clean, _ = feed([s for i, s in enumerate(walk(20)) if i != 10])
    np.testing.assert_array_equal(results[-1].position, clean[-1].position)
    np.testing.assert_array_equal(results[-1].velocity.mean, clean[-1].velocity.mean)


def outliers(count, start):
    generator = np.random.default_rng(0)
    return [(start + i, generator.uniform(-50, 50, 3)) for i in range(count)]


TRACKS = {
    "late and again": (
        [*walk(5), (4, [0.04, 0.2, 0.3]), (2, [0.02, 0.2, 0.3]), *walk(2, 5)],
        [None] * 5 + [LATE] * 2 + [None] * 2,
    ),
    "wild": (walk(20) + outliers(20, 20) + walk(5, 40), [None] * 20 + [JUMP] * 20 + [None] * 5),
    "elsewhere after an occlusion": (walk(10) + walk(10, 70, offset=5.0), [None] * 20),
    "far after a while": ([*walk(10), (20, [0.64, 0.2, 0.3])], [None] * 11),
    "far at once": ([*walk(10), (10, [0.64, 0.2, 0.3])], [None] * 10 + [JUMP]),
    "elsewhere for good": (
        walk(10) + walk(10, 10, offset=2.0),
        [None] * 10 + [JUMP] * 4 + [NEW] + [None] * 5,
    ),
    "an outlier first": ([(0, [9.0] * 3), *walk(10, 1)], [None] + [JUMP] * 4 + [NEW] + [None] * 5),
    "late in no order": (walk(5, 1000) + walk(20)[::-1], [None] * 5 + [LATE] * 20),
    "a clock set back": (walk(5, 1000) + walk(30), [None] * 5 + [LATE] * 9 + [NEW] + [None] * 20),
}


@pytest.mark.parametrize(("samples", "expected"), TRACKS.values(), ids=TRACKS)
def test_what_follows_a_track_is_accepted_or_begins_a_new_one(samples, expected):
    results, _ = feed(samples, replace(DEFAULT, clock_reset_after=10))
    found = reasons(results)
    begun = [k for k, one in enumerate(results) if not found[k] and one.reanchored]
    assert found == [None if why == NEW else why for why in expected]
    assert begun == [k for k, why in enumerate(expected) if why == NEW]
    assert all(results[k].velocity is None for k in begun)


def test_state_is_never_modified():
    _, state = feed(walk(10))
    before = repr(state)
    feed([(10, [9.0, 0.0, 0.0]), (9, [0.0, 0.0, 0.0]), *walk(3, 11)], state=state)
    assert repr(state) == before


numbers = st.one_of(
    st.floats(-2.0, 2.0), st.sampled_from([np.nan, np.inf, -np.inf, 1e308, 5e-324, 1e5])
)
events = st.tuples(
    st.integers(-2, 200), st.lists(numbers, min_size=7, max_size=7), st.sampled_from("ab")
)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.lists(events, max_size=60))
def test_whatever_comes_in_what_goes_out_is_sound(sequence):
    setting = IngestSettings(world_frame="a")
    state, last_ns = IngestState(), 0
    for index, values, frame in sequence:
        position, orientation = np.array(values[:3]), np.array(values[3:])
        before = state
        state, result = ingest_pose(setting, state, index * STEP, position, orientation, frame)
        if isinstance(result, Rejected):
            assert result.reason in REASONS
            assert state.recent == before.recent
            continue
        assert frame == "a"
        assert result.stamp_ns > last_ns
        last_ns = result.stamp_ns
        np.testing.assert_array_equal(result.position, position)
        assert np.linalg.norm(result.orientation) == pytest.approx(1.0)
        assert np.all(np.linalg.eigvalsh(result.position_covariance) > 0)
        if result.velocity is not None:
            assert all(np.all(np.isfinite(part)) for part in result.velocity)


@pytest.mark.parametrize(
    "wrong",
    [
        {"max_speed_m_s": 0.0},
        {"max_gap_s": np.nan},
        {"position_std_m": -1.0},
        {"position_std_m": np.ones(2)},
        {"reanchor_after": 0},
        {"extrinsics": {"camera": ([0, 0, 0], [0, 0, 0, 0])}},
    ],
)
def test_settings_are_checked(wrong):
    with pytest.raises(ArgumentError):
        IngestSettings(**wrong)
