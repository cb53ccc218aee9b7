# SPDX-License-Identifier: Apache-2.0
"""A plan: its relations, what follows from them, and its file."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from intent_recognition.plans import WorkPlan, begun_with, read_assemblies, read_plan, write_plan
from intent_recognition.plans.work_plan import WorkStep, closure, covering

STEPS = tuple(WorkStep(name, name) for name in "abcd")


def test_relations_follow_along_the_most_probable_chain():
    plan = WorkPlan(STEPS, {("a", "b"): 0.9, ("b", "c"): 0.8, ("a", "c"): 0.1})
    assert plan.before[0, 2] == pytest.approx(0.72)
    assert plan.before[2, 0] == plan.before[0, 3] == 0.0


def test_what_a_person_wrote_has_precedence():
    learned = {("a", "b"): 0.9, ("b", "c"): 0.9}
    plan = WorkPlan(STEPS, learned, {("a", "c"): 0.0, ("c", "d"): 1.0})
    assert plan.before[0, 2] == 0.0
    assert plan.before[1, 3] == pytest.approx(0.9)
    plan = WorkPlan(STEPS, learned, {("b", "a"): 1.0})
    assert plan.before[0, 1] == plan.before[0, 2] == 0.0 and plan.before[1, 0] > 0.99
    plan = WorkPlan((STEPS[0], WorkStep("a 2", "a")), {}, {("a 2", "a"): 1.0})
    assert plan.before[0, 1] == 0.0 and plan.before[1, 0] > 0.99


def test_the_second_time_comes_after_the_first():
    plan = WorkPlan((WorkStep("x", "x"), WorkStep("y", "y"), WorkStep("x 2", "x")))
    assert plan.before[0, 2] == pytest.approx(1.0, abs=1e-5) and plan.before[2, 0] == 0.0


def test_steps_left_out_of_the_labels_keep_what_they_imply():
    steps = (*STEPS[:2], WorkStep("c", "c", after={"b": 2.0, "a": 3.0, "": 4.0}))
    plan = WorkPlan(steps, {("a", "b"): 0.9, ("b", "c"): 0.9}).of(("a", "c"))
    assert plan.steps[1].after == {"a": 3.0, "": 4.0}
    assert plan.names == ("a", "c") and plan.before[0, 1] == pytest.approx(0.81)


def test_a_covering_implies_what_was_left_out(rng):
    for _ in range(20):
        before = closure(np.triu(rng.random((5, 5)) * (rng.random((5, 5)) < 0.5), 1))
        kept = covering(before, 0.0)
        np.testing.assert_allclose(closure(kept), before, atol=1e-12)
        assert np.count_nonzero(kept) <= np.count_nonzero(before)


@pytest.mark.parametrize(
    ("steps", "order", "said"),
    [
        (STEPS, {("a", "z"): 0.5}, "z"),
        (STEPS, {("a", "a"): 0.5}, "a < a"),
        ((WorkStep("lid", "a"), WorkStep("b", "b", after={"lit": 2.0})), {}, r"b, after.*lid\?"),
        (tuple(WorkStep(str(k), "a") for k in range(61)), {}, "60"),
        (STEPS, {("a", "b"): 1.5}, "1.5"),
        (STEPS, {("a", "b"): 0.9, ("b", "a"): 0.9}, "a, b"),
        ((*STEPS, STEPS[0]), {}, "different names"),
        ((*STEPS, WorkStep("a 2", "a")), {("a 2", "a"): 1.0}, "circle"),
    ],
)
def test_what_is_no_plan_is_refused(steps, order, said):
    with pytest.raises(ArgumentError, match=said):
        WorkPlan(steps, order)


def test_what_is_written_is_read():
    full = WorkStep("a 2", "a", 0.5, {"anna": 1.0}, {"screw": 2.0}, 3.25, {"b": 2.0})
    steps = (*STEPS, full, WorkStep("of no task", ""))
    plan = WorkPlan(steps, {("a", "b"): 0.875}, {("b", "c"): 1.0}, 0.01, 0.02, 7)
    assert read_plan(write_plan(plan)) == plan


@pytest.mark.parametrize("name", ["", "a ", "a<b"])
def test_what_could_not_be_read_is_not_written(name):
    with pytest.raises(ArgumentError, match="without <"):
        write_plan(WorkPlan((WorkStep(name, "a"),)))


def test_a_plan_by_hand_needs_only_steps_and_may_merge_others():
    steps = "[&x {step: base}, {<<: *x, <<: *x, step: lid}]"
    plan = read_plan(f"steps: {steps}\nby_hand: {{base < lid: 1}}")
    assert plan.names == ("base", "lid") and plan.before[0, 1] > 0.99


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[",
        "steps: []",
        "steps: [{share: 1}]",
        "steps: [{step: a, colour: 1}]",
        "steps: [{step: a, share: much}]",
        "steps: [{step: a<b}]",
        "steps: [{step: [a]}]",
        "steps: [{step: a, task: {b: 1}}]",
        "steps: [{step: a}, {step: b}]\norder: {a: 1}",
        "steps: [{step: a}, {step: b}]\norder: {a < b < a: 1}",
        "steps: [{step: a}]\nother: 1",
        "steps: [{step: a}]\nsteps: [{step: b}]",
        "steps: [{step: a}, {step: b}]\norder: {a < b: 1, a<b: 0.2}",
    ],
)
def test_other_texts_are_no_plans(text):
    with pytest.raises(ArgumentError, match=r"docs/plans\.md"):
        read_plan(text)


def test_sessions_are_read_as_one_or_several_assemblies():
    done = "{task: b, who: anna, start: 2, end: 3.5, objects: {screw: 2}}, {task: 0, who: , end: 9}"
    (one,) = read_assemblies(f"[a, {done}]")
    assert [(each.task, each.duration_s) for each in one] == [("a", 0.0), ("b", 1.5), ("0", 0.0)]
    assert (one[1].who, one[1].duration_s, one[1].objects) == ("anna", 1.5, {"screw": 2.0})
    assert len(read_assemblies("[[a, b], [b]]")) == 2


@pytest.mark.parametrize(
    "text",
    [
        *("", "a", "[[a], b]", "[{who: anna}]", "[{task: a, when: 1}]", "[{task: ''}]"),
        *("[{task: a, start: 2, end: 1}]", "[{task: a, who: [anna, ben]}]", "[{task: b, task: c}]"),
    ],
)
def test_other_texts_are_no_sessions(text):
    with pytest.raises(ArgumentError):
        read_assemblies(text)


def test_a_session_is_cut_where_assemblies_begin():
    cut = begun_with(read_assemblies("[b, a, b, c, a, c]"), "a")
    assert [[one.task for one in part] for part in cut] == [["b"], ["a", "b", "c"], ["a", "c"]]


def test_a_task_that_no_session_holds_begins_none():
    with pytest.raises(ArgumentError, match="first: expected one of a, b, got c"):
        begun_with(read_assemblies("[b, a]"), "c")
