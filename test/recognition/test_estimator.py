# SPDX-License-Identifier: Apache-2.0
"""The online estimator as a whole: recognises, predicts, ends, begins again, swaps, resets."""

from dataclasses import replace

import numpy as np
import pytest
from online_stream import episodes, feed, follow, movement, same, shifted
from plain import run_bank
from simulation import START_NS, make_library, minimum_jerk

from intent_recognition.errors import ArgumentError, DofError, IntentError
from intent_recognition.filtering import make_prior_grid, task_posterior
from intent_recognition.plans import WorkProgress, read_plan
from intent_recognition.plans.work_plan import WorkPlan, WorkStep
from intent_recognition.promp import TaskLibrary, controlled_at
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.transitions import HABIT_TRUST
from intent_recognition.signals.observation import Observation, merge


def test_the_estimate_equals_the_bank_run_from_onset(library, truth, rng):
    """No observation since onset is lost, none before it is used."""
    observations = list(merge(movement(truth, 2, rng).observed))
    estimates = feed(IntentEstimator(library, switching=False), observations)
    hypotheses = make_prior_grid(library)
    for estimate in max(episodes(estimates), key=len)[::20]:
        used = [o for o in observations if estimate.onset_ns <= o.stamp_ns <= estimate.stamp_ns]
        bank = run_bank(library, hypotheses, used, estimate.onset_ns)
        elapsed = (estimate.stamp_ns - estimate.onset_ns) * 1e-9
        expected = task_posterior(bank.log_evidence, hypotheses, elapsed)
        np.testing.assert_allclose(estimate.probabilities, expected.probabilities, atol=1e-12)
        seen = expected.probabilities > 1e-15  # the others were pruned
        known = seen[:-1]
        np.testing.assert_allclose(
            estimate.phase[:-1][known], expected.phase[:-1][known], atol=1e-12
        )
        np.testing.assert_allclose(
            estimate.log_evidence[seen], expected.log_evidence[seen], rtol=1e-12
        )


def test_between_used_observations_the_phase_goes_on(library, truth, rng):
    """The estimate after an observation that is not used equals the posterior at its time.

    The prediction is the same object, by which a publisher sees that it has not changed.
    """
    observations = list(merge(movement(truth, 2, rng).observed))
    estimator = IntentEstimator(library)
    n_used, unused, predicted = 0, 0, None
    for observation in observations:
        estimate = estimator.update(observation)
        if not estimate.moving:
            continue
        run, before = estimator._movements.run, predicted
        predicted = estimator.predict_controlled()
        assert (predicted is before) == (run.n_used == n_used)
        unused, n_used = unused + (run.n_used == n_used), run.n_used
        elapsed_s = (observation.stamp_ns - estimate.onset_ns) * 1e-9
        expected = task_posterior(
            run.log_evidence, run.grid, elapsed_s, run.births.table.rows, run.births.log_stay
        )
        np.testing.assert_allclose(estimate.phase[:-1], expected.phase[:-1], atol=1e-12)
        np.testing.assert_allclose(estimate.probabilities, expected.probabilities, atol=1e-12)
    assert unused > 20 and n_used > 20


def test_at_rest_the_controlled_agent_is_where_the_tasks_begin(library):
    found = IntentEstimator(library).predict_controlled_at([0.0, 5.0, -1.0])
    prior = library.task_prior
    starts = [controlled_at(library, k, 0.0) for k in range(library.n_tasks)]
    mean = sum(p * one.mean for p, one in zip(prior, starts, strict=True))
    noise = library.control_noise_variance()
    square = sum(
        p * (np.diag(one.covariance) + noise + one.mean**2)
        for p, one in zip(prior, starts, strict=True)
    )
    np.testing.assert_allclose(found.positions, np.tile(mean, (3, 1)), atol=1e-9)
    np.testing.assert_allclose(found.std, np.tile(np.sqrt(square - mean**2), (3, 1)), atol=1e-7)
    np.testing.assert_array_equal(found.times_s, [0.0, 5.0, -1.0])
    assert not found.velocities.any()


