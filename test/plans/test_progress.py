# SPDX-License-Identifier: Apache-2.0
"""Following an assembly by what the recogniser believes of each movement."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.plans import score
from intent_recognition.errors import ArgumentError
from intent_recognition.plans import WorkPlan, WorkProgress
from intent_recognition.plans.work_plan import WorkStep

LABELS = tuple("abcdx")
STEPS = tuple(WorkStep(name, name, 0.97) for name in "abcd")
CHAIN = WorkPlan(STEPS, {("a", "b"): 1.0, ("b", "c"): 1.0, ("c", "d"): 1.0}, n_assemblies=5)


def sure(label, labels=LABELS, p=0.999):
    out = np.full(len(labels) + 1, (1.0 - p) / len(labels))
    out[labels.index(label)] = p
    return out


def state(progress):
    return {step.name: str(step) for step in progress.steps()}


def test_a_chain_is_followed_and_begins_anew():
    progress = WorkProgress(CHAIN, LABELS)
    for label in "abcdab":
        assert LABELS[np.argmax(progress.next_tasks())] == label
        progress.take(sure(label))
        assert progress.next_tasks().sum() == pytest.approx(1.0)
    assert state(progress) == {"a": "done", "b": "done", "c": "may come", "d": "later"}


def test_each_assembly_begins_as_people_like_to_begin():
    """The ratio of two first steps is that of their strengths, whatever came last before."""
    steps = (WorkStep("a", "a", after={"": 4.0}), WorkStep("b", "b", after={"a": 9.0}))
    progress = WorkProgress(WorkPlan(steps, repeated=0.0, wrong=0.0), LABELS)
    for label in "baba":
        p = progress.next_tasks()
        if label == "b":
            assert p[0] / p[1] == pytest.approx(4.0, rel=0.02)  # b may be left out
        progress.take(sure(label, p=1.0))


def test_an_order_that_is_allowed_is_followed():
    plan = WorkPlan(STEPS, {("a", "d"): 1.0, ("b", "d"): 1.0, ("c", "d"): 1.0})
    for order in ("abcd", "cbad", "bacd"):
        progress = WorkProgress(plan, LABELS)
        for k, label in enumerate(order):
            p = progress.next_tasks()
            due = [p[LABELS.index(other)] for other in (order[k:3] or "d")]
            np.testing.assert_allclose(due, due[0])
            assert sum(due) > 0.85
            progress.take(sure(label))


@pytest.mark.parametrize("share", [0.97, 1.0])
@pytest.mark.parametrize("of", ["order", "by_hand"])
def test_a_step_that_was_left_out_is_forgotten_until_it_is_done(share, of):
    """Also one of every assembly."""
    steps = tuple(WorkStep(name, name, share) for name in "abcd")
    plan = WorkPlan(steps, **{of: CHAIN.order}, n_assemblies=CHAIN.n_assemblies)
    progress = WorkProgress(plan, LABELS)
    for label in "ac":
        progress.take(sure(label))
    assert state(progress) == {"a": "done", "b": "forgotten", "c": "done", "d": "may come"}
    progress.take(sure("b"))
    assert state(progress) == {"a": "done", "b": "done", "c": "done", "d": "may come"}


def test_an_optional_step_is_never_forgotten():
    steps = tuple(WorkStep(name, name, 0.6 if name == "b" else 0.97) for name in "abcd")
    progress = WorkProgress(WorkPlan(steps, CHAIN.order), LABELS)
    for label in "ac":
        progress.take(sure(label))
    assert progress.steps()[1].forgotten == 0.0 and state(progress)["b"] == "may come"


def test_a_misrecognised_step_is_set_right_by_those_after_it():
    progress = WorkProgress(CHAIN, LABELS)
    progress.take(sure("a"))
    mistaken = np.array([0.0, 0.35, 0.0, 0.0, 0.6, 0.05])  # b, taken for x
    progress.take(mistaken)
    assert progress.steps()[1].done < 0.5
    progress.take(sure("c"))
    progress.take(sure("d"))
    assert progress.steps()[1].done > 0.9


def test_none_and_slips_change_little():
    progress = WorkProgress(CHAIN, LABELS)
    progress.take(sure("a"))
    before = progress.next_tasks()
    progress.take(np.r_[np.zeros(5), 1.0])
    np.testing.assert_allclose(progress.next_tasks(), before)
    for slip in "ax":
        progress.take(sure(slip))
        assert LABELS[np.argmax(progress.next_tasks())] == "b"
    progress.reset()
    assert LABELS[np.argmax(progress.next_tasks())] == "a"


def test_a_belief_of_certain_movements_is_that_of_all_sets(rng):
    """Two movements under a uniform recogniser, against the sum over all pairs of steps."""
    progress = WorkProgress(CHAIN, LABELS)
    joint = np.zeros((5, 5))
    for i, first in enumerate(LABELS):
        after = WorkProgress(CHAIN, LABELS)
        after.take(sure(first, p=1.0))
        joint[i] = progress.next_tasks()[i] * after.next_tasks()
    progress.take(np.r_[progress.next_tasks(), 0.0])
    np.testing.assert_allclose(progress.next_tasks(), joint.sum(axis=0), atol=1e-9)


@pytest.mark.parametrize("n_steps", [1, 2])
def test_what_a_plan_excludes_leaves_a_belief(n_steps):
    plan = WorkPlan(STEPS[:n_steps], repeated=0.0, wrong=0.0)
    for seed in range(20):
        progress, rng = WorkProgress(plan, LABELS[:2]), np.random.default_rng(seed)
        for done in rng.integers(2, size=12):
            progress.take(np.eye(3)[done])
            p = progress.next_tasks()
            assert p.min() >= 0.0 and p.sum() == pytest.approx(1.0)


def test_a_habit_decides_among_what_may_come():
    a, b, c, d = STEPS
    steps = (
        a,
        replace(b, after={"": 3.0}),
        replace(c, after={"b": 3.0}),
        replace(d, after={"": 9}),
    )
    progress = WorkProgress(WorkPlan(steps, {("a", "d"): 1.0}), LABELS)
    p = progress.next_tasks()
    assert p[1] == pytest.approx(3.0 * p[0], rel=0.02) and p[2] == pytest.approx(p[0])
    assert p[3] < 0.1  # no habit makes d come before a
    progress.take(sure("b", p=1.0))
    p = progress.next_tasks()
    assert p[2] == pytest.approx(3.0 * p[0], rel=0.02)
    progress.take(np.r_[np.zeros(5), 1.0])  # none of them: b is still the last step
    np.testing.assert_allclose(progress.next_tasks(), p)
    renamed = progress.changed(WorkPlan(steps[1:]), LABELS)
    assert renamed.next_tasks()[2] == pytest.approx(3.0 * renamed.next_tasks()[3], rel=0.05)


def test_tasks_that_nobody_recognises_are_left_out():
    progress = WorkProgress(CHAIN, ("a", "c", "x"))
    progress.take(sure("a", ("a", "c", "x")))
    assert np.argmax(progress.next_tasks()) == 1
    with pytest.raises(ArgumentError, match="a, b, c, d"):
        WorkProgress(CHAIN, ("x", "y"))


@pytest.mark.slow
def test_two_demonstrations_with_slips_tell_what_comes_next():
    """On some seeds of the table in docs/plans.md."""
    counts = sum((score(seed, 2, 0.02) for seed in range(100, 112)), Counter())
    assert counts["right"] / counts["decidable"] >= 0.9
    assert counts["loss"] / counts["loss of table"] <= 0.7
