# SPDX-License-Identifier: Apache-2.0
"""The past of a signal: what is kept, what is late, and which DOFs speak for it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library, simulate

from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.signals.observation import Observation, merge
from intent_recognition.signals.past import History, SignalPast, is_covariance

START_NS = 1_700_000_000_000_000_000
MS = 1_000_000


def seen(at_ms, values=(0.0, 0.0), dofs=None, derivative=False):
    return Observation(
        START_NS + round(at_ms * MS), 0, np.array(values), dofs=dofs, derivative=derivative
    )


@given(st.lists(st.integers(1, 400), min_size=1, max_size=700), st.floats(0.001, 3.0))
def test_a_history_is_what_was_put_into_it(gaps, last_s):
    history, kept = History(2), []
    for k, at_ms in enumerate(np.cumsum(gaps).tolist()):
        history.append(seen(at_ms, (at_ms, -k)))
        kept.append(history.observations[-1])
        history.forget_before(kept[-1].stamp_ns, 2e9)
        kept = [o for o in kept if kept[-1].stamp_ns - o.stamp_ns <= 2e9]
    assert history.observations == kept and len(history) == len(kept)
    samples = history.samples
    assert (samples.first_ns, samples.last_ns) == (kept[0].stamp_ns, kept[-1].stamp_ns)
    for span_s, chosen in (
        (None, kept),
        (last_s, [o for o in kept if o.stamp_ns >= kept[-1].stamp_ns - last_s * 1e9 - 1.0]),
        (0.0, kept[-1:]),
    ):
        times_s, values = samples.arrays(span_s)
        expected = [(o.stamp_ns - chosen[0].stamp_ns) * 1e-9 for o in chosen]
        np.testing.assert_array_equal(times_s, expected)
        np.testing.assert_array_equal(values, [o.values for o in chosen])


def test_each_dof_has_a_time_of_its_own_and_velocities_have_another():
    past = SignalPast(2, 2.0)
    past.add(seen(10, (1.0,), dofs=(0,)))
    assert past.is_late(seen(10, (1.0,), dofs=(0,))) and past.is_late(seen(9))
    assert not past.is_late(seen(5, (1.0,), dofs=(1,)))
    assert not past.is_late(seen(5, derivative=True))
    past.add(seen(5, (1.0,), dofs=(1,)))
    assert past.is_late(seen(10)) and not past.is_late(seen(11))
    past.clear()
    assert not past.is_late(seen(1)) and not list(past.observations())


def test_dofs_that_were_last_seen_long_before_others_do_not_speak():
    past = SignalPast(2, 2.0)
    for at_ms in range(0, 200, 10):
        past.add(seen(at_ms))
    for at_ms in range(200, 900, 10):
        past.add(seen(at_ms, (0.0,), dofs=(1,)))
        past.add(seen(at_ms, (0.0,), dofs=(1,), derivative=True))
        active = past.active_samples(0.3, 0.15)
        assert len(active) == (2 if at_ms <= 490 else 1)
    assert active[0].last_ns == START_NS + 890 * MS
    past.forget_before(START_NS + 2500 * MS)
    assert len(list(past.observations())) == 2 * (900 - 500) // 10


@pytest.mark.parametrize(
    ("matrix", "good"),
    [
        (np.eye(2), True),
        (np.zeros((2, 2)), True),
        (-np.eye(2), False),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), False),
        (np.array([[1.0, 0.5], [0.0, 1.0]]), False),
        (np.full((2, 2), np.nan), False),
    ],
)
def test_a_covariance_is_looked_at_until_it_is_known(matrix, good):
    past = SignalPast(2, 2.0)
    assert is_covariance(matrix) == past.is_covariance(matrix) == past.is_covariance(matrix) == good
    assert past.is_covariance(np.eye(2)) and past.is_covariance(matrix) == good


def recorded(seed=3):
    library = make_library(np.random.default_rng(5), groups=(2, 1), noise_std=0.001)
    recording = simulate(
        library, 1, np.random.default_rng(seed), rest_before_s=0.8, rest_after_s=0.8
    )
    return library, list(merge(recording.observed))


def test_a_dof_missing_from_the_start_is_not_needed_to_see_a_movement():
    library, observations = recorded()
    partly = [
        o._replace(values=o.values[1:], dofs=(1,)) if o.group == 0 else o for o in observations
    ]
    estimator = IntentEstimator(library)
    moving = []
    for observation in partly:
        assert estimator.reason_to_reject(observation) is None
        estimate = estimator.update(observation)
        if estimate.moving:
            moving.append(estimate)
    assert np.argmax(moving[-1].probabilities) == 1
    assert not estimate.moving  # and its end


def moving(library, observations):
    """Stamp and onset of each estimate of a movement."""
    estimator, found = IntentEstimator(library), []
    for observation in observations:
        assert estimator.reason_to_reject(observation) is None
        estimate = estimator.update(observation)
        found += [(estimate.stamp_ns, estimate.onset_ns)] * estimate.moving
    return found


@pytest.mark.slow
def test_a_dof_that_flickers_hides_neither_onset_nor_end_of_the_movement():
    library, observations = recorded()
    whole = moving(library, observations)
    for off, period in ((1, 2), (10, 15)):
        flickering = [
            o._replace(values=o.values[1:], dofs=(1,)) if o.group == 0 and k % period < off else o
            for k, o in enumerate(observations)
        ]
        found = moving(library, flickering)
        for ours, theirs in zip(whole, found, strict=False):
            assert abs(ours[1] - theirs[1]) < 100 * MS
        assert abs(whole[-1][0] - found[-1][0]) < 200 * MS < whole[-1][0] - whole[0][0]


def test_velocities_without_a_covariance_are_refused():
    library, observations = recorded()
    estimator = IntentEstimator(library)
    rate = observations[0]._replace(derivative=True)
    assert estimator.reason_to_reject(rate) == "no_covariance"
    assert estimator.reason_to_reject(rate._replace(covariance=np.eye(len(rate.values)))) is None
