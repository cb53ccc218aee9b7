# SPDX-License-Identifier: Apache-2.0
"""A context while the estimator runs: known before, late, never, in part, and changed."""

from dataclasses import replace

import numpy as np
import pytest
from moved_box import hand_over, learned

from intent_recognition.errors import ArgumentError, DofError, ShapeError
from intent_recognition.learning import add_demonstration
from intent_recognition.recognition import IntentEstimator
from intent_recognition.recognition.context import CONTEXT_PERIOD_S, CONTEXT_SHARE
from intent_recognition.recognition.observed import context_misfit
from intent_recognition.signals import CLOCK_RESET_AFTER, Observation, merge, recording_doubts

BOX = np.array([0.2, -0.15])


def feed(estimator, recorded, at=None, then=lambda: None):
    """All estimates; `then` is called before the observation of a number."""
    found = []
    for number, observation in enumerate(merge(recorded.observed)):
        if number == at:
            then()
        found.append(estimator.update(observation))
        if found[-1].moving and (predicted := estimator.predict_controlled()) is not None:
            estimator.last = predicted.trajectory
    return found


def assert_same(estimates, others, atol=1e-9):
    for one, other in zip(estimates, others, strict=True):
        for name in ("stamp_ns", "moving", "onset_ns"):
            assert getattr(one, name) == getattr(other, name)
        np.testing.assert_allclose(one.probabilities, other.probabilities, atol=atol)
        np.testing.assert_allclose(one.phase, other.phase, atol=atol)


@pytest.fixture(scope="module")
def library():
    return learned().library


@pytest.fixture(scope="module")
def recorded():
    return hand_over("give", 200, box=BOX)


@pytest.fixture(scope="module")
def in_context(library, recorded):
    """The estimator that was given the library in this context."""
    estimator = IntentEstimator(library.given(BOX))
    return estimator, feed(estimator, recorded)


@pytest.mark.parametrize("factor", [1000.0, 100.0])
def test_a_context_in_another_unit_is_refused_with_the_factor(factor, library):
    estimator = IntentEstimator(library)
    with pytest.raises(ArgumentError, match=f"factor of {factor:.0f}"):
        estimator.observe_context(factor * BOX)
    assert estimator.update_context(Observation(10**9, 0, factor * BOX)) == "unit"
    assert f"{factor:.0f}" in estimator.first_samples.misfit.reason
    assert np.isnan(estimator._context.values).all()
    estimator.observe_context(10.0 * BOX)  # far away, in metres
    in_part = np.array([factor * BOX[0], np.nan])
    assert estimator.update_context(Observation(2 * 10**9, 0, in_part)) == "unit"


@pytest.mark.parametrize("std", [0.25, 1e-3])
def test_contexts_are_expected_within_three_deviations_or_half_their_size(library, std):
    mean, covariance = np.array([[1.0, 1.0], [1.2, 1.0]]), std**2 * np.tile(np.eye(2), (2, 1, 1))
    model = replace(library.context, mean=mean, covariance=covariance)
    around = max(3.0 * std, 0.5 * 1.2)
    found = context_misfit(model, np.array([1100.0, 1000.0]))
    assert f"between {1.0 - around:.3g} and {1.2 + around:.3g} m" in found.reason
    assert context_misfit(model, np.array([1.2 + around, np.nan])) is None


def test_a_context_in_millimetres_is_named_in_a_recording(recorded):
    assert not any("factor" in text for text in recording_doubts(recorded))
    (box,) = recorded.context
    in_mm = replace(recorded, context=(replace(box, values=1000.0 * box.values),))
    (said,) = [text for text in recording_doubts(in_mm) if "factor" in text]
    assert said.startswith("box/pose") and "is 250 m from the origin of its frame" in said
    assert "Likely millimetres" in said


def test_a_context_known_before_or_never_is_that_of_the_library(library, recorded, in_context):
    estimator = IntentEstimator(library)
    estimator.observe_context(BOX)
    assert_same(feed(estimator, recorded), in_context[1])
    np.testing.assert_allclose(estimator.last.positions, in_context[0].last.positions, atol=1e-9)
    np.testing.assert_allclose(estimator.last.std, in_context[0].last.std, atol=1e-9)
    without = IntentEstimator(replace(library, context=None))
    assert_same(feed(IntentEstimator(library), recorded), feed(without, recorded), atol=0.0)


