# SPDX-License-Identifier: Apache-2.0
"""The activation's state machine: clocks that differ, joint states and commands that are late."""

from collections import deque

import numpy as np
import pytest
from activation_world import HOME, START_NS, STEP_NS, World, executing, prediction

from intent_recognition.activation import ArmClock, Mode
from intent_recognition.recognition import DecisionState


def test_a_clock_that_goes_back_starts_over_and_what_is_old_is_rejected_with_the_cure():
    world = executing()
    assert world.activation.step(world.now_ns - 10_000_000_000) is None
    assert world.activation.mode is Mode.IDLE and "clock_jumped_back" in world.rejected
    assert world.activation.inbox.decision == DecisionState()
    world = World()
    long_ago_ns = START_NS - 40_000_000_000
    world.activation.take_prediction(START_NS, prediction("plate", long_ago_ns))
    world.activation.take_joint_state(long_ago_ns, HOME, np.zeros(7), now_ns=START_NS)
    assert world.rejected == ["outdated", "joint_state_outdated"]
    assert all("--restamp" in text and "use_sim_time" in text for text in world.said)
    world = World()
    world.run(0.1)
    for late_ns in (0, 1, STEP_NS, 10**9):
        world.activation.take_joint_state(world.now_ns - late_ns, HOME + 1.0, now_ns=world.now_ns)
    assert world.rejected == ["joint_state_not_increasing"] * 4
    world.begin("plate")
    world.run(0.1)
    np.testing.assert_allclose(world.commands[0].plan.positions[0], HOME, atol=1e-12)


def test_the_offset_of_a_clock_is_the_least_that_came_in_the_last_two_to_four_seconds(rng):
    clock, heard = ArmClock(), []
    for now_ns in range(START_NS, START_NS + 20_000_000_000, 100_000_000):
        heard.append((now_ns, int(rng.integers(-9_000_000, 9_000_000))))
        clock.hear(now_ns, now_ns - heard[-1][1])
        recent, longer = (
            min(behind for at_ns, behind in heard if now_ns - at_ns <= span_s * 1e9)
            for span_s in (2.0, 4.1)
        )
        assert longer <= clock.offset_ns <= recent


@pytest.mark.parametrize("ahead_s", [0.02, 0.5, 0.999, 5.0, 1e6])
@pytest.mark.parametrize("first", [True, False])
def test_a_joint_state_from_the_future_blocks_nothing(ahead_s, first):
    world = World()
    if not first:
        world.run(0.1)
    stamp_ns = world.now_ns + round(ahead_s * 1e9)
    world.activation.take_joint_state(stamp_ns, HOME, np.zeros(7), now_ns=world.now_ns)
    assert ("joint_state_in_future" in world.rejected) == (ahead_s > 1.0)
    world.rejected.clear()
    world.begin("plate")
    world.run(0.1)
    assert world.activation.mode is Mode.EXECUTING
    assert world.rejected == []


@pytest.mark.parametrize(
    ("late_s", "stopped"), [(0.2, "arm_off_reference"), (0.9, "stale_joint_states")]
)
def test_a_push_is_noticed_though_joint_states_are_late(late_s, stopped):
    """Late ones show the arm where its reference was; so it is told from a clock that is behind."""
    world, queue = World(), []
    world.measures = False

    def step(measured):
        queue.append((world.now_ns, measured))
        while queue and queue[0][0] <= world.now_ns - late_s * 1e9:
            stamp_ns, position = queue.pop(0)
            world.activation.take_joint_state(stamp_ns, position, np.zeros(7), now_ns=world.now_ns)
        world.step()

    for _ in range(150):
        step(world.arm())
    world.begin("plate", already_s=0.0)
    for k in range(70):
        step(world.arm() + (0.9 if k > 30 else 0.0))
    assert world.activation.stop_reason == stopped
    assert world.activation.arm.clocks["joint states' age by"] == "stamp"


