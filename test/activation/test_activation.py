# SPDX-License-Identifier: Apache-2.0
"""The activation's state machine: the course of interactions, and what ends them."""

import numpy as np
import pytest
from activation_world import GOALS, HOME, LABELS, START_NS, STEP_NS, World, executing, prediction

from intent_recognition.activation.inbox import _question
from intent_recognition.activation.states import Mode
from intent_recognition.recognition import DecisionSettings, DecisionState


def test_an_interaction_from_recognition_to_home():
    world = World()
    world.run(0.2)
    world.begin("plate")
    world.run(1.6)
    end = HOME + GOALS["plate"] + world.shift
    np.testing.assert_allclose(world.arm(), end, atol=0.03)
    world.go_home()
    assert world.modes == [Mode.IDLE, Mode.EXECUTING, Mode.HOMING, Mode.IDLE]
    assert world.tasks_seen == ["", "plate", ""]
    assert [outcome.what for outcome in world.activation.outcomes] == ["arrived"]
    assert len(world.commands) > 20


def test_an_interaction_starts_within_a_tenth_of_a_second_and_catches_up():
    world = executing(0.8)
    assert (world.now_ns - START_NS) * 1e-9 <= 0.1
    world.run(1.3)
    assert world.commands[-1].phase_at(world.now_ns)[0] > 0.98
    world = World()
    world.duration_s = 0.3
    world.begin("plate", already_s=0.1)
    world.run_until(Mode.HOMING)
    world.check_continuous()
    assert world.activation.counts["slowed"] > 0


@pytest.mark.slow
def test_the_movement_just_served_does_not_start_again_but_the_next_does():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.run_until(Mode.IDLE)
    world.run(1.0)
    assert world.modes[-1] is Mode.IDLE
    inbox = world.activation.inbox
    for late_ns in (0, -1):  # after the served movement's end
        inbox.prediction = inbox.prediction._replace(onset_ns=inbox._served_ns + late_ns)
        assert (inbox.needed() is None) == (late_ns < 0)
    world.task = "idle"
    world.run(0.1)
    world.serve("screw", already_s=0.5)
    assert world.activation.active_task == "screw"
    world.go_home()


def test_an_order_begins_where_the_arm_has_arrived_without_waiting_there():
    world = World(hold_s=5.0)
    world.serve("plate")
    world.until(lambda: world.activation.arrived)
    world.activation.inbox.order(prediction("screw", 0))
    world.task = "idle"
    world.run(0.1)
    assert world.activation.active_task == "screw" and Mode.HOMING not in world.modes


def test_a_plan_is_updated_no_more_often_than_is_asked_for():
    world = World(command_period_s=0.2)
    world.begin("plate", already_s=0.3)
    world.run(1.5)
    starts_ns = [command.start_ns for command in world.commands]
    assert len(starts_ns) > 4 and np.diff(starts_ns).min() >= 180_000_000


def test_a_new_onset_is_a_new_interaction_even_if_idle_was_not_seen():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.run(0.1)
    world.begin("plate", already_s=0.3)
    world.run(0.3)
    assert world.activation.mode is Mode.EXECUTING
    began_ns = START_NS + 1_000_000_000  # before the end of the first one, as it turns out
    world.task, world.onset_ns = "screw", began_ns
    world.run(0.2)
    assert world.activation.active_task == "screw"
    world.check_continuous()


@pytest.mark.slow
def test_the_same_task_again_at_once_is_an_interaction_of_its_own():
    world = executing(0.3, hold_s=2.0)
    world.run(1.5)
    world.task = "idle"
    world.run(0.1)
    world.begin("plate", already_s=0.3)
    world.run(0.1)
    assert Mode.HOMING not in world.modes
    assert [outcome.what for outcome in world.activation.outcomes] == ["arrived"]
    world.go_home()
    assert [outcome.what for outcome in world.activation.outcomes] == ["arrived", "arrived"]


def test_the_human_being_done_does_not_keep_the_arm_from_arriving():
    world = executing(1.2)
    world.run(0.4)
    world.task = "idle"
    end = world.commands[-1].plan.end
    world.run(1.2)
    np.testing.assert_allclose(world.arm(), end, atol=0.02)
    world.run_until(Mode.IDLE)
    assert Mode.STOPPED not in world.modes


def test_silence_stops_the_arm_on_its_path_and_then_sends_it_home():
    world = executing(hold_s=1.0)
    world.run(0.3)
    world.speaks = False
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "stream_stopped"
    assert world.commands[-1].plan.kind == "stop"
    world.run(0.5)
    assert np.all(world.reference().velocity == 0.0)
    way = GOALS["plate"]
    share = (world.arm() - HOME) @ way / (way @ way)
    assert 0.05 < share < 0.98
    world.run_until(Mode.HOMING)
    world.go_home()
    assert world.activation.counts["stopped: stream_stopped"] == 1


