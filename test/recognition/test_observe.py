# SPDX-License-Identifier: Apache-2.0
"""The estimator fed with seconds and arrays."""

import numpy as np
import pytest
from online_stream import episodes, feed, going_back, learned, movement, same, shifted
from simulation import START_NS, make_library

from intent_recognition.errors import ArgumentError, IntentError, ShapeError
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.recognition.estimator import CLOCK_RESET_AFTER, IntentEstimator
from intent_recognition.signals.observation import Observation, merge

SINGULAR = np.diag([1.0, 1.0, 0.0])


@pytest.mark.slow
def test_seconds_and_arrays_give_what_observations_give(library, truth, rng):
    """On a clock that begins before zero, too."""
    observations = list(merge(movement(truth, 0, rng).observed))
    expected = feed(IntentEstimator(library), observations)
    estimator = IntentEstimator(library)
    for observation, estimate in zip(observations, expected, strict=True):
        stamp_ns = observation.stamp_ns - START_NS - 1_000_000_000
        found = estimator.observe(stamp_ns * 1e-9, observation.values.tolist())
        onset_ns = found.onset_ns + START_NS + 1_000_000_000 if found.moving else 0
        same(found._replace(stamp_ns=observation.stamp_ns, onset_ns=onset_ns), estimate, 1e-9)
        assert found.task_probabilities[found.task] == found.probabilities.max()
        assert sum(found.task_probabilities.values()) == pytest.approx(1.0)
    assert any(estimate.task == library.labels[0] for estimate in expected)
    assert expected[0].task == "none"


def test_some_dofs_and_a_covariance_or_nothing_may_be_measured(library):
    estimator = IntentEstimator(library)
    estimator.observe(0.0, [0.1, 0.2], dofs=[2, 0], covariance=1e-6 * np.eye(2))
    estimator.observe(0.0, [0.1], dofs=[1])
    with pytest.raises(ArgumentError, match="later than the last"):
        estimator.observe(0.0, [0.1], dofs=[0])
    with pytest.raises(ArgumentError, match="an Observation, got one of type list"):
        estimator.update([0.1])
    estimator = IntentEstimator(library)
    assert not estimator.observe(1.0, [np.nan] * 3).moving
    estimator.observe(0.5, np.zeros(3))


@pytest.mark.slow
def test_what_is_nan_was_not_measured(library, truth, rng):
    """As in `recognize_task`: to the last bit as if it had not been passed."""
    (signal,) = movement(truth, 0, rng).observed
    some, with_nan = IntentEstimator(library), IntentEstimator(library)
    covariance = np.diag([1e-6, 2e-6, np.nan])
    moving, partly_seen = False, 0
    samples = enumerate(zip(signal.seconds(START_NS), signal.values.tolist(), strict=True))
    for row, (stamp_s, (x, y, z)) in samples:
        if row % 4 == 0 or not moving:
            expected = some.observe(stamp_s, [x, y, z])
            found = with_nan.observe(stamp_s, [x, y, z])
        elif row % 4 == 1:
            expected = some.observe(stamp_s, [x, y], dofs=[0, 1], covariance=covariance[:2, :2])
            found = with_nan.observe(stamp_s, [x, y, np.nan], covariance=covariance)
        elif row % 4 == 2:
            expected = some.observe(stamp_s, [x], dofs=[0])
            found = with_nan.observe(stamp_s, [np.nan, x], dofs=[2, 0])
        else:
            found = with_nan.observe(stamp_s, [np.nan] * 3)
            partly_seen += 1
        same(found, expected)
        moving = expected.moving
    assert partly_seen > 10