def test_poses_at_stamps_are_those_of_all_tasks_together(library, truth, rng):
    estimator = IntentEstimator(library)
    estimate, _ = follow(estimator, merge(movement(truth, 1, rng).observed), 0.7)
    onset_s, known = estimate.onset_ns * 1e-9, estimate.probabilities[:-1]
    ahead_s = np.array([0.0, 0.4, 0.9])
    found = estimator.predict_controlled_at(onset_s + ahead_s)
    moments = [estimator._movements.run.prediction(k).mixture_at(ahead_s) for k in range(3)]
    mean = sum(p * one[0] for p, one in zip(known / known.sum(), moments, strict=True))
    np.testing.assert_allclose(found.positions, mean, atol=1e-3 * np.abs(mean).max())
    one = estimator.predict_controlled_at(onset_s + 0.4)
    np.testing.assert_allclose(one.positions, found.positions[1:2], atol=1e-9)
    grid = estimator.predict_controlled_at(onset_s + 0.4 + np.array([-0.01, 0.01]))
    slope = (grid.positions[1] - grid.positions[0]) / 0.02
    np.testing.assert_allclose(found.velocities[1], slope, atol=0.02 * np.abs(slope).max())


@pytest.mark.parametrize("times", [[[0.0]], [np.nan], ["soon"]])
def test_times_that_are_none_are_refused(library, times):
    with pytest.raises(IntentError, match="times_s"):
        IntentEstimator(library).predict_controlled_at(times)


