# SPDX-License-Identifier: Apache-2.0
"""The activation's state machine against a simulated clock, estimator and arm."""

import numpy as np
import pytest

from intent_recognition.errors import IntentError
from intent_recognition.kinematics.lwr import LWR_LIMITS
from intent_recognition.kinematics.path import make_path
from intent_recognition.kinematics.planning import scaled_limits
from intent_recognition.promp.activation import Activation
from intent_recognition.promp.activation_settings import ActivationSettings, Mode, Prediction

LIMITS = scaled_limits(LWR_LIMITS)
HOME = np.array([-0.07, -0.58, -0.47, 1.6, -0.39, 0.94, 0.5])
LABELS = ("plate", "screw", "none")
GOALS = {"plate": np.full(7, 0.4), "screw": np.linspace(-0.6, 0.4, 7)}
START_NS = 1_000_000_000_000
STEP_NS = 10_000_000
DURATION_S = 2.0


def trajectory(label, goal_shift=0.0, duration_s=DURATION_S):
    s = np.linspace(0.0, 1.0, 50)
    blend = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    q = HOME + np.outer(blend, GOALS[label] + goal_shift)
    return s * duration_s, q


def prediction(label, onset_ns, goal_shift=0.0, duration_s=DURATION_S, end_std=0.1):
    times, q = trajectory(label, goal_shift, duration_s)
    return Prediction(label, onset_ns, make_path(times, q, LIMITS), end_std)


class World:
    """A clock, an arm that follows its commands exactly, and an estimator that says what it must.

    `task` is what the estimator believes ("idle": none = 1), `onset_ns` when it thinks it began.
    """

    def __init__(self, **settings):
        self.rejected: list[str] = []
        self.activation = Activation(
            ActivationSettings(limits=LIMITS, home=HOME, **settings),
            lambda reason, text: self.rejected.append(reason),
        )
        self.now_ns = START_NS
        self.commands = []
        self.modes = [Mode.IDLE]
        self.tasks_seen = [""]
        self.task, self.onset_ns = "idle", 0
        self.shift, self.push = 0.0, np.zeros(7)
        self.speaks = self.measures = True
        self.rng = np.random.default_rng(0)

    def reference(self, now_ns=None):
        now_ns = self.now_ns if now_ns is None else now_ns
        for command in reversed(self.commands):
            if now_ns >= command.start_ns:
                return command.at(now_ns)
        return None

    def arm(self):
        reference = self.reference()
        return HOME if reference is None else reference.position

    def begin(self, task, already_s=0.8):
        self.task, self.onset_ns = task, self.now_ns - round(already_s * 1e9)

    def probabilities(self):
        if self.task == "idle":
            return np.array([0.0, 0.0, 1.0])
        p = np.full(3, 0.02)
        p[LABELS.index(self.task)] = 0.96
        return p

    def step(self):
        """10 ms: 100 Hz observations, 25 Hz predictions, 100 Hz joint states."""
        self.now_ns += STEP_NS
        if self.measures:
            self.activation.take_joint_state(self.now_ns, self.arm() + self.push, np.zeros(7))
        if self.speaks:
            self.activation.take_tasks(self.now_ns, self.now_ns, LABELS, self.probabilities())
            if self.task in GOALS and (self.now_ns // STEP_NS) % 4 == 0:
                self.shift += self.rng.normal(0.0, 0.004)
                duration = DURATION_S * (1.0 + self.rng.normal(0.0, 0.01))
                self.activation.take_prediction(
                    self.now_ns, prediction(self.task, self.onset_ns, self.shift, duration)
                )
        command = self.activation.step(self.now_ns)
        if command is not None:
            self.commands.append(command)
        if self.activation.mode is not self.modes[-1]:
            self.modes.append(self.activation.mode)
        if self.activation.active_task != self.tasks_seen[-1]:
            self.tasks_seen.append(self.activation.active_task)

    def run(self, seconds):
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.step()

    def run_until(self, mode, longest_s=20.0):
        for _ in range(round(longest_s * 1e9 / STEP_NS)):
            if self.activation.mode is mode:
                return
            self.step()
        raise AssertionError(f"{mode} not within {longest_s} s but {self.modes}")

    def check_continuous(self):
        """Every command starts where the one before is then; the whole keeps the limits."""
        for before, after in zip(self.commands, self.commands[1:], strict=False):
            was, now = before.at(after.start_ns), after.at(after.start_ns)
            np.testing.assert_allclose(now.position, was.position, atol=1e-9)
            np.testing.assert_allclose(now.velocity, was.velocity, atol=1e-8)
            assert after.start_ns >= before.start_ns
        t = np.arange(self.commands[0].start_ns, self.commands[-1].end_ns, 2_000_000)
        q, k = [], 0
        for x in t:
            while k + 1 < len(self.commands) and x >= self.commands[k + 1].start_ns:
                k += 1
            q.append(self.commands[k].at(int(x)).position)
        v = np.diff(np.array(q), axis=0) / 2e-3
        a = np.diff(v, axis=0) / 2e-3
        assert np.all(np.abs(v) <= LIMITS.velocity * (1 + 1e-6))
        assert np.all(np.abs(a) <= LIMITS.acceleration * (1 + 1e-5) + 1e-6)


def test_an_interaction_from_recognition_to_home():
    world = World()
    world.run(0.2)
    world.begin("plate")
    world.run(1.6)
    end = HOME + GOALS["plate"] + world.shift
    np.testing.assert_allclose(world.arm(), end, atol=0.03)
    world.run_until(Mode.IDLE)
    assert world.modes == [Mode.IDLE, Mode.EXECUTING, Mode.HOMING, Mode.IDLE]
    assert world.tasks_seen == ["", "plate", ""]
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)
    assert len(world.commands) > 20
    world.check_continuous()