@pytest.mark.parametrize(
    ("stamp_s", "values", "options", "error", "says"),
    [
        (1.0, [0.0, 0.0], {}, ShapeError, r"values: expected shape \(3,\)"),
        (1.0, "abc", {}, ShapeError, "values: expected an array of numbers"),
        (1.0, [0.0], {"dofs": "x"}, ArgumentError, "dofs: expected different numbers from 0 to 2"),
        (1.0, [[0.0, 0.0, 0.0]], {}, ShapeError, r"values: expected shape \(3,\)"),
        (1.0, [0.0], {"dofs": [0, 1]}, ShapeError, r"values: expected shape \(2,\)"),
        (1.0, [0.0, np.inf, 0.0], {}, ArgumentError, "values: expected finite"),
        (1.0, [0.0, np.nan], {}, ShapeError, r"values: expected shape \(3,\)"),
        (0.5, [np.nan, 0.0, 0.0], {}, ArgumentError, "stamp_s: expected a stamp later"),
        (np.nan, [0.0, 0.0, 0.0], {}, ArgumentError, "stamp_s: expected seconds, a finite"),
        (0.5, [0.0, 0.0, 0.0], {}, ArgumentError, "stamp_s: expected a stamp later"),
        ([1.0], [0.0, 0.0, 0.0], {}, ArgumentError, "stamp_s: expected seconds"),
        ("now", [0.0, 0.0, 0.0], {}, ArgumentError, "stamp_s: expected seconds.* got 'now'"),
        (1.0, [0.0, 0.0, 0.0], {"covariance": np.eye(2)}, ArgumentError, "covariance"),
        (1.0, [0.0, 0.0, 0.0], {"covariance": -np.eye(3)}, ArgumentError, "covariance"),
        (1.0, [0.0, 0.0, 0.0], {"signal": 1}, ArgumentError, "signal: expected a whole number"),
        (1.0, [0.0, 0.0, 0.0], {"signal": -1}, ArgumentError, "signal: expected a whole number"),
        (1.0, [0.0], {"dofs": [3]}, ArgumentError, "dofs: expected different numbers"),
        (1.0, [0.0, 0.0], {"dofs": [1, 1]}, ArgumentError, "dofs: expected different numbers"),
        (1.0, [], {"dofs": []}, ArgumentError, "dofs: expected different numbers"),
    ],
)
def test_what_cannot_be_used_changes_nothing(library, stamp_s, values, options, error, says):
    estimator = IntentEstimator(library)
    estimator.observe(0.5, np.zeros(3))
    with pytest.raises(error, match=says):
        estimator.observe(stamp_s, values, **options)
    estimator.observe(0.6, np.zeros(3))


def test_a_clock_that_was_set_back_is_followed_after_a_while(library):
    estimator = IntentEstimator(library)
    estimator.observe(1000.0, np.zeros(3))
    refused = 0
    for step in range(CLOCK_RESET_AFTER + 1):
        try:
            estimator.observe(0.01 * step, np.zeros(3))
        except IntentError:
            refused += 1
    assert refused == CLOCK_RESET_AFTER - 1


def test_the_robot_may_be_observed_with_arrays(library, truth, rng):
    """Its posture at onset conditions the trajectory; see test_start_posture."""
    estimator = IntentEstimator(library)
    recorded = movement(truth, 0, rng)
    estimator.observe_controlled(-1e-6, recorded.controlled[0].values[0])
    for observation in merge(recorded.observed):
        stamp_s = (observation.stamp_ns - START_NS) * 1e-9
        estimator.observe_controlled(stamp_s, recorded.controlled[0].values[0])
        estimate = estimator.observe(stamp_s, observation.values)
        if estimate.moving and estimate.task != "none":
            break
    assert estimator.predict_controlled().start == "used"
    with pytest.raises(ShapeError):
        estimator.observe_controlled(stamp_s + 1.0, np.zeros(7))
    with pytest.raises(ArgumentError, match="finite"):
        estimator.observe_controlled(stamp_s + 1.0, [np.nan, 0.0])
    with pytest.raises(ArgumentError, match="later than the last"):
        estimator.observe_controlled(stamp_s, [0.0, 0.0])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"task_prior": np.ones(9) / 9}, "task_prior: expected . probabilities that sum to one"),
        ({"task_prior": [2.0, -1.0, 0.0]}, "task_prior: expected"),
        ({"n_scales": 0}, "n_scales: expected a whole number from 1 on, got 0"),
    ],
)
def test_a_prior_that_is_none_is_refused(library, options, says):
    with pytest.raises(ArgumentError, match=says):
        IntentEstimator(library, **options)


def test_a_movement_that_never_ends_does_not_keep_the_estimator(library):
    """Running on past its task it is given up, and the memory with it."""
    times = np.arange(0.0, 30.0, 0.02)
    values = 0.3 * np.stack([np.sin(3 * times), np.cos(3 * times), np.sin(2 * times)], axis=1)
    estimator = IntentEstimator(library)
    stream = [
        Observation(START_NS + round(t * 1e9), 0, v) for t, v in zip(times, values, strict=True)
    ]
    estimates = feed(estimator, stream)
    assert not estimates[-1].moving
    assert all((e.stamp_ns - e.onset_ns) * 1e-9 < 10.0 for e in estimates if e.moving)
    estimator.swap(library)  # before a rest
    feed(estimator, shifted(stream[:30], 30.0))
    assert not estimator._movements._after_stop


