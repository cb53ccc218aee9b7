# SPDX-License-Identifier: Apache-2.0
"""Going ahead to where the expected task begins: when, how, and leaving again."""

import numpy as np
import pytest
from activation_world import GOALS, HOME, LABELS, STEP_NS, World
from clearance_world import ARM, hand_of

from intent_recognition.activation.pretrigger import Pretrigger, PretriggerSettings
from intent_recognition.activation.states import Mode
from intent_recognition.errors import IntentError
from intent_recognition.motion import SlowPlaces
from intent_recognition.recognition.decision import DecisionSettings, DecisionState

AHEAD = HOME + np.array([0.3, -0.2, 0.1, 0.2, 0.0, -0.1, 0.4])
TASKS = LABELS[:2]
BUSY = DecisionState(idle=False)
EXPECTED = np.array([0.1, 0.9])


def make_world(*, starts=None, threshold=0.7, timeout_s=3.0, **settings):
    starts = {"plate": HOME, "screw": AHEAD} if starts is None else starts
    return World(pretrigger=PretriggerSettings(threshold, timeout_s, starts), **settings)


def expect(world, probabilities=EXPECTED):
    """What the estimator says when a movement has ended."""
    world.activation.pretrigger.take_expectation(world.now_ns, TASKS, np.array(probabilities))


def test_it_is_allowed_once_after_each_interaction_and_not_after_starting_over():
    ahead = Pretrigger(PretriggerSettings(0.7, 3.0, {"screw": AHEAD}), DecisionSettings())

    def wanted():
        ahead.take_expectation(1, TASKS, EXPECTED)
        return ahead.wanted(0)

    assert wanted() == ""
    ahead.interaction_began()
    assert wanted() == "screw"
    ahead.begin("screw", 2)
    assert wanted() == ""
    ahead.interaction_began()
    ahead.forget()
    assert wanted() == ""


def after_a_plate(probabilities=EXPECTED, **settings):
    """A plate is handed over; the human rests, and the next task is expected."""
    world = make_world(**settings)
    world.serve("plate")
    world.run(1.2)
    world.task = "idle"
    world.step()
    expect(world, probabilities)
    return world


def ahead(seconds=0.0, **settings):
    """The arm has been going ahead for a while."""
    world = after_a_plate(**settings)
    world.run_until(Mode.PRETRIGGERED)
    world.run(seconds)
    return world


@pytest.mark.parametrize(
    ("mode", "target", "expected"),
    [(Mode.HOMING, HOME, [0.5, 0.5]), (Mode.PRETRIGGERED, AHEAD, EXPECTED)],
)
def test_the_hand_is_slow_at_a_place_on_its_way(mode, target, expected):
    middle_m = ARM.forward_kinematics(0.5 * (HOME + GOALS["plate"] + target))[:3, 3]
    places = SlowPlaces(ARM, np.array([[*middle_m, 0.05, 0.1]]))
    world = after_a_plate(expected, slow_places=places)
    world.run_until(mode)
    plan = world.commands[-1].plan
    hand_m, speed = hand_of(plan)
    at_place = np.linalg.norm(hand_m - middle_m, axis=1) < 0.05
    assert 0.09 < speed[at_place].max() < 0.101 and speed.max() > 0.2
    np.testing.assert_allclose(plan.end, target, atol=1e-6)


def second_plan(places):
    """The way to a second task, from where the first one ended."""
    world = make_world(return_home=False, slow_places=places)
    world.serve("plate")
    world.run_until(Mode.IDLE)
    world.task = "idle"
    world.run(0.2)
    world.serve("screw")
    return world.commands[-1].plan


def test_the_hand_is_slow_at_a_place_also_where_it_still_joins_its_path():
    places = None
    for slow in (False, True):
        plan = second_plan(places)
        hand_m, speed = hand_of(plan)
        if not slow:
            fastest = int(np.argmax(speed[:300]))
            assert speed[fastest] > 0.2
            place_m = hand_m[fastest]
            places = SlowPlaces(ARM, np.array([[*place_m, 0.05, 0.1]]))
    at_place = np.linalg.norm(hand_m - place_m, axis=1) < 0.05
    assert at_place.any() and 0.09 < speed[at_place].max() < places.excess(plan) * 0.1 <= 0.1


def test_the_hand_is_slow_at_a_place_while_predictions_change():
    """Judged every ms: most updates are kept, and none is faster than the place allows."""
    place_m, speed_m_s, radius_m = ARM.skeleton(HOME + 0.8 * GOALS["plate"])[0, -1], 0.02, 0.05
    world = make_world(slow_places=SlowPlaces(ARM, np.array([[*place_m, radius_m, speed_m_s]])))
    world.serve("plate")
    world.run(3.0)
    n_refused, world.task = len(world.rejected), "idle"
    assert n_refused < len(world.commands) and {*world.rejected} <= {"infeasible"}
    world.run_until(Mode.HOMING)
    times_ns = np.arange(world.commands[0].start_ns, world.now_ns, 1_000_000)
    hand_m = ARM.skeleton(np.array([world.reference(t).position for t in times_ns]))[:, -1]
    speed = np.linalg.norm(np.diff(hand_m, axis=0), axis=1) / 1e-3
    at_place = np.linalg.norm(hand_m[1:] - place_m, axis=1) < radius_m
    assert 0.9 * speed_m_s < speed[at_place].max() < 1.001 * speed_m_s
    world.check_continuous()


