# SPDX-License-Identifier: Apache-2.0
"""Sequences of tasks: how far one is, whatever happens; what is written and what is learned."""

import numpy as np
import pytest
from activation_world import World, prediction
from simulation import make_library

from intent_recognition.activation.states import Mode
from intent_recognition.composing import Moment, SequenceProgress, advance, awaited, read_sequences
from intent_recognition.errors import ArgumentError
from intent_recognition.recognition import TaskMemory
from intent_recognition.recognition.transitions import HABIT_TRUST, Expectation
from intent_recognition.share import share_path

TEXT = """
toolbox:
- task: plate
- task: screw
  when: {wrist_in: {center: [0.3, 0.4, 0.1], radius: 0.15}, at_rest: 0.2}
  within: 30
- task: hold
- task: hold
  when: {after: 2}
other:
- {task: glue}
- {task: plate}
"""
SEQUENCES = read_sequences(TEXT)
LABELS = ("plate", "screw", "hold", "glue", "unlisted")
BACK = {"wrist": np.array([0.3, 0.45, 0.1])}


def follow(*moments, progress=None):
    progress = progress or SequenceProgress()
    for moment in moments:
        progress = advance(SEQUENCES, progress, moment)
    return progress


def course(*, until=99):
    """The whole sequence in order, as moments."""
    return [
        Moment(0.0),
        Moment(1.0, 1, "plate"),
        Moment(3.0, 1, "plate", arrived=True),
        Moment(3.1, 1, "plate", True, 0.1, BACK),
        Moment(3.3, 1, "plate", True, 0.3, BACK),
        Moment(3.4, 2, "screw"),
        Moment(5.0, 2, "screw", True),
        Moment(6.0, 2),
        Moment(7.0, 3, "hold"),
        Moment(8.0, 3, "hold", True),
        Moment(9.0, 3, "hold", True),
        Moment(10.1, 3),
        Moment(10.2, 4, "hold"),
        Moment(11.0, 4, "hold", True),
    ][:until]


def test_in_order_each_step_is_waited_for_runs_and_is_done():
    seen = [follow(*course(until=k + 1)) for k in range(len(course()))]
    assert [(p.step, p.running, p.ordered) for p in seen[1:-1]] == [
        (0, True, False),
        (1, False, False),
        (1, False, False),
        (1, False, True),
        (1, True, False),
        (2, False, False),
        (2, False, False),
        (2, True, False),
        (3, False, False),
        (3, False, False),
        (3, False, True),
        (3, True, False),
    ]
    assert {p.name for p in seen[1:-1]} == {"toolbox"}
    assert seen[0].name == seen[-1].name == ""
    assert awaited(SEQUENCES, seen[-1]) is None


def test_another_task_leads_out_and_may_begin_another_sequence():
    waiting = follow(*course(until=3))
    assert follow(Moment(4.0, 2, "unlisted"), progress=waiting) == SequenceProgress(n_started=2)
    assert follow(Moment(4.0, 2, "glue"), progress=waiting)[:3] == ("other", 0, True)
    assert follow(Moment(4.0, 2, "plate"), progress=waiting)[:3] == ("toolbox", 0, True)
    assert follow(Moment(4.0, 2, "screw"), progress=waiting)[:3] == ("toolbox", 1, True)


def test_it_is_not_waited_for_longer_than_is_written():
    waiting = follow(*course(until=3))
    assert follow(Moment(33.0, 1), progress=waiting).name == "toolbox"
    assert follow(Moment(33.1, 1), progress=waiting).name == ""


def test_a_step_that_does_not_arrive_is_waited_for_again_unless_it_began_by_itself():
    first = follow(*course(until=2), Moment(2.0, 1, ""))
    assert first[:3] == ("toolbox", 0, False)
    by_itself = follow(*course(until=6), Moment(4.0, 2, ""))
    assert by_itself.name == ""


def test_nothing_is_ordered_before_its_conditions_hold_whatever_happens(rng):
    """Random sessions: an order needs its place, rest and time; without events nothing changes."""
    progress, since_s, n_started, ordered, task = SequenceProgress(), 0.0, 0, 0, ""
    for k in range(4000):
        if rng.random() < 0.1:
            n_started += 1
            task = str(rng.choice(LABELS, p=[0.4, 0.2, 0.2, 0.1, 0.1]))
        elif rng.random() < 0.05:
            task = ""
        moment = Moment(
            0.1 * k,
            n_started,
            task,
            bool(rng.random() < 0.3),
            float(rng.choice([0.0, 0.1, 0.3])),
            BACK if rng.random() < 0.5 else {"wrist": np.zeros(3)},
        )
        before, progress = progress, advance(SEQUENCES, progress, moment)
        assert progress.n_started == n_started
        if (before.name, before.step, before.running) != progress[:3]:
            since_s = moment.now_s
        if progress.ordered and not before.ordered:
            ordered += 1
            step = awaited(SEQUENCES, progress)
            assert not progress.running and step.when.by_itself
            if step.task == "screw":
                assert moment.resting_s >= 0.2 and moment.places is BACK
            else:
                assert moment.now_s - since_s >= 2.0
        assert advance(SEQUENCES, progress, moment)[:1] in {progress[:1], ("",)}
    assert ordered > 5