def test_a_late_context_counts_as_if_known_before(library, recorded, in_context):
    at = 70
    estimator, never = IntentEstimator(library), IntentEstimator(library)
    found = feed(estimator, recorded, at, lambda: estimator.observe_context(BOX))
    assert_same(found[:at], feed(never, recorded)[:at], atol=0.0)
    assert_same(found[at:], in_context[1][at:])
    np.testing.assert_allclose(estimator.last.positions, in_context[0].last.positions, atol=1e-9)


def test_a_context_counts_in_part_and_stays_known_after_a_reset(library, recorded):
    estimator = IntentEstimator(library)
    assert estimator.update_context(Observation(1, 0, BOX[1:], dofs=(1,))) is None
    assert estimator.update_context(Observation(2, 0, np.array([np.nan, np.nan]))) is None
    expected = feed(IntentEstimator(library.given([np.nan, BOX[1]])), recorded)
    assert_same(feed(estimator, recorded), expected)
    estimator = IntentEstimator(library)
    estimator.observe_context(BOX)
    first = feed(estimator, recorded)
    estimator.reset()
    assert_same(feed(estimator, recorded), first)


@pytest.mark.slow
def test_noise_of_a_context_is_not_filtered_anew_and_a_carried_thing_seldom(library, recorded):
    estimator = IntentEstimator(library)
    used, still = [], library.context.tolerance * 0.4
    for number, observation in enumerate(merge(recorded.observed)):
        shift = still * (-1) ** number if number < 80 else 0.02 * (number - 80)
        sample = Observation(observation.stamp_ns, 0, BOX + shift)
        assert estimator.update_context(sample) is None
        moving = estimator.update(observation).moving
        if moving and (not used or estimator.library is not used[-1][1]):
            used.append((observation.stamp_ns, estimator.library))
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in used])
    so_far_ns = stamps_ns[1:] - feed(IntentEstimator(library), recorded)[100].onset_ns
    least_ns = np.maximum(CONTEXT_PERIOD_S * 1e9, CONTEXT_SHARE * so_far_ns)
    assert len(used) > 2 and np.all(np.diff(stamps_ns) >= least_ns)
    assert np.all(np.diff(stamps_ns)[1:] < least_ns[1:] + 3e7)  # while it moves: no later
    assert sum(stamp_ns < recorded.start_ns + 1.6e9 for stamp_ns, _ in used) == 1


def test_samples_that_are_no_context_are_refused_by_reason(library):
    estimator = IntentEstimator(library)
    assert estimator.update_context(Observation(0, 0, BOX)) == "zero_stamp"
    assert estimator.update_context(Observation(5, 1, BOX)) == "no_context"
    assert estimator.update_context(Observation(5, 0, BOX[:1])) == "wrong_size"
    assert estimator.update_context(Observation(5, 0, np.array([0.0, np.inf]))) == "not_finite"
    for _ in range(2):  # the same sample may come twice
        assert estimator.update_context(Observation(5, 0, BOX)) is None
    assert estimator.update_context(Observation(4, 0, BOX)) == "stamp_not_increasing"
    estimator.reset()
    assert estimator.update_context(Observation(4, 0, BOX)) is None
    plain = IntentEstimator(replace(library, context=None))
    assert plain.update_context(Observation(5, 0, BOX)) == "no_context"
    with pytest.raises(ShapeError, match="no context was learned"):
        plain.observe_context(BOX)


@pytest.mark.slow
def test_another_library_is_used_in_the_same_context(library, recorded):
    more = add_demonstration(learned(), hand_over("give", 70)).library
    estimator = IntentEstimator(library)
    estimator.observe_context(BOX)
    found = feed(estimator, recorded, 60, lambda: estimator.swap(more))
    assert_same(found[60:], feed(IntentEstimator(more.given(BOX)), recorded)[60:])
    with pytest.raises(DofError, match="library context_names"):
        estimator.swap(replace(library, context=None))


def test_one_stamp_in_the_future_is_forgotten_after_a_while(library):
    """If none that is not late comes between."""
    estimator, ahead_ns, n = IntentEstimator(library), 3_600_000_000_000, CLOCK_RESET_AFTER
    for number, (n_late, n_taken) in enumerate(((n - 1, 0), (n, 1))):
        assert estimator.update_context(Observation(ahead_ns + number, 0, BOX)) is None
        late = (Observation(10**9 + n * number + k, 0, -BOX) for k in range(n_late))
        assert [estimator.update_context(one) is None for one in late].count(True) == n_taken
    np.testing.assert_array_equal(estimator._context.values, -BOX)
