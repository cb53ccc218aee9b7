# SPDX-License-Identifier: Apache-2.0
"""Recognition and prediction from arrays: the same as over a stream, whatever was measured."""

import numpy as np
import pytest
from online_stream import movement

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.filtering import MovementFilter, make_prior_grid, task_posterior
from intent_recognition.filtering.grid import fixed_prior_grid
from intent_recognition.recognition import predict_controlled, recognize_task
from intent_recognition.signals import merge


@pytest.fixture(scope="module")
def recording(truth):
    """A movement of task 1 without rest, and its arrays."""
    rng = np.random.default_rng(11)
    recorded = movement(truth, 1, rng, rest_before_s=0.0, rest_after_s=0.0)
    (signal,) = recorded.observed
    return recorded, signal.seconds(signal.stamps_ns[0]), signal.values


def test_it_is_the_posterior_of_the_bank(library, recording):
    recorded, times_s, human = recording
    half = len(times_s) // 2
    hypotheses = make_prior_grid(library)
    run = MovementFilter(library, hypotheses, recorded.observed[0].stamps_ns[0])
    for observation in list(merge(recorded.observed))[:half]:
        run.observe(observation)
    expected = task_posterior(run.log_evidence, hypotheses, times_s[half - 1] - times_s[0])
    found = recognize_task(library, times_s[:half], human[:half])
    np.testing.assert_allclose(found.probabilities, expected.probabilities, atol=1e-9)
    assert found.task == library.labels[1]
    assert sum(found.task_probabilities.values()) == pytest.approx(1.0)
    predicted = predict_controlled(library, times_s[:half], human[:half])
    expected = run.prediction(1).controlled(50).positions
    np.testing.assert_allclose(predicted.positions, expected, atol=1e-9)


def test_a_known_duration_is_one_hypothesis_per_task(library, recording):
    _, times_s, human = recording
    duration_s = float(times_s[-1] - times_s[0])
    found = recognize_task(library, times_s, human, duration_s=duration_s)
    np.testing.assert_allclose(found.posterior.duration_s, duration_s)
    np.testing.assert_allclose(found.phase, [*[1.0] * library.n_tasks, 0.0])  # as online
    assert fixed_prior_grid(library, duration_s).n_scales == found.posterior.scale_weights.shape[1]


def test_neither_what_was_not_measured_nor_what_came_before_onset_counts(library, recording):
    """NaN equals leaving the sample, or the DOF of a sample, out."""
    _, times_s, human = recording
    gaps = human.copy()
    gaps[1::2] = np.nan
    with_gaps = recognize_task(library, times_s, gaps)
    without = recognize_task(library, times_s[::2], human[::2])
    np.testing.assert_array_equal(with_gaps.log_evidence, without.log_evidence)
    gaps[4:, 0] = np.nan
    assert np.all(np.isfinite(recognize_task(library, times_s, gaps).probabilities))
    onset_s = float(times_s[10])
    early = human.copy()
    early[:10] += 1.0
    found = recognize_task(library, times_s, early, onset_s=onset_s)
    expected = recognize_task(library, times_s[10:], human[10:])
    np.testing.assert_array_equal(found.log_evidence, expected.log_evidence)


def test_the_task_may_be_given_and_the_library_comes_first(library, recording):
    _, times_s, human = recording
    given = predict_controlled(library, times_s, human, task=library.labels[0], n_points=7)
    assert given.positions.shape == (7, library.n_controlled)
    with pytest.raises(ArgumentError, match="one of"):
        predict_controlled(library, times_s, human, task="juggling")
    with pytest.raises(ArgumentError, match="library: expected a TaskLibrary, got one of type"):
        recognize_task(times_s, human, library)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda t, y: (t[:-1], y), ShapeError, "one row per time"),
        (lambda t, y: (t, y[:, :2]), ShapeError, "one column per DOF"),
        (lambda t, y: (t[:0], y[:0]), ShapeError, "one row per time"),
        (lambda t, y: (t[::-1], y), ArgumentError, r"got .* after .* in row 1\. Sort the samples"),
        (lambda t, y: (t, np.full_like(y, np.nan)), ArgumentError, "at least one measured"),
        (lambda t, y: (t, np.full_like(y, np.inf)), ArgumentError, "infinity"),
        (lambda t, y: (t * 1e9 + 1.7e18, y), ArgumentError, "times_s: .* divide them by 1e"),
        (lambda t, y: (t, 1000.0 * y), ArgumentError, "millimetres"),
        (lambda t, y: (1000.0 * t, y), ArgumentError, "milliseconds for seconds"),
        (lambda t, y: (t, ["a"] * len(t)), ShapeError, "human: expected an array of numbers, got"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(library, recording, change, error, message):
    _, times_s, human = recording
    with pytest.raises(error, match=message):
        recognize_task(library, *change(times_s, human))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"onset_s": np.nan}, "onset_s: expected seconds, a finite number"),
        ({"onset_s": "0"}, "onset_s: expected seconds, .* got '0'"),
        ({"duration_s": "2"}, "duration_s: expected a positive number, got 2"),
        ({"duration_s": 0.0}, "duration_s"),
        ({"n_points": 0}, "n_points: expected a whole number from 1 on, got 0"),
    ],
)
def test_options_that_are_none_are_refused(library, recording, options, says):
    _, times_s, human = recording
    with pytest.raises(ArgumentError, match=says):
        predict_controlled(library, times_s, human, **options)
