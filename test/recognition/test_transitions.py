# SPDX-License-Identifier: Apache-2.0
"""Which task is expected after which, online."""

from dataclasses import replace

import numpy as np
import pytest
from online_stream import feed, movement, shifted
from simulation import START_NS, make_library

from intent_recognition.filtering.posterior import TaskPosterior
from intent_recognition.plans import WorkPlan
from intent_recognition.plans.work_plan import WorkStep
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.transitions import (
    HABIT_TRUST,
    Expectation,
    TaskMemory,
    next_task_prior,
    remember,
    weigh,
)
from intent_recognition.signals.observation import merge

LABELS = ("a", "b", "c")
DONE = np.ones(4)


def test_memory_is_the_forward_recursion_over_the_last_task(rng):
    memory = TaskMemory.empty(3)
    assert memory.is_empty and memory.last_task(LABELS) == ""
    p1, p2 = np.array([0.7, 0.1, 0.0, 0.2]), np.array([0.0, 0.5, 0.2, 0.3])
    memory = remember(memory, p1, DONE, 5)
    np.testing.assert_allclose(memory.belief, p1)
    memory = remember(memory, p2, DONE, 9)
    np.testing.assert_allclose(memory.belief, p2 * [1, 1, 1, 0] + 0.3 * p1)
    assert (memory.ended_ns, memory.last_task(LABELS)) == (9, "b")
    transition, p0 = rng.dirichlet(np.ones(3), size=4), np.array([0.5, 0.3, 0.2])
    np.testing.assert_allclose(
        next_task_prior(transition, memory, p0, 1.0), memory.belief @ transition
    )
    np.testing.assert_allclose(next_task_prior(transition, memory, p0, 0.0), p0)
    np.testing.assert_allclose(next_task_prior(transition, memory, p0).sum(), 1.0)


def test_memory_follows_its_labels_and_is_left_by_none_and_broken_off_movements():
    memory = remember(TaskMemory.empty(3), np.array([0.0, 1.0, 0.0, 0.0]), DONE, 5)
    after = remember(memory, np.array([0.0, 0.0, 0.0, 1.0]), DONE, 7)
    np.testing.assert_array_equal(after.belief, memory.belief)
    twitch = remember(memory, np.array([0.1, 0.1, 0.8, 0.0]), np.full(4, 0.3), 7)
    np.testing.assert_array_equal(twitch.belief, memory.belief)
    memory = TaskMemory(np.array([0.5, 0.3, 0.1, 0.1]), 5)
    other = memory.relabelled(LABELS, ("c", "a", "d"))
    np.testing.assert_allclose(other.belief, [0.1, 0.5, 0.0, 0.4])
    assert other.ended_ns == 5


def posterior(prior, likelihood) -> TaskPosterior:
    """By Bayes' rule, none having probability 0.1 and likelihood 0.3."""
    p = np.r_[0.9 * prior * likelihood, 0.1 * 0.3]
    return TaskPosterior(p / p.sum(), *[np.zeros(4)] * 4)


def test_weighing_is_bayes_and_never_speaks_for_none(rng):
    for _ in range(50):
        p0, p1 = rng.dirichlet(np.ones(3)), rng.dirichlet(np.ones(3))
        likelihood = rng.uniform(size=3)
        before, after = posterior(p0, likelihood), posterior(p1, likelihood)
        weighed = weigh(before, p1 / p0).probabilities
        assert weighed.sum() == pytest.approx(1.0, abs=1e-12)
        if p1 @ likelihood >= p0 @ likelihood:
            np.testing.assert_allclose(weighed, after.probabilities, atol=1e-12)
        else:
            assert weighed[-1] == pytest.approx(before.probabilities[-1], abs=1e-12)
            shares = after.probabilities[:-1] / after.probabilities[:-1].sum()
            np.testing.assert_allclose(weighed[:-1] / weighed[:-1].sum(), shares, atol=1e-12)
    certain = before._replace(probabilities=np.array([0.0, 0.0, 0.0, 1.0]))
    assert weigh(certain, p1 / p0) is certain


# Online


@pytest.fixture(scope="module")
def library():
    """Three tasks that follow one another in a ring, nine times in ten."""
    plain = make_library(np.random.default_rng(5), spread=0.03, noise_std=0.001)
    ring = np.full((4, 3), 0.05)
    ring[(0, 1, 2, 3), (1, 2, 0, 0)] = 0.9
    return replace(plain, transition_prior=ring)


def expected(row):
    """p(s) where a row of the transition prior is known to be the right one."""
    return HABIT_TRUST * np.asarray(row) + (1 - HABIT_TRUST) / 3


def recording(library, task, rng, after_ns):
    shown = movement(library, task, rng, duration_s=2.0)
    return shifted(merge(shown.observed), (after_ns - START_NS) * 1e-9 + 0.02)


