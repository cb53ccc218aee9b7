# SPDX-License-Identifier: Apache-2.0
"""The activation's state machine: late, missing and malformed input, pushed arms, resets."""

from dataclasses import replace

import numpy as np
import pytest
from activation_world import HOME, LABELS, LIMITS, START_NS, STEP_NS, World, executing, prediction

from intent_recognition.activation import ActivationSettings, Command, Mode
from intent_recognition.errors import IntentError
from intent_recognition.kinematics import UNLIMITED_RAD
from intent_recognition.kinematics.limits import PRISMATIC_SCALE_M
from intent_recognition.motion import JointPlan


def test_an_arm_that_is_not_seen_or_moved_by_others_starts_nothing():
    world = World()
    world.measures = False
    world.begin("plate")
    world.run(0.5)
    assert world.commands == [] and "stale_joint_states" in world.rejected
    world.measures = True
    world.run(0.1)
    assert world.activation.mode is Mode.EXECUTING
    world = World()
    world.begin("plate")
    world.measures = False
    for _ in range(20):
        world.activation.take_joint_state(world.now_ns + STEP_NS, HOME, np.full(7, -0.1))
        world.step()
    assert world.commands == [] and "arm_moving" in world.rejected


@pytest.mark.parametrize(
    ("onset_s", "reason"), [(-60.0, "outdated"), (30.0, "stamp_in_future"), (-1e12, "zero_stamp")]
)
def test_predictions_out_of_time_are_rejected(onset_s, reason):
    world = World()
    onset_ns = max(0, START_NS + round(onset_s * 1e9))
    world.activation.take_prediction(START_NS, prediction("plate", onset_ns))
    assert world.rejected == [reason]


@pytest.mark.parametrize(
    ("stamp_ns", "reason"),
    [(0, "zero_stamp"), (START_NS - 1, "stamp_not_increasing"), (2 * START_NS, "stamp_in_future")],
)
def test_tasks_out_of_time_are_rejected(stamp_ns, reason):
    world = World()
    world.activation.take_tasks(START_NS, START_NS, LABELS, world.probabilities())
    world.activation.take_tasks(START_NS + STEP_NS, stamp_ns, LABELS, world.probabilities())
    assert world.rejected == [reason]


@pytest.mark.parametrize("n_bodies", [2, 3])
def test_bodies_measured_at_the_same_time_all_count(n_bodies):
    world = World()
    labels, rest = LABELS, np.array([0.0, 0.0, 1.0])
    doubtful, sure = np.array([0.55, 0.4, 0.05]), np.array([0.96, 0.02, 0.02])
    evidence = np.array([3.0, 0.0, -3.0])
    for step in range(6):
        for body in range(n_bodies):
            p = rest if step == 0 else sure + body * np.array([1e-3, -1e-3, 0.0])
            said = None if step == 0 else evidence + step + body
            world.activation.take_tasks(START_NS, START_NS + step * STEP_NS, labels, p, said)
        assert world.activation.inbox.decision.n_for == step * n_bodies
    assert world.rejected == []
    stamp = START_NS + 6 * STEP_NS
    for body in range(n_bodies):  # the newest of one time is what is believed
        p = sure if body < n_bodies - 1 else doubtful
        world.activation.take_tasks(START_NS, stamp, labels, p, evidence + body)
    assert world.activation.inbox.decision.candidate == "" and world.rejected == []


def test_a_sender_that_is_stuck_is_silent_and_a_malformed_one_changes_nothing():
    world = World()
    world.begin("plate")
    for _ in range(8):
        world.activation.take_tasks(START_NS, START_NS, LABELS, world.probabilities())
    assert world.rejected == ["stamp_not_increasing"] * 7
    assert world.activation.inbox.decision.n_for == 1
    world = executing()
    stamp = world.now_ns
    world.speaks = False
    for _ in range(60):
        world.activation.take_tasks(world.now_ns, stamp, LABELS, world.probabilities())
        world.step()
    assert world.activation.mode is Mode.STOPPED
    world = World()
    before = world.activation.inbox.decision
    for p in (np.array([0.5]), np.array([np.nan, 0.5, 0.5]), np.array([])):
        with pytest.raises(IntentError):
            world.activation.take_tasks(START_NS, START_NS, LABELS, p)
    assert world.activation.inbox.decision == before
    world.activation.take_tasks(START_NS, START_NS, LABELS, world.probabilities())
    assert world.rejected == []


def test_what_the_controller_refuses_is_given_up_and_the_next_movement_starts_where_it_is():
    world = executing()
    world.run(0.3)
    world.activation.give_up(world.now_ns, "refused")
    assert (world.activation.mode, world.activation.active_task) == (Mode.IDLE, "")
    assert world.activation.counts["stopped: refused"] == 1
    assert not world.activation.moves(world.now_ns)
    world.push, world.commands = world.arm() - HOME, []
    world.run(0.5)
    assert world.commands == []
    world.task = "idle"
    world.run(0.1)
    world.serve("screw")
    np.testing.assert_allclose(world.commands[0].plan.positions[0], HOME + world.push)