def test_a_first_step_never_begins_by_itself_and_other_mistakes_are_named():
    for text, what in (
        ("a: [{task: x, when: {after: 1}}, {task: y}]", "step 1: expected when: recognised"),
        ("a: [{task: x}]", "two steps"),
        ("[]", "NAME"),
        ("a: [{task: x}, {task: y, when: {after: -1}}]", "from 0 on"),
        ("a: [{task: x}, {task: y, when: {wrist_in: {center: [0, 0], radius: 1}}}]", "center"),
        ("a: [{task: x}, {task: y, when: soon}]", "BODY_in, after or at_rest"),
        ("a: [{task: x}, {tusk: y}]", "a task"),
        ("a: [{task: x}, {task: y}]\nb: [{task: x}, {task: z}]", "another task"),
    ):
        with pytest.raises(ArgumentError, match=what) as caught:
            read_sequences(text)
        assert "\n" not in str(caught.value)
    with pytest.raises(ArgumentError, match="tasks of plate, got glue, hold, screw"):
        read_sequences(TEXT, ("plate",))


def test_the_step_waited_for_is_expected_as_a_habit_is_once_the_movement_is_over(rng):
    library = make_library(rng)
    expectation = Expectation(library)
    expectation.expect("task_1", at_once=False)
    assert expectation.ratio is None
    expectation._set(TaskMemory.empty(3))
    assert expectation.prior[1] == pytest.approx(HABIT_TRUST + (1 - HABIT_TRUST) / 3)
    assert expectation.prior.sum() == pytest.approx(1.0)
    expectation.expect("", at_once=True)
    assert expectation.ratio is None
    expectation.expect("unknown", at_once=True)
    assert expectation.ratio is None


def at_the_plate(ordered="", run_s=0.0, **how):
    """The arm has brought the plate, the person has gone on, and something is ordered."""
    world = World()
    world.run(0.1)
    world.begin("plate")
    while not world.activation.arrived:
        world.step()
    world.task = "idle"
    world.run(0.1)
    if ordered:
        world.activation.inbox.order(prediction(ordered, 0, **how))
    world.run(run_s)
    return world


def test_one_primitive_goes_over_into_the_next_smoothly_without_being_recognised():
    """The plan blends: position and velocity are continuous, in motion and from rest."""
    world = at_the_plate("screw", run_s=0.5)
    assert world.activation.active_task == "screw"
    world.activation.inbox.order(prediction("plate", 0))
    world.run(0.1)
    assert world.activation.active_task == "screw", "one after the other"
    world.run_until(Mode.IDLE)
    assert world.tasks_seen == ["", "plate", "screw", "plate", ""]
    world.check_continuous()


@pytest.mark.slow
@pytest.mark.parametrize("moving", ["", "none"])
def test_what_began_by_itself_goes_on_until_another_task_is_recognised(moving):
    world = at_the_plate("screw", run_s=0.4)
    world.task = moving or "idle"
    world.run(0.4)
    assert world.activation.active_task == "screw"
    world.begin("plate", already_s=0.3)
    world.run(0.3)
    assert world.activation.active_task == "plate"
    world.run_until(Mode.HOMING)
    world.check_continuous()


@pytest.mark.slow
def test_an_ordered_task_that_is_recognised_is_the_persons_from_then_on():
    """It is not begun a second time in the same movement."""
    world = at_the_plate("screw", run_s=0.3)
    world.begin("screw", already_s=0.3)
    while not world.activation.arrived:
        world.step()
    world.run(0.5)
    assert world.activation.counts["started"] == 2 and world.activation.arrived
    world.check_continuous()


def test_an_ordered_task_that_was_recognised_stops_when_it_is_withdrawn():
    world = at_the_plate("screw", run_s=0.3)
    world.begin("screw", already_s=0.3)
    world.run(0.3)
    world.task = "none"
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "withdrawn"


def test_an_ordered_task_that_was_stopped_hides_no_movement():
    world = at_the_plate("screw", run_s=0.4, duration_s=9.0)
    world.task, world.measures = "none", False
    world.run_until(Mode.STOPPED)
    world.measures = True
    world.run_until(Mode.HOMING)
    world.begin("plate", already_s=0.3)
    world.run(0.3)
    assert world.activation.active_task == "plate" and world.activation.mode is Mode.EXECUTING
    world.check_continuous()


def test_an_order_is_taken_back_waits_for_a_recognised_task_and_must_be_certain():
    world = at_the_plate("screw", run_s=0.1, end_std=2.0)
    assert world.rejected == ["uncertain_end"] and world.activation.active_task == "plate"
    world.begin("plate", already_s=0.3)
    world.run(0.1)
    world.activation.inbox.order(prediction("screw", 0))
    world.run(0.2)
    assert world.activation.active_task == "plate"
    world.activation.inbox.order(None)
    world.task = "idle"
    world.run_until(Mode.IDLE)
    assert world.tasks_seen == ["", "plate", ""]


def test_an_order_waits_while_the_arm_cannot_be_seen():
    world = at_the_plate()
    world.measures = False
    world.run(0.4)
    world.activation.inbox.order(prediction("screw", 0))
    world.run(0.1)
    assert world.activation.inbox.ordered and world.activation.active_task != "screw"
    world.measures = True
    world.run(0.2)
    assert not world.activation.inbox.ordered and world.activation.active_task == "screw"


def test_an_arm_that_holds_nothing_has_arrived_all_the_same():
    world = World(hold_s=0.0)
    world.begin("plate", already_s=0.2)
    world.run(0.5)
    world.run_until(Mode.HOMING)
    assert [outcome.what for outcome in world.activation.outcomes] == ["arrived"]


def test_the_shipped_example_is_one_of_the_toolbox():
    text = share_path("config/examples/toolbox_sequence.yaml").read_text(encoding="utf-8")
    found = read_sequences(text, ("hold_screwdriver", "plate_handover", "screw_handover"))
    assert all(len(steps) > 1 for steps in found.values())
