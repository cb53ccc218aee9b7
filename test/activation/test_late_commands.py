# SPDX-License-Identifier: Apache-2.0
"""Commands that come late or not at all: what the arm executes keeps its limits all the same.

Messages of one sender arrive in the order in which they were sent, as DDS delivers them.
"""

import sys
from collections import Counter

import numpy as np
import pytest
from activation_world import GOALS, HOME, LIMITS, START_NS, STEP_NS, World, executing
from clearance_world import ARM, FAR_M, person
from scipy.interpolate import CubicHermiteSpline
from simulation import minimum_jerk

from intent_recognition.activation.states import Mode
from intent_recognition.kinematics import JOINT_NAMES, RATE_TOLERANCE
from intent_recognition.motion import JointReference, Separation
from sim_bridge.arm import RejectedTrajectoryError, TrajectoryCommand, TrajectoryFollower

FINE_S = 0.002
"""Between two looks at what is executed [s]."""


class Arm:
    """The simulated arm's follower behind a channel that delays and loses.

    Where it is `at` follows what it executes as real position controllers do: by a lag, and no
    faster than by a top speed.
    """

    def __init__(self, world, rng, latency_s, loss, lag_s=0.0, top_rad_s=np.inf):
        self.follower, self.at = TrajectoryFollower(HOME, LIMITS), HOME
        self._follows = 1.0 if lag_s == 0.0 else 1.0 - np.exp(-FINE_S / lag_s)
        self._top = top_rad_s * FINE_S
        self._world, self._rng, self._latency_s, self._loss = world, rng, latency_s, loss
        self._coming, self._last_s, self.rejected = [], 0.0, []
        self.executed = []

    def sample(self, t):
        return self.follower.sample(t)

    def loses(self, command):
        return self._rng.random() < self._loss

    def send(self, command, now_s):
        if not self.loses(command):
            low, high = self._latency_s
            self._last_s = max(self._last_s, now_s + self._rng.uniform(low, high))
            self._coming.append((self._last_s, command))

    def go_to(self, before_s, now_s):
        """Execute until now; what arrives in between takes over when it arrives."""
        for t in np.arange(before_s, now_s - 1e-9, FINE_S) + FINE_S:
            while self._coming and self._coming[0][0] <= t:
                self._take(self._coming.pop(0)[1], t)
            self.executed.append(self.sample(t))
            step = (self.executed[-1].position - self.at) * self._follows
            self.at = self.at + np.clip(step, -self._top, self._top)

    def _take(self, command, t):
        times_ns, q, v = command.to_send()
        times_s, start_s = (times_ns - times_ns[0]) * 1e-9, times_ns[0] * 1e-9
        try:
            sent = TrajectoryCommand.validated(JOINT_NAMES, times_s, q, v, start_s=start_s, now_s=t)
            self.follower.accept(sent, t)
        except RejectedTrajectoryError as error:
            self.rejected.append(error.reason)

    def use(self):
        """Largest shares of the limits: acceleration, velocity."""
        a = np.array([reference.acceleration for reference in self.executed]) / LIMITS.acceleration
        v = np.array([reference.velocity for reference in self.executed]) / LIMITS.velocity
        return np.array([np.abs(a).max(), np.abs(v).max()])


class ForgetfulArm(Arm):
    """A controller that forgets what it was doing when a message comes, and jumps to that."""

    curve = None

    def sample(self, t):
        if self.curve is None:
            return self.follower.sample(t)
        q = self.curve(np.clip(t, *self.curve.x[[0, -1]]))
        return JointReference.at_rest(q)

    def _take(self, command, t):
        times_ns, q, v = command.to_send()
        self.curve = CubicHermiteSpline(times_ns * 1e-9, q, v)


def run(world, arm, steps):
    for _ in range(steps):
        arm.go_to(world.now_ns * 1e-9, (world.now_ns + STEP_NS) * 1e-9)
        n = len(world.commands)
        world.step()
        for command in world.commands[n:]:
            arm.send(command, world.now_ns * 1e-9)


def session(seed, latency_s, loss, kind=Arm, n=2, noise_rad=0.0, **options):
    """Interactions with an arm behind such a channel, until it is at home again."""
    world, rng, encoders = World(), np.random.default_rng(seed), np.random.default_rng(seed)
    arm = kind(world, rng, latency_s, loss, **options)
    world.arm = lambda: arm.at + encoders.normal(0.0, noise_rad, 7)
    run(world, arm, 30)
    for k in range(n):
        world.begin("screw" if k % 2 else "plate", already_s=rng.uniform(0.0, 0.6))
        run(world, arm, int(rng.integers(150, 350)))
        world.task = "idle"
        for _ in range(40):
            run(world, arm, 100)
            if world.activation.mode is Mode.IDLE:
                break
    run(world, arm, 100)  # a command that was late may still be executed
    return world, arm