def test_an_arm_that_still_joins_its_path_at_the_end_holds_from_its_rest_on():
    """The last prediction moves the end far: the path is done before the arm is there."""
    world = executing(hold_s=0.5)
    while world.commands[-1].phase_at(world.now_ns).phase < 0.95:
        world.step()
    world.shift += 0.25
    world.run(0.1)
    world.task = "idle"
    last = world.commands[-1]
    world.run_until(Mode.HOMING)
    arrived_s = float(last.plan.times_s[np.argmax(last.plan.phase >= 1.0 - 1e-6)])
    assert last.plan.duration_s > arrived_s + 0.3
    assert world.now_ns >= last.end_ns + 500_000_000


def test_a_prediction_of_another_task_does_not_move_the_one_under_way():
    world = executing(0.3)
    world.speaks = False
    for _ in range(20):
        told = world.now_ns, world.now_ns, LABELS, world.probabilities()
        world.activation.take_tasks(*told)
        world.activation.take_prediction(world.now_ns, prediction("screw", world.onset_ns))
        world.step()
    assert len(world.commands) == 1 and world.activation.active_task == "plate"


def test_a_short_silence_is_nothing_and_a_longer_one_resumes():
    world = executing(hold_s=3.0)
    world.speaks = False
    world.run(0.4)
    assert world.activation.mode is Mode.EXECUTING
    world.run_until(Mode.STOPPED)
    world.run(0.3)
    phase = world.commands[-1].phase_at(world.now_ns)[0]
    world.speaks = True
    world.run_until(Mode.EXECUTING)
    assert world.commands[-1].plan.phase[0] == pytest.approx(phase)
    world.go_home()


def test_another_task_early_on_takes_over_without_a_jump():
    world = executing(0.3)
    world.run(0.3)
    world.task = "screw"
    world.run(0.2)
    assert world.activation.active_task == "screw" and world.activation.mode is Mode.EXECUTING
    world.go_home()
    assert world.tasks_seen == ["", "plate", "screw", ""]


def test_neither_an_unknown_movement_nor_a_prediction_of_another_task_is_executed():
    world = World()
    world.begin("none")
    world.run(2.0)
    assert world.commands == [] and world.modes == [Mode.IDLE]
    world = World()
    world.begin("plate")
    world.activation.take_joint_state(world.now_ns, HOME, np.zeros(7))
    for k in range(1, 10):
        now = world.now_ns + k * STEP_NS
        world.activation.take_tasks(now, now, LABELS, world.probabilities())
        world.activation.take_prediction(now, prediction("screw", world.onset_ns))
        assert world.activation.step(now) is None


def test_an_end_that_is_too_uncertain_is_executed_once_it_is_certain():
    world = World()
    world.begin("plate", already_s=0.2)
    world.end_std = 0.6
    world.run(0.5)
    assert world.commands == [] and "end is uncertain" in world.activation.inbox.held_back
    world.end_std = 0.1
    world.run_until(Mode.EXECUTING)
    assert world.activation.inbox.held_back == "" and "uncertain_end" not in world.rejected


def test_what_is_possible_is_in_question_while_nothing_is_acted_on():
    activation = World().activation

    def question(*p):
        question.ns += 10_000_000
        activation.take_tasks(question.ns, question.ns, LABELS, np.array(p))
        return activation.inbox.question

    question.ns = START_NS
    assert question(0.5, 0.4, 0.1) == {"plate": 0.5, "screw": 0.4}
    assert list(question(0.3, 0.6, 0.1)) == ["screw", "plate"]
    assert question(0.95, 0.04, 0.01) == question(0.2, 0.2, 0.6) == question(0.0, 0.0, 1.0) == {}


@pytest.mark.parametrize("last", ["", "plate"])
def test_after_another_task_what_is_too_improbable_to_act_on_is_in_question(last):
    state = DecisionState(idle=False, last=last)
    p = np.array([0.3, 0.7, 0.0])
    asked = _question(DecisionSettings(threshold=0.6), state, LABELS, p)
    assert asked == ({"plate": 0.3, "screw": 0.7} if last else {})


@pytest.mark.parametrize("stopped", [False, True])
def test_the_arm_stays_while_an_object_changes_hands(stopped):
    world = executing()
    world.run(0.2 if stopped else 2.5)
    if stopped:
        world.task = "none"
        world.run_until(Mode.STOPPED)
        assert world.activation.stop_reason == "withdrawn"
    else:
        assert world.activation.arrived
    until_ns = world.now_ns + 3_000_000_000
    world.activation.take_exchange(until_ns)
    world.task = "idle"
    world.run_until(Mode.HOMING)
    assert world.now_ns == until_ns
    world.check_continuous()


@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.5])
def test_an_arm_on_its_way_from_one_task_to_another_stops_where_it_is(after_s):
    """It is far from the path of the new task, and does not go there first."""
    world = executing()
    world.run(2.5)
    world.begin("screw", already_s=0.2)
    while world.activation.active_task != "screw":
        world.step()
    world.run(after_s)
    world.commands.append(world.activation.halt(world.now_ns))
    brake = world.commands[-1].plan
    way = np.abs(brake.end - brake.positions[0]).max()
    assert way < 0.1 * np.abs(brake.velocities[0]).max() + 2e-3
    world.check_continuous()