@pytest.mark.parametrize(
    ("observation", "reason"),
    [
        (Observation(START_NS, 0, np.zeros(2)), "wrong_size"),
        (Observation(START_NS, 0, np.zeros((1, 3))), "wrong_size"),
        (Observation(START_NS, 0, np.array([0.0, np.nan, 0.0])), "not_finite"),
        (Observation(START_NS, 0, np.array([0.0, np.inf, 0.0])), "not_finite"),
        (Observation(START_NS, 0, np.array([0.0, -1e13, 0.0])), "not_finite"),
        (Observation(0, 0, np.zeros(3)), "zero_stamp"),
        (Observation(-5, 0, np.zeros(3)), "zero_stamp"),
        (Observation(START_NS, 0, np.zeros(3), np.full((3, 3), np.nan)), "bad_covariance"),
        (Observation(START_NS, 0, np.zeros(3), np.eye(2)), "bad_covariance"),
        (Observation(START_NS, 0, np.zeros(3), -np.eye(3)), "bad_covariance"),
        (Observation(START_NS, 0, np.zeros(3), np.triu(np.ones((3, 3)))), "bad_covariance"),
        (Observation(START_NS, 0, np.zeros(3), SINGULAR, derivative=True), "bad_covariance"),
        (Observation(START_NS, 0, np.zeros(3), SINGULAR), None),
        (Observation(START_NS, 0, np.zeros(3), np.zeros((3, 3))), None),
        (Observation(START_NS, 0, np.zeros(3), np.eye(3)), None),
    ],
)
def test_unusable_observations_are_told_by_reason(library, observation, reason):
    assert IntentEstimator(library).reason_to_reject(observation) == reason


@pytest.mark.parametrize("take", ["update", "reason_to_reject", "update_controlled"])
def test_an_observation_of_no_dof_is_refused(library, take):
    with pytest.raises(ArgumentError, match="a DOF, or None for all"):
        getattr(IntentEstimator(library), take)(Observation(START_NS, 0, np.zeros(0), dofs=()))


def test_stamps_must_increase_within_a_signal_however_long_it_was_silent(rng):
    library = make_library(rng, groups=(2, 1), n_basis=4)
    estimator = IntentEstimator(library)
    estimator.update(Observation(START_NS + 100, 0, np.zeros(2)))
    for stamp in (START_NS + 100, START_NS + 99):
        again = Observation(stamp, 0, np.zeros(2))
        assert estimator.reason_to_reject(again) == "stamp_not_increasing"
    assert estimator.reason_to_reject(Observation(START_NS + 99, 1, np.zeros(1))) is None
    assert estimator.reason_to_reject(Observation(START_NS + 101, 0, np.zeros(2))) is None
    estimator = IntentEstimator(library)
    silent = Observation(START_NS, 1, np.zeros(1))
    estimator.update(silent)
    for step in range(300):
        estimator.update(Observation(START_NS + step * 20_000_000, 0, np.zeros(2)))
    assert estimator.reason_to_reject(silent) == "stamp_not_increasing"


def lost_marker(truth: TaskLibrary, rng) -> tuple[list[Observation], list[Observation]]:
    """A movement in which the second tracker dies half-way for good, and one after it."""
    first = movement(truth, 0, rng, duration_s=2.0, rest_after_s=3.0)
    second = movement(truth, 1, rng, duration_s=2.0, rest_before_s=1.5)
    dies = START_NS + round(1.8e9)
    before = [o for o in merge(first.observed) if o.group == 0 or o.stamp_ns < dies]
    later = [o for o in merge(second.observed) if o.group == 0]
    before += going_back(before[-1], later[0].values)
    return before, shifted(later, (before[-1].stamp_ns - START_NS) * 1e-9 + 0.02)


@pytest.mark.slow
def test_a_tracker_lost_in_mid_movement_does_not_block_the_next_one(rng):
    truth = make_library(rng, groups=(2, 1), n_basis=8, spread=0.03, noise_std=0.001)
    estimator = IntentEstimator(learned(truth))
    before, later = lost_marker(truth, rng)
    assert not feed(estimator, before)[-1].moving
    episode = max(episodes(feed(estimator, later)), key=len)
    assert int(np.argmax(episode[len(episode) // 2].probabilities)) == 1
    expected = later[0].stamp_ns + round(1.5e9)
    assert abs(episode[0].onset_ns - expected) < 0.3e9