@pytest.mark.parametrize(
    ("latency_s", "loss"),
    [((0.0, 0.0), 0.0), ((0.3, 0.3), 0.0), ((0.0, 0.3), 0.0), ((0.2, 0.2), 0.3)],
)
def test_what_is_executed_keeps_the_limits_and_ends_at_home(latency_s, loss):
    world, arm = session(1, latency_s, loss)
    assert np.all(arm.use() <= 1.0 + RATE_TOLERANCE)
    assert world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-3)
    assert world.tasks_seen == ["", "plate", "", "screw", ""]
    late = float(world.activation.arm.clocks["commands late [s]"])
    if loss == 0.0:
        assert (late > 0.0) == (latency_s[1] > 0.0)
        assert ("commands_late" in world.rejected) == (late > 0.0)


@pytest.mark.parametrize(("lag_s", "noise_rad"), [(0.05, 0.0), (0.2, 0.0), (0.1, 0.002)])
def test_an_arm_that_lags_is_not_taken_for_one_that_gets_late_commands(lag_s, noise_rad):
    """Nor is one with coarse encoders."""
    world, _ = session(1, (0.0, 0.0), 0.0, n=1, lag_s=lag_s, noise_rad=noise_rad)
    assert world.rejected == [] and world.activation.arm.clocks["commands late [s]"] == "0.000"
    assert world.activation.mode is Mode.IDLE


def test_an_arm_whose_speed_is_limited_tells_late_commands_too():
    """It is far behind, and stopped where it is too far."""
    slow = {"lag_s": 0.05, "top_rad_s": 0.15}
    world, _ = session(1, (0.0, 0.0), 0.0, n=1, **slow)
    assert "commands_late" not in world.rejected and world.activation.mode is Mode.IDLE
    world, _ = session(1, (0.2, 0.2), 0.0, **slow)
    assert "commands_late" in world.rejected and world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-3)


@pytest.mark.parametrize(("kind", "lag_s"), [(ForgetfulArm, 0.08), (Arm, 0.2)])
def test_commands_to_an_arm_that_lags_may_be_late_besides(kind, lag_s):
    world, _ = session(1, (0.2, 0.2), 0.0, kind, n=1, lag_s=lag_s)
    assert "commands_late" in world.rejected and world.activation.mode is Mode.IDLE


@pytest.mark.parametrize(("lag_s", "latency_s"), [(0.0, 0.0), (0.1, 0.3)])
def test_a_brake_that_is_lost_is_noticed_and_sent_again(lag_s, latency_s):
    world, rng = World(), np.random.default_rng(1)
    arm = Arm(world, rng, (latency_s, latency_s), 0.0, lag_s=lag_s)
    world.arm, world.duration_s = lambda: arm.at, 4.0
    world.begin("plate", already_s=0.0)
    run(world, arm, 140)
    world.speaks = False
    arm.loses = lambda command: command.plan.kind == "stop"
    run(world, arm, 60)
    assert world.activation.stop_reason == "stream_stopped" and "command_lost" not in world.rejected
    arm.loses = lambda command: False
    moves = arm.follower.sample(world.now_ns * 1e-9).velocity
    run(world, arm, 160)
    assert "command_lost" in world.rejected and world.activation.mode is Mode.STOPPED
    assert np.abs(moves).max() > 0.1
    assert np.abs(arm.follower.sample(world.now_ns * 1e-9).velocity).max() < 1e-3
    assert np.all(arm.use() <= 1.0 + RATE_TOLERANCE)


@pytest.mark.parametrize("obeys", [True, False])
def test_a_recording_that_happens_to_follow_seems_late_only_to_who_takes_it_for_an_arm(obeys):
    world = World()
    world.activation.arm.obeys = obeys

    def recorded():
        begun_s = (world.now_ns - START_NS) * 1e-9 - 1.1
        there, back = minimum_jerk(begun_s / 2.0), minimum_jerk((begun_s - 3.5) / 1.5)
        return HOME + there * (1.0 - back) * GOALS["plate"]

    world.arm = recorded
    world.run(0.7)
    world.begin("plate", already_s=0.2)
    world.run(2.0)
    assert ("commands_late" in world.rejected) == obeys