def perform(estimator, library, task, rng, after_ns):
    """Feed a movement; the estimates while it was under way, and its last stamp."""
    observations = recording(library, task, rng, after_ns)
    estimates = [estimator.update(observation) for observation in observations]
    assert not estimates[-1].moving
    return [e for e in estimates if e.moving], observations[-1].stamp_ns


@pytest.mark.slow
def test_the_task_before_picks_the_row(library, rng):
    """Of movements without births, which take the habit of the task that was turned from."""
    on = IntentEstimator(library, switching=False)
    off = IntentEstimator(library, switching=False, transitions=False)
    np.testing.assert_allclose(on.expectation.prior, expected([0.9, 0.05, 0.05]))
    stamp = START_NS
    for task in (0, 1, 2):
        seed = rng.integers(1 << 30)
        known, now = perform(on, library, task, np.random.default_rng(seed), stamp)
        plain, _ = perform(off, library, task, np.random.default_rng(seed), stamp)
        stamp = now
        row = expected(library.transition_prior[task - 1 if task else 3])
        for ours, theirs in zip(known, plain, strict=True):
            weighted = weigh(theirs.posterior, 3.0 * row).probabilities
            np.testing.assert_allclose(ours.probabilities, weighted, atol=2e-3)
            np.testing.assert_array_equal(ours.log_evidence, theirs.log_evidence)
        assert on.expectation.last_task == library.labels[task]
        row = expected(library.transition_prior[task])
        np.testing.assert_allclose(on.expectation.prior, row, atol=0.02)
    np.testing.assert_allclose(off.expectation.prior, 1 / 3)


@pytest.mark.slow
def test_reset_silence_and_a_fixed_prior(library, rng):
    estimator = IntentEstimator(library, forget_after_s=10.0)
    _, stamp = perform(estimator, library, 1, rng, START_NS)
    assert estimator.expectation.last_task == "task_1"
    estimator.reset()
    np.testing.assert_allclose(estimator.expectation.prior, expected(library.transition_prior[3]))
    _, stamp = perform(estimator, library, 1, rng, stamp)
    late = recording(library, 0, rng, stamp + 10_000_000_000)
    feed(estimator, late[:2])
    assert estimator.expectation.memory.is_empty
    fixed = IntentEstimator(library, np.array([0.2, 0.3, 0.5]))
    perform(fixed, library, 1, rng, START_NS)
    np.testing.assert_array_equal(fixed.expectation.prior, [0.2, 0.3, 0.5])


def test_a_swap_keeps_the_memory(library, rng):
    estimator = IntentEstimator(library)
    perform(estimator, library, 1, rng, START_NS)
    estimator.swap(replace(library, labels=("task_1", "task_2", "task_9")))
    assert estimator.expectation.last_task == "task_1"
    row = expected(library.transition_prior[0])
    np.testing.assert_allclose(estimator.expectation.prior, row, atol=0.02)


def test_a_plan_says_what_is_expected_and_outlasts_silence(rng):
    library = make_library(rng)
    steps = tuple(WorkStep(label, label, 0.97) for label in library.labels[:2])
    plan = WorkPlan(steps, {(steps[1].name, steps[0].name): 1.0})
    expectation = Expectation(library, forget_after_s=10.0)
    expectation.follow(plan)
    planned = expectation.progress.next_tasks()
    np.testing.assert_allclose(
        expectation.prior, HABIT_TRUST * planned + (1.0 - HABIT_TRUST) * library.task_prior
    )
    assert np.argmax(expectation.prior) == 1 and expectation.ratio is not None
    p = np.array([0.02, 0.96, 0.01, 0.01])
    broken_off = TaskPosterior(p, *[np.zeros(4)] * 4)._replace(phase=np.full(4, 0.85))
    expectation.remember(START_NS, broken_off)
    assert np.argmax(expectation.prior) == 1
    expectation.remember(START_NS, broken_off._replace(phase=DONE))
    assert np.argmax(expectation.prior) == 0
    expectation.forget_if_long_ago(START_NS + int(1e12))
    assert expectation.memory.is_empty and np.argmax(expectation.prior) == 0
    expectation.swap(library, None)
    assert np.argmax(expectation.prior) == 0
    expectation.reset()
    assert np.argmax(expectation.prior) == 1
    expectation.follow(None)
    np.testing.assert_allclose(expectation.prior, library.task_prior)


def test_an_expected_step_is_trusted_as_a_habit_and_one_that_was_not_learned_is_not(rng):
    library = make_library(rng)
    expectation, plain = Expectation(library), library.task_prior
    trusted = HABIT_TRUST * np.eye(3)[2] + (1.0 - HABIT_TRUST) * plain
    for label, at_once, prior in (
        (library.labels[2], False, plain),
        (library.labels[2], True, trusted),
        ("other", False, trusted),
        ("other", True, plain),
    ):
        expectation.expect(label, at_once=at_once)
        np.testing.assert_allclose(expectation.prior, prior)