@pytest.mark.parametrize("times", [1, 2])
def test_reset_sends_the_arm_home_and_does_not_start_the_same_movement_again(times):
    world = executing()
    for _ in range(times):
        world.run(0.3)
        command = world.activation.reset(world.now_ns)
        world.commands += [] if command is None else [command]
    assert world.activation.mode is Mode.HOMING
    world.go_home()
    assert Mode.EXECUTING not in world.modes[2:]


def test_without_return_home_it_stays_and_a_reset_stops_it():
    world = executing(0.8, return_home=False)
    world.run_until(Mode.IDLE)
    world.run(1.0)
    np.testing.assert_allclose(world.arm(), world.commands[-1].plan.end, atol=1e-9)
    assert np.abs(world.arm() - HOME).max() > 0.2
    world = executing(return_home=False)
    world.run(0.3)
    world.commands.append(world.activation.reset(world.now_ns))
    assert world.commands[-1].plan.kind == "stop" and world.activation.mode is Mode.IDLE
    world.check_continuous()


def on_the_way_home(**settings):
    world = World(**settings)
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.task = "idle"
    world.run(0.2)
    assert np.abs(world.reference().velocity).max() > 0.01
    return world


def step_holding(world, position):
    """A step in which somebody holds the arm."""
    world.push = position - world.reference(world.now_ns + STEP_NS).position
    world.step()
    world.push = np.zeros(7)


def test_on_the_way_home_an_arm_that_is_held_back_is_stopped_and_goes_on_from_where_it_is_left():
    world = on_the_way_home(max_tracking_error_rad=0.2)
    n, held = len(world.commands), world.arm()
    for _ in range(300):
        step_holding(world, held)
    brake, again = world.commands[n : n + 2]
    assert (brake.plan.kind, again.plan.kind) == ("stop", "home")
    assert "arm_off_reference" in world.rejected
    assert again.start_ns - brake.end_ns >= 1_000_000_000
    np.testing.assert_allclose(again.plan.positions[0], held, atol=1e-9)
    world.run_until(Mode.IDLE)
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)


@pytest.mark.parametrize("prismatic", [False, True])
def test_a_lift_that_is_centimetres_off_its_reference_is_stopped(prismatic):
    """By 8 cm, where 0.4 rad are tolerated of other joints."""
    lift = np.arange(7) == 0
    scale = np.where(prismatic & lift, PRISMATIC_SCALE_M, 1.0)
    world = executing()
    limits = replace(LIMITS, tolerance_scale=scale)
    world.activation.change(replace(world.activation._settings, limits=limits))
    world.run(0.5)
    world.push = 0.08 * lift
    world.run(0.3)
    assert ("arm is 0.08 m off its reference" in world.said) is prismatic
    assert (world.activation.mode is Mode.STOPPED) is prismatic


def test_on_the_way_home_an_arm_that_is_not_seen_is_stopped_until_it_is():
    world = on_the_way_home()
    world.measures = False
    world.run(5.0)
    assert world.activation.mode is Mode.HOMING
    assert [c.plan.kind for c in world.commands[-2:]] == ["home", "stop"]
    assert world.activation.counts["stopped: stale_joint_states"] == 1
    assert np.abs(world.arm() - HOME).max() > 1e-3
    world.measures = True
    world.go_home()


def test_a_stopped_arm_that_is_not_seen_stays_where_it_is():
    world = executing()
    world.run(0.5)
    world.measures, seen_ns = False, world.now_ns
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "stale_joint_states"
    age_ns = 1e9 * ActivationSettings.max_joint_state_age_s
    assert age_ns < world.now_ns - seen_ns <= age_ns + STEP_NS
    n = len(world.commands)
    world.task = "idle"
    world.run(5.0)
    assert world.activation.mode is Mode.STOPPED and len(world.commands) == n
    world.measures = True
    world.go_home()


def test_a_stopped_arm_that_was_moved_goes_home_from_where_it_rests():
    world = executing()
    world.run(0.5)
    world.push = np.full(7, 0.6)
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "arm_off_reference"
    assert "arm_off_reference" in world.rejected
    world.task = "idle"
    moved = world.reference(world.commands[-1].end_ns).position + world.push
    world.run_until(Mode.HOMING)
    np.testing.assert_allclose(world.commands[-1].plan.positions[0], moved, atol=1e-9)
    world.push = np.zeros(7)
    world.run_until(Mode.IDLE)
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)


@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.1])
def test_what_comes_after_a_halt_goes_on_from_the_braking_arm(after_s):
    world = executing()
    world.run(0.6)
    world.commands.append(world.activation.halt(world.now_ns))
    assert world.commands[-1].plan.kind == "stop" and world.activation.mode is Mode.IDLE
    assert world.activation.halt(world.now_ns) is None
    n = len(world.commands)
    world.task = "idle"
    world.run(after_s)
    world.serve("screw", already_s=0.4)
    first = world.commands[n]
    assert after_s > 0.0 or first.start_ns < world.commands[n - 1].end_ns
    world.go_home()