def test_a_recording_in_a_loop_shows_that_it_obeys_nobody_by_moving_unasked():
    """It moves before the task is recognised, and then as a late arm would."""
    world, rng, noise = World(), np.random.default_rng(4), np.random.default_rng(4)
    goal = GOALS["plate"] + rng.normal(0.0, 0.02, 7)
    lasts_s, begins_s = 2.0 * rng.uniform(0.8, 1.2), rng.uniform(-0.2, 0.5)
    back_s = lasts_s + begins_s + rng.uniform(0.5, 1.5)
    onset_ns = world.now_ns + 10**18

    def recorded():
        since_s = (world.now_ns - onset_ns) * 1e-9
        there = minimum_jerk((since_s - begins_s) / lasts_s)
        back = minimum_jerk((since_s - back_s) / 1.5)
        return HOME + there * (1.0 - back) * goal + noise.normal(0.0, 2e-4, 7)

    world.arm = recorded
    world.run(0.5)
    for _ in range(2):
        onset_ns, already_s = world.now_ns, rng.uniform(0.2, 0.8)
        world.run(already_s)
        world.begin("plate", already_s)
        world.run(max(lasts_s + 0.2 - already_s, 0.5))
        world.task = "idle"
        world.run(back_s + 2.0 - lasts_s)
    assert "arm_moving" in world.rejected and "commands_late" not in world.rejected


def test_a_brake_that_is_lost_is_sent_again_to_an_arm_that_does_not_go_home():
    """After a reset it is idle, and begins nothing else meanwhile."""
    world, rng = World(return_home=False), np.random.default_rng(1)
    arm = Arm(world, rng, (0.0, 0.0), 0.0)
    world.arm, world.duration_s = lambda: arm.at, 4.0
    world.begin("plate", already_s=0.0)
    run(world, arm, 140)
    world.task = "idle"
    world.commands.append(world.activation.reset(world.now_ns))  # lost
    run(world, arm, 140)
    assert "command_lost" in world.rejected and world.activation.mode is Mode.IDLE
    assert np.abs(arm.follower.sample(world.now_ns * 1e-9).velocity).max() < 1e-3


def test_an_arm_that_is_held_on_its_way_is_not_taken_for_one_that_gets_late_commands():
    world = executing()
    world.run(0.5)
    at, follow = world.arm(), world.arm
    world.arm = lambda: at
    world.run(0.3)
    world.arm = follow
    world.run(2.0)
    assert world.rejected == [] and world.activation.mode is Mode.EXECUTING


def test_once_lateness_is_known_a_controller_that_forgets_goes_on_without_a_jump():
    """All it executes in the second interaction is what is in force, as commands lead by enough."""
    world, arm = session(0, (0.2, 0.2), 0.0, ForgetfulArm)
    home = next(c for c in world.commands if c.plan.kind == "home")
    interactions = (c for c in world.commands if c.plan.kind == "interaction")
    begun = next(c for c in interactions if c.start_ns > home.start_ns)
    compared = 0
    for k, executed in enumerate(arm.executed):
        time_ns = START_NS + round((k + 1) * FINE_S * 1e9)
        if time_ns > begun.start_ns:
            np.testing.assert_allclose(
                executed.position, world.reference(time_ns).position, atol=1e-5
            )
            compared += 1
    assert compared > 500


if __name__ == "__main__":
    for latency_s in ((0.0, 0.0), (0.1, 0.1), (0.2, 0.2), (0.3, 0.3), (0.0, 0.3)):
        for loss in (0.0, 0.1, 0.3):
            got = [session(seed, latency_s, loss) for seed in range(int(sys.argv[1]))]
            largest = np.array([arm.use() for _, arm in got]).max(axis=0)
            home = sum(np.abs(world.arm() - HOME).max() < 1e-3 for world, _ in got)
            rejected = Counter(reason for world, _ in got for reason in world.rejected)
            rejected.update(reason for _, arm in got for reason in arm.rejected)
            print(latency_s, loss, largest.round(4), f"{home} at home", dict(rejected), flush=True)


def test_a_quicker_way_that_is_lost_is_planned_again():
    """The arm goes on slowly; people have not moved since the quicker way was planned."""
    world, rng = World(separation=Separation(ARM)), np.random.default_rng(1)
    arm = Arm(world, rng, (0.0, 0.0), 0.0)
    world.arm = lambda: arm.at
    world.begin("plate", already_s=0.0)
    run(world, arm, 300)
    world.task = "idle"
    near = ARM.forward_kinematics(HOME + 0.6 * GOALS["plate"])[:3, 3] + [0.0, 0.0, 0.05]
    world.activation.take_people((person(near),))
    run(world, arm, 100)
    assert world.commands[-1].way.slowed
    world.activation.take_people((person(FAR_M),))
    arm.loses = lambda command: True
    run(world, arm, 20)
    arm.loses, (*_, slow, lost) = lambda command: False, world.commands
    run(world, arm, 100)
    newest = world.commands[-1]
    assert "command_lost" in world.rejected
    assert newest is not lost and newest.end_ns < slow.end_ns - 1_000_000_000
