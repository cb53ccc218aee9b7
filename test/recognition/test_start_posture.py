# SPDX-License-Identifier: Apache-2.0
"""The controlled agent's posture at onset: chosen by stamp, tested against the trained starts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest
from simulation import draw_weights, make_library, simulate

from intent_recognition.promp import StartPosture, controlled_weights, rollout
from intent_recognition.recognition import POSTURE_OUTSIDE, POSTURE_UNKNOWN, start_mean
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.start_posture import (
    POSTURE_USED,
    PostureHistory,
    start_distance,
    start_variance,
    within_trained_starts,
)
from intent_recognition.signals import CLOCK_RESET_AFTER, Observation, merge

MS = 1_000_000


@pytest.fixture(scope="module")
def library():
    return make_library(np.random.default_rng(5), spread=0.03, noise_std=0.001)


def history(*samples):
    taken = PostureHistory()
    for stamp_ms, group, values in samples:
        assert taken.take(stamp_ms * MS, group, np.array(values)) is None
    return taken


def test_the_newest_sample_not_after_the_stamp_is_taken_whatever_arrived_since():
    taken = history((100, 0, [1.0]), (110, 0, [2.0]), (120, 0, [3.0]))
    for stamp_ms, expected in ((100, 1.0), (109, 1.0), (110, 2.0), (119, 2.0), (360, 3.0)):
        assert taken.at(stamp_ms * MS) == expected
    assert taken.at(99 * MS) is None and taken.at(371 * MS) is None
    assert taken.passed(120 * MS) and not taken.passed(121 * MS)


def test_signals_are_joined_in_order_and_bad_samples_refused_with_the_reason():
    taken = history((100, 1, [2.0, 3.0]))
    assert taken.at(100 * MS) is None
    assert taken.take(95 * MS, 0, np.array([1.0])) is None
    np.testing.assert_array_equal(taken.at(100 * MS), [1.0, 2.0, 3.0])
    assert not taken.passed(100 * MS)
    taken = history((100, 0, [1.0]))
    assert taken.take(110 * MS, 0, np.array([np.nan])) == "not_finite"
    assert taken.take(100 * MS, 0, np.array([5.0])) == "stamp_not_increasing"
    assert taken.at(110 * MS) == 1.0
    taken = history((100, 0, [1.0]), (3_600_000, 0, [2.0]))
    reasons = [taken.take((110 + k) * MS, 0, np.array([3.0])) for k in range(CLOCK_RESET_AFTER)]
    assert reasons == [*["stamp_not_increasing"] * (CLOCK_RESET_AFTER - 1), None]
    assert taken.at(200 * MS) == 3.0


def test_it_is_known_however_late_somebody_asks_and_a_sample_has_a_stamp(library, recording):
    """The past that is kept is over by then."""
    estimator = begun(library, recording, start_mean(library, 1))
    stamp_ns = recording.start_ns + 10_000 * MS
    assert estimator.update_controlled(Observation(stamp_ns, 0, np.ones(2))) is None
    assert estimator.predict_controlled().start == "used"
    estimator = IntentEstimator(library)
    assert estimator.update_controlled(Observation(0, 0, np.zeros(2))) == "zero_stamp"


def test_the_distance_of_starts_is_chi_square_and_the_mean_start_within(library, rng):
    row = library.basis.design_matrix(np.zeros(1))[0]
    noise = np.sqrt(library.control_noise_variance() + start_variance(library))
    distances = []
    for _ in range(2000):
        weights = draw_weights(library, 1, rng)[library.n_observed :]
        start = weights @ row + noise * rng.normal(size=library.n_controlled)
        distances.append(start_distance(library, 1, start))
    assert kstest(distances, chi2(library.n_controlled).cdf).pvalue > 0.01
    assert np.mean(np.array(distances) <= chi2.ppf(0.999, 2)) > 0.996
    for task in range(library.n_tasks):
        start = start_mean(library, task)
        assert start_distance(library, task, start) < 1e-9
        assert within_trained_starts(library, task, start)
        assert not within_trained_starts(library, task, start + 1.0)


# Online


def run(library, recording, *, controlled=(), **options):
    estimator = IntentEstimator(library, **options)
    estimates, predictions = [], []
    for sample in controlled:
        assert estimator.update_controlled(sample) is None
    for observation in merge(recording.observed):
        estimates.append(estimator.update(observation))
        predictions.append(estimator.predict_controlled(20))
    return estimates, predictions


def steady(library, recording, position):
    """The arm stands there from the beginning to the end of the recording."""
    stamps = np.arange(recording.start_ns, recording.end_ns, 10 * MS)[:350]
    return [Observation(int(s), 0, np.asarray(position)) for s in stamps]


def begun(library, recording, start):
    """An estimator amid the movement, of which the arm waits at the start."""
    estimator = IntentEstimator(library)
    for sample in steady(library, recording, start):
        estimator.update_controlled(sample)
    for observation in list(merge(recording.observed))[:110]:
        estimator.update(observation)
    return estimator


@pytest.fixture(scope="module")
def recording(library):
    rng = np.random.default_rng(7)
    return simulate(library, 1, rng, rest_before_s=0.8, rest_after_s=0.2, duration_s=2.0)


@pytest.fixture(scope="module")
def alone(library, recording):
    """Estimates and predictions that know nothing of the arm."""
    return run(library, recording)


@pytest.mark.slow
def test_it_conditions_the_trajectory_and_never_the_evidence(library, recording, alone):
    start = start_mean(library, 1) + np.array([0.004, -0.003])
    plain, without = alone
    known, conditioned = run(library, recording, controlled=steady(library, recording, start))
    met = 0
    for a, b, p, q in zip(plain, known, without, conditioned, strict=True):
        np.testing.assert_array_equal(a.probabilities, b.probabilities)
        np.testing.assert_array_equal(a.log_evidence, b.log_evidence)
        if p is None:
            assert q is None
            continue
        assert (p.start, q.start) == (POSTURE_UNKNOWN, POSTURE_USED)
        if p.task == "task_1":
            met += 1
            assert np.all(q.trajectory.std <= p.trajectory.std + 1e-12)
            before = np.abs(p.trajectory.positions[0] - start)
            assert np.all(np.abs(q.trajectory.positions[0] - start) <= before + 2e-3)
    assert met > 50


def test_it_equals_conditioning_by_hand(library, recording):
    start = start_mean(library, 1) + 0.005
    estimator = begun(library, recording, start)
    prediction = estimator.predict_controlled(21)
    task = library.labels.index(prediction.task)
    run = estimator._movements.run.prediction(task)
    weights = controlled_weights(
        library, task, run.observed_weights(), StartPosture(start, start_variance(library))
    )
    expected = rollout(
        library.basis,
        weights,
        np.linspace(0.0, 1.0, 21),
        run.duration_s,
        library.control_noise_variance(),
    )
    np.testing.assert_allclose(prediction.trajectory.positions, expected.positions, atol=1e-12)
    end_std = expected.std[-1].max()
    assert estimator.predicted_end_std() == {"rad": pytest.approx(end_std, rel=1e-9)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("away", "options", "says"),
    [(0.5, {}, POSTURE_OUTSIDE), (0.01, {"start_posture": False}, POSTURE_UNKNOWN)],
)
def test_outside_or_switched_off_it_changes_nothing(library, recording, alone, away, options, says):
    arm = steady(library, recording, start_mean(library, 1) + away)
    _, found = run(library, recording, controlled=arm, **options)
    for p, q in zip(alone[1], found, strict=True):
        assert (p is None) == (q is None)
        if p is not None:
            np.testing.assert_array_equal(p.trajectory.positions, q.trajectory.positions)
            assert q.start == says


def test_another_library_has_other_starts(library, recording):
    estimator = begun(library, recording, start_mean(library, 1))
    assert estimator.predict_controlled().start == POSTURE_USED
    size = library.n_observed_weights
    moved = library.weight_mean.copy()
    moved[:, size:] += 0.5
    estimator.swap(replace(library, weight_mean=moved))
    assert estimator.predict_controlled().start == POSTURE_OUTSIDE