def test_asynchronous_signals_equal_the_joint_filter_whatever_order_they_arrive_in(rng):
    """Two trackers with stamps of their own; the late one's samples come in bursts."""
    library = make_library(rng, groups=(2, 1), n_basis=8, spread=0.02, noise_std=0.001)
    first, second = movement(library, 0, rng).observed
    second = replace(second, stamps_ns=second.stamps_ns + 3_333_333)
    merged = list(merge((first, second)))
    reference = feed(IntentEstimator(library), merged)
    moving = max(episodes(reference), key=len)
    until = moving[len(moving) * 2 // 3].stamp_ns
    begun = moving[0].stamp_ns
    early = [o for o in merged if o.stamp_ns <= begun]
    later = [o for o in merged if begun < o.stamp_ns <= until]
    swapped = []
    for i in range(0, len(later) - 1, 2):  # neighbours arrive in the other order
        swapped += [later[i + 1], later[i]]
    # Hypotheses born on the way begin with whichever signal comes first.
    ordered = IntentEstimator(library, switching=False)
    expected = feed(ordered, early + later[: len(swapped)])[-1]
    found = feed(IntentEstimator(library, switching=False), early + swapped)[-1]
    np.testing.assert_allclose(found.log_evidence, expected.log_evidence, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(found.probabilities, expected.probabilities, atol=1e-9)


@pytest.mark.slow
def test_a_library_swapped_in_mid_movement_has_seen_everything(library, truth, rng):
    other = replace(library, weight_mean=library.weight_mean[::-1].copy())
    observations = list(merge(movement(truth, 0, rng).observed))
    fresh = feed(IntentEstimator(other), observations)
    swapping = IntentEstimator(library)
    half = len(observations) // 2
    before = feed(swapping, observations[:half])
    assert before[-1].moving
    swapping.swap(other)
    after = feed(swapping, observations[half:])
    pairs = [(a, b) for a, b in zip(after, fresh[half:], strict=True) if a.moving and b.moving]
    assert len(pairs) > 20
    for ours, theirs in pairs:
        same(ours, theirs)


@pytest.mark.parametrize("begins_at", [30, 110], ids=["at rest", "in mid-movement"])
def test_a_swap_to_tasks_in_another_turn_of_an_angle_changes_nothing(begins_at):
    rng, units = np.random.default_rng(8), ("rad",) * 3
    library = replace(make_library(rng, spread=0.03, noise_std=0.001), observed_units=units)
    turned, of_none = library.weight_mean.copy(), library.none_mean.copy()
    turned[:, 10:20] += 2.0 * np.pi  # the second DOF
    of_none[10:20] += 2.0 * np.pi
    other = replace(library, weight_mean=turned, none_mean=of_none)
    observations = list(merge(movement(library, 1, rng).observed))
    kept, swapping = IntentEstimator(library), IntentEstimator(library)
    feed(kept, observations[:begins_at])
    feed(swapping, observations[:begins_at])
    swapping.swap(other)
    expected, found = (feed(one, observations[begins_at:]) for one in (kept, swapping))
    assert sum(one.moving for one in found) > 40
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.moving == theirs.moving
        np.testing.assert_allclose(ours.probabilities, theirs.probabilities, atol=1e-6)


def test_what_somebody_else_completes_changes_the_next_movement_not_this_one(library, truth, rng):
    """Else a task recognised while the arm helps somebody could be withdrawn when that ends."""
    plan = read_plan("steps: [{step: task_0}, {step: task_1}]\nby_hand: {task_0 < task_1: 1}\n")
    observations = list(merge(movement(truth, 0, rng).observed))
    sharing, alone = IntentEstimator(library), IntentEstimator(library)
    begun = ([], [])
    for one, estimates in zip((sharing, alone), begun, strict=True):
        one.expectation.follow(plan)
        estimates += feed(one, observations[:110])
    assert begun[0][-1].moving
    progress = WorkProgress(plan, library.labels)
    progress.take(np.array([1.0, 0.0, 0.0, 0.0]))
    sharing.share(progress)
    ours, theirs = (feed(one, observations[110:]) for one in (sharing, alone))
    assert not ours[-1].moving
    for one, other in zip(ours, theirs, strict=True):
        same(one, other, 0.0)
    assert sharing.expectation.progress is progress
    expected = HABIT_TRUST * progress.next_tasks() + (1.0 - HABIT_TRUST) * library.task_prior
    np.testing.assert_allclose(sharing.expectation.prior, expected)


def test_what_cannot_be_swapped_in_or_bent_changes_nothing(library, truth, rng):
    observations = list(merge(movement(truth, 0, rng).observed))
    estimator, undisturbed = IntentEstimator(library), IntentEstimator(library)
    feed(estimator, observations[:110])
    feed(undisturbed, observations[:110])
    for one in (estimator, undisturbed):
        one.expectation.follow(WorkPlan((WorkStep("task_0", "task_0"),)))
    for other in (
        replace(library, observed_names=("a", "b", "c")),
        replace(library, controlled_names=("left", "right")),
        replace(library, observed_groups=(2, 1)),
    ):
        with pytest.raises(DofError, match=r"library \w+: expected .*got .*Train on the same DOFs"):
            estimator.swap(other)
    with pytest.raises(ArgumentError):
        estimator.swap(library, np.array([0.5, 0.5]))
    with pytest.raises(ArgumentError, match="plan"):
        estimator.swap(replace(library, labels=("a", "b", "c")))
    with pytest.raises(ZeroDivisionError):
        estimator.bend(lambda taught: 1 / 0)
    ours, theirs = (feed(one, observations[110:]) for one in (estimator, undisturbed))
    for one, other in zip(ours, theirs, strict=True):
        same(one, other, 0.0)


def test_a_buffer_may_be_used_again(library, truth, rng):
    observations = list(merge(movement(truth, 0, rng).observed))[:120]
    expected = feed(IntentEstimator(library), observations)[-1]
    buffer, estimator = np.zeros(3), IntentEstimator(library)
    for observation in observations:
        buffer[:] = observation.values
        found = estimator.update(observation._replace(values=buffer))
    same(found, expected, 0.0)


@pytest.mark.slow
def test_answers_that_are_given_again_cannot_be_changed(library, truth, rng):
    estimator = IntentEstimator(library)
    for observation in merge(movement(truth, 1, rng).observed):
        estimate = estimator.update(observation)
        if estimate.phase.max() > 0.5:
            break
    kept = [
        *estimate.posterior[:5],
        *estimate.posterior.timing,
        *estimator.predict_controlled().trajectory,
        *estimator._movements.run.prediction(1).controlled(50),
        *(library.observed_mean, library.observed_covariance, library.usual_s),
        *(library.observed_dofs(0), library.basis.centers, library.phase_deviation.grid),
    ]
    for array in kept:
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0


def test_a_swap_between_movements_and_a_task_prior(library, truth, rng):
    estimator = IntentEstimator(library)
    first = list(merge(movement(truth, 0, rng).observed))
    feed(estimator, first)
    estimator.swap(library, np.array([0.0, 0.5, 0.5]))
    second = list(merge(movement(truth, 0, rng).observed))
    later = feed(estimator, shifted(second, (first[-1].stamp_ns - START_NS) * 1e-9 + 0.02))
    assert all(e.probabilities[0] == 0.0 for e in later)


@pytest.mark.slow
def test_reset_forgets_everything(library, truth, rng):
    observations = list(merge(movement(truth, 1, rng).observed))
    fresh = feed(IntentEstimator(library), observations)
    estimator = IntentEstimator(library)
    feed(estimator, observations[: len(observations) // 2])
    posture = Observation(observations[-1].stamp_ns, 0, np.zeros(library.n_controlled))
    assert estimator.update_controlled(posture) is None
    estimator.reset()
    assert estimator.update_controlled(posture._replace(stamp_ns=START_NS)) is None
    assert estimator.predict_controlled() is None
    assert estimator.predict_observed() is None and estimator.predicted_end_std() is None
    for a, b in zip(feed(estimator, observations), fresh, strict=True):  # old stamps again
        same(a, b)


def hesitating(library: TaskLibrary, task: int, pause_s: float, rng) -> list[Observation]:
    """A reach of 2 s that stands still half-way for a while."""
    times = np.arange(-0.8, 2.8 + pause_s, 0.02)
    own = np.where(times < 1.0, times, np.clip(times - pause_s, 1.0, None))
    w = library.weight_mean[task].reshape(-1, library.basis.n_basis)[:3]
    values = library.basis.design_matrix(own / 2.0) @ w.T
    values += rng.normal(size=values.shape) * 0.001
    stamps = START_NS + np.round((times - times[0]) * 1e9).astype(np.int64)
    return [Observation(int(s), 0, v) for s, v in zip(stamps, values, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("pause_s", [0.1, 0.35])
def test_a_hesitation_does_not_end_the_movement(library, truth, rng, pause_s):
    for task in range(3):
        estimates = feed(IntentEstimator(library), hesitating(truth, task, pause_s, rng))
        found = [e for e in episodes(estimates) if len(e) > 5]
        assert len(found) == 1
        assert (found[0][-1].stamp_ns - found[0][0].onset_ns) * 1e-9 > 1.6 + pause_s


@pytest.mark.parametrize("far_m", [0.2, 0.6])
def test_a_hand_that_goes_elsewhere_is_of_no_task_any_more(library, truth, rng, far_m):
    observations = list(merge(movement(truth, 0, rng, duration_s=2.0).observed))
    until_ns = START_NS + 2_300_000_000  # 1.5 s after the rest
    seen = [o for o in observations if o.stamp_ns <= until_ns]
    here, step_ns = seen[-1], seen[-1].stamp_ns - seen[-2].stamp_ns
    shares = minimum_jerk(np.linspace(0.0, 1.0, 40))
    away = far_m * shares[:, None] * np.array([1.0, -1.0, 1.0])
    elsewhere = [
        here._replace(stamp_ns=here.stamp_ns + step_ns * (k + 1), values=here.values + offset)
        for k, offset in enumerate(away)
    ]
    estimator = IntentEstimator(library)
    before, after = feed(estimator, seen), feed(estimator, elsewhere)
    assert max(e.probabilities[0] for e in before) > 0.9
    assert after[-1].moving
    assert after[-1].probabilities[-1] > 0.9
    assert estimator.predict_controlled() is None
    assert estimator.predict_observed().task == "none"


def test_an_answer_counts_as_evidence_until_the_movement_ends(library, truth, rng):
    observations = list(merge(movement(truth, 1, rng).observed))
    estimator, plain = IntentEstimator(library), IntentEstimator(library)
    with pytest.raises(ArgumentError, match="movement"):
        estimator.answer(library.labels[0])
    for observation in observations:
        before, now = plain.update(observation), estimator.update(observation)
        if now.moving and not estimator.expectation._answer and now.stamp_ns > now.onset_ns + 3e8:
            with pytest.raises(ArgumentError, match="nothing like it"):
                estimator.answer("nothing like it")
            estimator.answer(library.labels[2])
        elif before.moving and now.moving and estimator.expectation._answer:
            gained = np.diff((now.log_evidence - before.log_evidence)[[0, 2]])[0]
            assert gained == pytest.approx(np.log(0.99 / (0.01 / 3.0)))
            expected = before.probabilities * np.array([0.01, 0.01, 2.97, 0.01])
            np.testing.assert_allclose(now.probabilities, expected / expected.sum(), atol=1e-12)
    assert not now.moving and not estimator.expectation._answer