@pytest.mark.parametrize("lag_s", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("behind_s", [0.1, 0.3, 0.9])
def test_an_arm_whose_clock_is_behind_is_followed_while_it_moves(behind_s, lag_s):
    """Though it lags behind its reference, which tells little while it speeds up."""
    world, been = World(), deque([HOME], maxlen=round(lag_s * 1e9) // STEP_NS + 1)
    world.measures = False
    world.begin("plate", already_s=0.2)
    for _ in range(200):
        been.append(world.arm())
        stamp_ns = world.now_ns - round(behind_s * 1e9)
        world.activation.take_joint_state(stamp_ns, been[0], np.zeros(7), now_ns=world.now_ns)
        world.step()
    clocks = world.activation.arm.clocks
    assert clocks["joint states behind"] == f"{behind_s:.3f} s"
    if lag_s < behind_s:  # else both are as good as the other
        assert clocks["joint states' age by"] == "arrival"
    assert world.activation.mode is Mode.EXECUTING and "stale_joint_states" not in world.rejected
    if lag_s == 0.0:
        assert clocks["commands late [s]"] == "0.000" and world.rejected == []


@pytest.mark.parametrize("seed", range(4))
def test_with_three_in_ten_commands_lost_the_arm_ends_at_home(seed):
    """A lost one is noticed: the arm is where the command before asks it to be.

    Of seed 1 the next one home is lost, too.
    """
    world, rng, got = World(), np.random.default_rng(seed), []

    def reference():
        reached = [command for command in got if world.now_ns >= command.start_ns]
        return reached[-1].at(world.now_ns).position if reached else HOME

    world.arm = reference

    def run(seconds):
        for _ in range(round(seconds * 100)):
            n = len(world.commands)
            world.step()
            got.extend(c for c in world.commands[n:] if rng.random() >= 0.3)

    run(0.3)
    world.begin("plate", already_s=0.3)
    run(3.0)
    world.task = "idle"
    while world.activation.mode is not Mode.HOMING:
        run(0.01)
    while got and got[-1].plan.kind == "home":
        got.pop()  # in any case the first one home
    run(12.0)
    assert "command_lost" in world.rejected and world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-3)


def on_the_way_home() -> World:
    world = World()
    world.serve("plate")
    world.run(2.0)
    world.task = "idle"
    world.run_until(Mode.HOMING)
    world.run(0.4)
    return world


@pytest.mark.parametrize("jump_s", [0.3, 10.0])
def test_after_a_clock_that_jumps_ahead_on_the_way_home_the_arm_goes_home_once_more(jump_s):
    """The arm has stayed where it was; it stays away a second time, and is left there."""
    world = on_the_way_home()
    at, n = world.arm(), len(world.commands)
    world.now_ns += round(jump_s * 1e9)
    world.arm = lambda: at
    world.run_until(Mode.IDLE)
    (again,) = world.commands[n:]
    np.testing.assert_allclose(again.plan.positions[[0, -1]], [at, HOME], atol=1e-9)
    assert "commands_late" not in world.rejected


def test_an_arm_that_lags_behind_its_only_command_goes_home_once():
    """It was pushed aside before, so that the way home is the only command that it remembers."""
    world = on_the_way_home()
    aside, left = world.arm() + 0.5, world.commands[-1]

    def lags():
        way = world.commands[-1]
        if way is left or way.plan.kind == "stop":
            return aside
        return way.at(max(world.now_ns - 200_000_000, way.start_ns)).position

    world.arm = lags
    world.run_until(Mode.IDLE)
    np.testing.assert_allclose(world.commands[-1].plan.positions[[0, -1]], [aside, HOME], atol=1e-9)
    np.testing.assert_allclose(world.arm(), HOME, atol=0.05)


def test_while_the_clock_stands_still_the_arm_goes_on_or_brakes_and_ends_at_home():
    """Its joint states are used up to 1 s ahead, then named."""
    world = World()
    world.serve("plate")
    world.task = "idle"
    world.run_until(Mode.HOMING)
    stands_ns = world.now_ns
    for k in range(250):
        now_ns = stands_ns + k * STEP_NS
        q = world.reference(now_ns).position
        world.activation.take_joint_state(now_ns, q, np.zeros(7), now_ns=stands_ns)
        command = world.activation.step(stands_ns)
        world.commands += [command] if command else []
    assert world.commands[-1].plan.kind in ("home", "stop")
    assert set(world.rejected) >= {"joint_state_in_future"}
    world.go_home()