def test_the_arm_goes_ahead_and_the_interaction_starts_from_there():
    world = ahead()
    assert world.activation.active_task == "" and world.activation.pretrigger.label == "screw"
    assert world.commands[-1].plan.kind == "pretrigger"
    world.run(2.0)
    np.testing.assert_allclose(world.arm(), AHEAD, atol=1e-9)
    assert world.tasks_seen == ["", "plate", ""]
    assert world.activation.counts["activated"] == world.activation.counts["started"] == 1
    n = len(world.commands)
    world.serve("screw", already_s=0.4)
    np.testing.assert_allclose(world.commands[n].plan.positions[0], AHEAD, atol=1e-9)
    assert world.activation.counts["pretrigger right"] == 1
    world.run_until(Mode.HOMING)
    world.task = "idle"
    world.go_home()
    assert world.tasks_seen == ["", "plate", "", "screw", ""]


def test_from_the_way_ahead_another_task_takes_over_or_its_own_begins():
    world = ahead(0.3)
    world.serve("screw", already_s=0.4)
    assert np.abs(world.reference().velocity).max() > 0.01
    world.run_until(Mode.HOMING)
    world.check_continuous()
    world = ahead(1.5)
    world.serve("plate", already_s=0.4)
    assert world.activation.active_task == "plate"
    counts = world.activation.counts
    assert counts["pretrigger wrong"] + counts["pretrigger withdrawn: another_task"] == 1
    assert counts["pretrigger right"] == 0
    world.check_continuous()


@pytest.mark.parametrize("moving", [True, False])
def test_an_unknown_movement_makes_it_withdraw(moving):
    world = ahead(0.3 if moving else 2.0)
    world.begin("none")
    world.run_until(Mode.HOMING, longest_s=0.2)
    assert world.activation.counts["pretrigger withdrawn: none"] == 1
    world.go_home()
    world.task = "idle"
    world.step()
    expect(world)
    world.run(3.0)
    assert world.modes[-1] is Mode.IDLE  # once after each interaction
    assert world.tasks_seen == ["", "plate", ""]


def test_a_movement_that_ends_unrecognised_makes_it_withdraw():
    world = ahead()
    world.task = "undecided"
    world.probabilities = lambda: (
        np.array([0.0, 0.0, 1.0]) if world.task == "idle" else np.array([0.1, 0.6, 0.3])
    )
    world.run(0.5)
    assert world.activation.mode is Mode.PRETRIGGERED
    world.task = "idle"
    world.run_until(Mode.HOMING, longest_s=0.1)
    assert world.activation.counts["pretrigger withdrawn: not_recognised"] == 1


def test_it_waits_no_longer_than_its_timeout():
    world = ahead(timeout_s=2.0)
    arrives_ns = world.commands[-1].end_ns
    world.run_until(Mode.HOMING)
    assert 2.0 < (world.now_ns - arrives_ns) * 1e-9 < 2.1
    assert world.activation.counts["pretrigger withdrawn: timeout"] == 1
    world.go_home()


@pytest.mark.parametrize("reason", ["stream_stopped", "stale_joint_states", "arm_off_reference"])
def test_on_the_way_it_is_guarded_like_any_motion(reason):
    world = ahead(0.2)
    world.speaks = reason != "stream_stopped"
    world.measures = reason != "stale_joint_states"
    world.push = np.full(7, 0.6 if reason == "arm_off_reference" else 0.0)
    world.run_until(Mode.STOPPED, longest_s=0.7)
    assert world.activation.stop_reason == reason
    if not world.measures:  # it stays while its posture is unknown
        world.run(1.0)
        assert world.activation.mode is Mode.STOPPED
    world.speaks = world.measures = True
    world.push = np.zeros(7)
    world.run_until(Mode.IDLE)
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-6)
    world.check_continuous()


@pytest.mark.parametrize("when", ["on the way", "there"])
def test_reset_and_halt(when):
    for act in ("reset", "halt"):
        world = ahead(0.3 if when == "on the way" else 2.5)
        command = getattr(world.activation, act)(world.now_ns)
        if command is not None:
            world.commands.append(command)
        assert world.activation.pretrigger.label == ""
        assert (command is None) == (act == "halt" and when == "there")
        world.run(4.0)
        assert world.activation.mode is Mode.IDLE
        if act == "reset":
            np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)
        world.check_continuous()


