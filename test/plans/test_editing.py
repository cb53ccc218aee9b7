# SPDX-License-Identifier: Apache-2.0
"""A plan that is changed keeps all else that was known of it."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from intent_recognition.plans import (
    WorkPlan,
    WorkProgress,
    moved,
    ordered,
    read_plan,
    required,
    without,
    write_plan,
)
from intent_recognition.plans.work_plan import WorkStep

STEPS = tuple(WorkStep(name, name, 0.9) for name in "abcd")
CHAIN = WorkPlan(STEPS, {("a", "b"): 0.9, ("b", "c"): 0.9, ("c", "d"): 0.9})


def waits(plan):
    """Pairs of which the first step must probably come before the second."""
    names = plan.names
    return {names[i] + names[j] for i, j in np.argwhere(plan.before > 0.5)}


def test_a_step_waits_for_another_or_need_not_and_the_rest_stays():
    plan = ordered(CHAIN, "b", "c", False)
    assert waits(plan) == waits(CHAIN) - {"bc"}
    back = ordered(plan, "b", "c", True)
    assert waits(back) == waits(CHAIN)
    assert back.by_hand == {("b", "c"): 1.0}


def test_a_step_that_is_turned_round_takes_the_place_of_the_other():
    plan = ordered(CHAIN, "c", "b", True)
    assert waits(plan) == waits(CHAIN) - {"bc"} | {"cb"}


def test_what_would_be_a_circle_is_refused():
    with pytest.raises(ArgumentError, match="circle"):
        ordered(CHAIN, "d", "a", True)


@pytest.mark.parametrize("step", "abcd")
def test_earlier_and_later_is_as_before(step):
    for places in (-1, 1):
        plan = moved(moved(CHAIN, step, places), step, -places)
        if moved(CHAIN, step, places) != CHAIN:  # not the first or last one
            assert plan.names == CHAIN.names and waits(plan) == waits(CHAIN)


def test_what_a_step_passes_waits_for_it_where_it_waited():
    plan = moved(CHAIN, "d", -2)
    assert plan.names == ("a", "d", "b", "c")
    assert waits(plan) == {"ab", "ac", "ad", "bc", "db", "dc"}
    free = WorkPlan(STEPS)
    assert waits(moved(free, "d", -2)) == set()
    assert moved(free, "a", 99).names == ("b", "c", "d", "a")


def test_a_step_passes_another_of_its_task_and_all_else_waits_as_before():
    steps = tuple(WorkStep(name, name[0], 0.9) for name in ("a", "b", "c", "b 2"))
    plan = WorkPlan(steps, {("a", "b"): 0.9, ("b", "c"): 0.9, ("c", "b 2"): 0.9})
    assert waits(moved(plan, "b 2", -2)) == {"ab", "ac", "ab 2", "bc", "b 2b", "b 2c"}
    twice = WorkPlan((steps[1], steps[3]), {("b", "b 2"): 0.9})
    assert waits(ordered(twice, "b 2", "b", True)) == {"b 2b"}


def test_a_step_is_required_or_left_out_and_the_file_says_so():
    plan = required(CHAIN, "c")
    assert [step.share for step in plan.steps] == [0.9, 0.9, 1.0, 0.9]
    plan = without(plan, "b")
    assert plan.names == ("a", "c", "d") and waits(plan) == {"ac", "ad", "cd"}
    again = read_plan(write_plan(plan))
    np.testing.assert_allclose(again.before, plan.before)
    with pytest.raises(ArgumentError, match="one of several"):
        without(without(without(plan, "a"), "c"), "d")
    with pytest.raises(ArgumentError, match="it has changed"):
        without(plan, "b")


def test_steps_of_the_same_name_stay_done_under_a_changed_plan():
    labels = tuple("abcd")
    progress = WorkProgress(CHAIN, labels)
    for task in "ab":
        progress.take(np.eye(5)[labels.index(task)])
    before = {step.name: step.done for step in progress.steps()}
    new = WorkPlan((*without(CHAIN, "b").steps, WorkStep("e", "b")))
    after = {step.name: step.done for step in progress.changed(new, labels).steps()}
    assert after == pytest.approx({name: before.get(name, 0.0) for name in "acde"})
    assert before["a"] > 0.9 and before["b"] > 0.9