def test_starts_within_a_tenth_of_a_second_and_catches_up():
    world = World()
    world.begin("plate", already_s=0.8)
    world.run_until(Mode.EXECUTING)
    assert (world.now_ns - START_NS) * 1e-9 <= 0.1
    world.run(1.3)
    assert world.commands[-1].phase_at(world.now_ns)[0] > 0.98


def test_the_movement_just_served_does_not_start_again_but_the_next_does():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.run_until(Mode.IDLE)
    world.run(1.0)
    assert world.modes[-1] is Mode.IDLE
    world.task = "idle"
    world.run(0.1)
    world.begin("screw", already_s=0.5)
    world.run_until(Mode.EXECUTING)
    assert world.activation.active_task == "screw"
    world.run_until(Mode.IDLE)
    world.check_continuous()


def test_a_new_onset_is_a_new_interaction_even_if_idle_was_not_seen():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.run(2.5)
    world.begin("plate", already_s=0.3)
    world.run(0.3)
    assert world.activation.mode is Mode.EXECUTING
    world.check_continuous()


def test_a_new_interaction_on_the_way_home_starts_from_the_moving_arm():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.task = "idle"
    world.run(0.3)
    world.begin("screw", already_s=0.3)
    world.run_until(Mode.EXECUTING)
    assert np.abs(world.reference().velocity).max() > 0.01
    world.run_until(Mode.HOMING)
    world.run_until(Mode.IDLE)
    assert world.tasks_seen == ["", "plate", "screw", ""]
    world.check_continuous()


def test_the_human_being_done_does_not_keep_the_arm_from_arriving():
    world = World()
    world.begin("plate", already_s=1.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.4)
    world.task = "idle"
    end = world.commands[-1].plan.end
    world.run(1.2)
    np.testing.assert_allclose(world.arm(), end, atol=0.02)
    world.run_until(Mode.IDLE)
    assert Mode.STOPPED not in world.modes


def test_silence_stops_the_arm_on_its_path_and_then_sends_it_home():
    world = World(hold_s=1.0)
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.3)
    world.speaks = False
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "stream_stopped"
    assert world.commands[-1].plan.kind == "stop"
    world.run(0.5)
    assert np.all(world.reference().velocity == 0.0)
    _, q = trajectory("plate")
    share = (world.arm() - HOME) @ (q[-1] - HOME) / np.sum((q[-1] - HOME) ** 2)
    assert 0.05 < share < 0.98
    world.run_until(Mode.HOMING)
    world.run_until(Mode.IDLE)
    assert world.activation.counts["stopped: stream_stopped"] == 1
    world.check_continuous()


def test_a_short_silence_is_nothing_and_a_longer_one_resumes():
    world = World(hold_s=3.0)
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.speaks = False
    world.run(0.4)
    assert world.activation.mode is Mode.EXECUTING
    world.run_until(Mode.STOPPED)
    world.run(0.3)
    phase = world.commands[-1].phase_at(world.now_ns)[0]
    world.speaks = True
    world.run_until(Mode.EXECUTING)
    assert world.commands[-1].plan.phase[0] == pytest.approx(phase)
    world.run_until(Mode.IDLE)
    world.check_continuous()


def test_a_withdrawn_task_stops_the_arm():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.2)
    world.task = "none"
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "withdrawn"
    world.run_until(Mode.IDLE)
    world.check_continuous()


def test_another_task_early_on_takes_over_without_a_jump():
    world = World()
    world.begin("plate", already_s=0.3)
    world.run_until(Mode.EXECUTING)
    world.run(0.3)
    world.task = "screw"
    world.run(0.2)
    assert world.activation.active_task == "screw" and world.activation.mode is Mode.EXECUTING
    world.run_until(Mode.IDLE)
    assert world.tasks_seen == ["", "plate", "screw", ""]
    world.check_continuous()


def test_an_unknown_movement_activates_nothing():
    world = World()
    world.begin("none")
    world.run(2.0)
    assert world.commands == [] and world.modes == [Mode.IDLE]