def test_where_the_task_begins_at_home_nothing_moves_and_nothing_is_sent():
    world = ahead(starts={"plate": HOME, "screw": HOME + 0.01})
    n = len(world.commands)
    world.run_until(Mode.IDLE)
    assert len(world.commands) == n  # it was on its way home anyhow, and stays there
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)
    assert world.activation.counts["pretriggered"] == 1
    assert world.activation.counts["pretrigger withdrawn: timeout"] == 1
    world.serve("screw", already_s=0.4)
    world.check_continuous()
    world = make_world(starts={"plate": HOME, "screw": HOME + 0.01})
    world.activation.pretrigger.interaction_began()
    world.run(0.1)
    expect(world)
    world.run_until(Mode.PRETRIGGERED)
    world.run_until(Mode.IDLE)
    assert world.commands == []
    assert world.activation.counts["pretrigger withdrawn: timeout"] == 1


@pytest.mark.parametrize("start", [AHEAD, HOME], ids=["elsewhere", "at home"])
@pytest.mark.parametrize("cause", ["timeout", "none", "reset"])
def test_without_return_home_a_withdrawn_arm_stays_or_ends_its_brake_at_rest(cause, start):
    world = ahead(starts={"plate": HOME, "screw": start}, return_home=False)
    begun = world.commands[-1]
    if cause != "timeout":
        world.run(0.5 * begun.plan.duration_s)  # on the way
    if cause == "none":
        world.task = "none"
    if cause == "reset":
        world.commands.append(world.activation.reset(world.now_ns))
    world.run_until(Mode.IDLE)
    if cause == "timeout":
        assert world.commands[-1] is begun
        np.testing.assert_allclose(world.arm(), start, atol=1e-9)
    else:
        assert world.commands[-1].plan.kind == "stop"
    world.run(3.0)
    assert Mode.HOMING not in world.modes[world.modes.index(Mode.PRETRIGGERED) :]
    np.testing.assert_allclose(world.arm(), world.commands[-1].plan.end, atol=1e-9)
    world.check_continuous()


@pytest.mark.parametrize(
    ("change", "probabilities"),
    [
        ({"threshold": 0.0}, EXPECTED),
        ({"threshold": 0.95}, EXPECTED),
        ({"starts": {"plate": AHEAD}}, EXPECTED),
        ({}, [0.45, 0.55]),
    ],
)
def test_it_stays_home_where_it_is_off_or_nothing_is_expected(change, probabilities):
    world = after_a_plate(probabilities, **change)
    world.run_until(Mode.IDLE)
    world.run(2.0)
    assert Mode.PRETRIGGERED not in world.modes
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)


def test_it_stays_home_before_an_interaction_while_the_human_is_not_seen_or_beyond_limits():
    world = make_world()
    world.run(0.2)
    expect(world)
    world.run(3.0)
    assert world.commands == []
    expect(world)  # before the movement that follows
    world.serve("plate")
    world.run(1.2)
    world.task = "idle"
    world.run_until(Mode.IDLE)
    assert Mode.PRETRIGGERED not in world.modes
    world = after_a_plate()
    world.speaks = False
    world.run(6.0)
    assert Mode.PRETRIGGERED not in world.modes
    world = after_a_plate(starts={"screw": np.full(7, 9.0)})
    world.run_until(Mode.IDLE)
    assert Mode.PRETRIGGERED not in world.modes and "infeasible" in world.rejected


def test_malformed_expectations_raise_and_change_nothing():
    pretrigger = Pretrigger(PretriggerSettings(0.7, 1.0, {"screw": AHEAD}), DecisionSettings())
    pretrigger.interaction_began()
    pretrigger.take_expectation(5, TASKS, EXPECTED)
    for labels, p in (
        (TASKS, [1.0]),
        ((), []),
        (TASKS, [0.5, np.nan]),
        (TASKS, [0.5, 0.6]),
        (TASKS, [-0.5, 1.5]),
    ):
        with pytest.raises(IntentError, match="next task"):
            pretrigger.take_expectation(6, labels, np.array(p))
    assert pretrigger.wanted(5) == "screw" and pretrigger.wanted(6) == ""
    assert pretrigger.expected == "screw (0.90)"
    with pytest.raises(IntentError, match="threshold"):
        PretriggerSettings(threshold=1.5)


def test_single_odd_observations_do_not_withdraw():
    pretrigger = Pretrigger(PretriggerSettings(0.7, 1.0, {"screw": AHEAD}), DecisionSettings())
    pretrigger.begin("screw", 0)
    for k in range(40):
        odd = np.array([0.9, 0.05, 0.05]) if k % 5 == 4 else np.array([0.1, 0.85, 0.05])
        pretrigger.observe(BUSY, LABELS, odd)
        assert pretrigger.reason_to_withdraw(k * STEP_NS, BUSY) == ""
    for _ in range(5):
        pretrigger.observe(BUSY, LABELS, np.array([0.9, 0.05, 0.05]))
    assert pretrigger.reason_to_withdraw(0, BUSY) == "another_task"