def drift(world, speed_rad_s, seconds, position=HOME, velocity=None):
    """An arm without measured velocities that others move."""
    world.measures = False
    for k in range(round(seconds * 1e9 / STEP_NS)):
        q = position + speed_rad_s * k * STEP_NS * 1e-9
        world.activation.take_joint_state(world.now_ns + STEP_NS, q, velocity)
        world.step()
    return position + speed_rad_s * seconds


@pytest.mark.parametrize("velocity", [None, np.zeros(7)])
def test_without_velocities_an_arm_must_be_seen_at_rest(velocity):
    world = World()
    drift(world, 0.5, 0.2, HOME - 0.1, velocity)
    world.begin("plate", already_s=0.2)
    q = drift(world, 0.5, 0.5, velocity=velocity)
    assert world.commands == [] and "arm_moving" in world.rejected
    drift(world, 0.0, 0.2, q, velocity)
    assert world.activation.mode is Mode.EXECUTING
    np.testing.assert_allclose(world.commands[0].plan.positions[0], q, atol=1e-9)
    world = World()
    world.begin("plate")
    world.measures = False
    world.activation.take_joint_state(world.now_ns, HOME)
    world.run(0.4)
    world.activation.take_joint_state(world.now_ns, HOME, velocity)
    world.run(0.1)
    assert world.commands == [] and "arm_moving" in world.rejected


def test_a_clock_too_coarse_to_show_an_arm_at_rest_is_named():
    world = World()
    for _ in range(8):
        world.now_ns += 290_000_000
        world.begin("plate")
        world.step()
    assert world.commands == [] and "joint states came 0.30 s apart" in world.said


def test_an_arm_that_two_drivers_place_differently_starts_nothing():
    """As a GUI of joint states that is left running beside the arm's own driver."""
    world = World()
    world.begin("plate")
    world.measures = False
    for _ in range(50):
        for later_ns, position in ((STEP_NS // 2, HOME), (STEP_NS, np.zeros(7))):
            stamp_ns = world.now_ns + later_ns
            world.activation.take_joint_state(stamp_ns, position, np.zeros(7), now_ns=stamp_ns)
        world.step()
    assert world.commands == []
    assert {*world.rejected} == {"arm_moving", "joint_states_disagree"}


@pytest.mark.parametrize(
    ("moved_rad", "most_rad"), [(0.06, 0.4), (0.35, 0.4), (0.5, 0.4), (0.03, 0.02)]
)
def test_an_arm_at_rest_that_was_moved_starts_from_where_it_is(moved_rad, most_rad):
    world = World(max_tracking_error_rad=most_rad)
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.task = "idle"
    world.run_until(Mode.IDLE)
    world.run(1.0)
    n = len(world.commands)
    world.push = np.full(7, -moved_rad)
    world.serve("screw")
    np.testing.assert_allclose(world.commands[n].plan.positions[0], HOME - moved_rad, atol=1e-9)


def test_a_plan_that_brakes_as_hard_as_it_may_before_a_limit_is_left_to_end():
    """Limited jerk would need a longer way to a stand than there is."""
    world, joint = World(), np.eye(7)[1]
    speed, deceleration = 0.5 * LIMITS.velocity[1], LIMITS.acceleration[1]
    t = np.linspace(0.0, speed / deceleration, 20)
    end = HOME + joint * (LIMITS.upper[1] - HOME[1])
    left = t[-1] - t
    q = end - np.outer(deceleration * left**2 / 2.0, joint)
    v = np.outer(deceleration * left, joint)
    plan = JointPlan(t, q, v, np.zeros(20), np.zeros(20), "interaction")
    world.activation.arm.put_in_force(world.now_ns, Command(world.now_ns, plan))
    assert world.activation.halt(world.now_ns) is None
    assert world.activation.arm.in_force().plan is plan


def test_a_joint_without_limits_may_be_measured_in_another_turn():
    world, turn = World(), np.array([2.0 * np.pi, *np.zeros(6)])
    limits = replace(LIMITS, lower=LIMITS.lower - UNLIMITED_RAD, upper=LIMITS.upper + UNLIMITED_RAD)
    world.activation.change(replace(world.activation._settings, limits=limits))
    follow = world.arm
    world.arm = lambda: follow() - (follow()[0] > 0.1) * turn
    world.serve("plate")
    world.run_until(Mode.HOMING)
    assert world.arm()[0] < -np.pi
    world.go_home()
    assert world.rejected == []


def test_an_arm_measured_in_degrees_is_not_moved_and_the_unit_is_doubted():
    world = World()
    world.arm = lambda: np.rad2deg(HOME)
    world.begin("plate")
    world.run(0.5)
    assert world.commands == [] and "is joint_states in radians (or metres)?" in world.said[-1]