def test_a_prediction_of_another_task_is_not_executed():
    world = World()
    world.begin("plate")
    world.activation.take_joint_state(world.now_ns, HOME, np.zeros(7))
    for k in range(1, 10):
        now = world.now_ns + k * STEP_NS
        world.activation.take_tasks(now, now, LABELS, world.probabilities())
        world.activation.take_prediction(now, prediction("screw", world.onset_ns))
        assert world.activation.step(now) is None


def test_stale_or_missing_joint_states_start_nothing():
    world = World()
    world.measures = False
    world.begin("plate")
    world.run(0.5)
    assert world.commands == [] and "stale_joint_states" in world.rejected
    world.measures = True
    world.run(0.1)
    assert world.activation.mode is Mode.EXECUTING


def test_joint_states_going_silent_stop_the_arm():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.measures = False
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "stale_joint_states"


def test_an_arm_pushed_off_its_reference_is_stopped_and_counted():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.2)
    world.push = np.full(7, 0.6)
    world.run_until(Mode.STOPPED)
    assert world.activation.stop_reason == "arm_off_reference"
    assert "arm_off_reference" in world.rejected


def test_an_arm_moved_while_idle_starts_from_where_it_is():
    world = World()
    world.begin("plate")
    world.run_until(Mode.HOMING)
    world.task = "idle"
    world.run_until(Mode.IDLE)
    n = len(world.commands)
    world.push = np.full(7, -0.5)
    world.begin("screw")
    world.run_until(Mode.EXECUTING)
    np.testing.assert_allclose(world.commands[n].plan.positions[0], HOME - 0.5, atol=1e-9)


def test_an_arm_in_motion_by_others_starts_nothing():
    world = World()
    world.begin("plate")
    world.measures = False
    for _ in range(20):
        world.activation.take_joint_state(world.now_ns + STEP_NS, HOME, np.full(7, 0.5))
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
    [
        (0, "zero_stamp"),
        (START_NS - 1, "stamp_not_increasing"),
        (START_NS + 5_000_000_000, "stamp_in_future"),
    ],
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
        assert world.activation.decision.n_for == step * n_bodies
    assert world.rejected == []
    stamp = START_NS + 6 * STEP_NS
    for body in range(n_bodies):  # the newest of one time is what is believed
        p = sure if body < n_bodies - 1 else doubtful
        world.activation.take_tasks(START_NS, stamp, labels, p, evidence + body)
    assert world.activation.decision.candidate == "" and world.rejected == []


def test_the_same_estimate_once_more_is_a_sender_that_is_stuck():
    world = World()
    world.begin("plate")
    for _ in range(8):
        world.activation.take_tasks(START_NS, START_NS, LABELS, world.probabilities())
    assert world.rejected == ["stamp_not_increasing"] * 7
    assert world.activation.decision.n_for == 1


def test_repeated_stamps_count_as_silence():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    stamp = world.now_ns
    world.speaks = False
    for _ in range(60):
        world.activation.take_tasks(world.now_ns, stamp, LABELS, world.probabilities())
        world.step()
    assert world.activation.mode is Mode.STOPPED


def test_malformed_probabilities_raise_and_change_nothing():
    world = World()
    before = world.activation.decision
    for p in (np.array([0.5]), np.array([np.nan, 0.5, 0.5]), np.array([])):
        with pytest.raises(IntentError):
            world.activation.take_tasks(START_NS, START_NS, LABELS, p)
    assert world.activation.decision == before
    world.activation.take_tasks(START_NS, START_NS, LABELS, world.probabilities())
    assert world.rejected == []


def test_reset_sends_the_arm_home_and_does_not_start_the_same_movement_again():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.3)
    world.commands.append(world.activation.reset(world.now_ns))
    assert world.activation.mode is Mode.HOMING
    world.run_until(Mode.IDLE)
    assert Mode.EXECUTING not in world.modes[2:]
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-9)
    world.check_continuous()


def test_halt_brakes_the_arm():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    world.run(0.3)
    command = world.activation.halt(world.now_ns)
    world.commands.append(command)
    assert command.plan.kind == "stop" and world.activation.mode is Mode.IDLE
    assert world.activation.halt(world.now_ns) is None
    world.check_continuous()


def test_without_return_home_it_stays_and_is_idle():
    world = World(return_home=False)
    world.begin("plate")
    world.run_until(Mode.EXECUTING)
    world.run_until(Mode.IDLE)
    world.run(1.0)
    np.testing.assert_allclose(world.arm(), world.commands[-1].plan.end, atol=1e-9)
    assert np.abs(world.arm() - HOME).max() > 0.2


def test_a_clock_that_goes_back_starts_over():
    world = World()
    world.begin("plate", already_s=0.2)
    world.run_until(Mode.EXECUTING)
    assert world.activation.step(world.now_ns - 10_000_000_000) is None
    assert world.activation.mode is Mode.IDLE and "clock_jumped_back" in world.rejected
