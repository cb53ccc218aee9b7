# SPDX-License-Identifier: Apache-2.0
"""A simulated clock, estimator and arm around the activation's state machine."""

import numpy as np

from intent_recognition.activation import Activation, ActivationSettings, Mode, PredictedInteraction
from intent_recognition.kinematics.lwr import LWR_LIMITS
from intent_recognition.motion import make_path, scaled_limits

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
    return PredictedInteraction(label, onset_ns, make_path(times, q, LIMITS), {"rad": end_std})


class World:
    """A clock, an arm that follows its commands exactly, and an estimator that says what it must.

    `task` is what the estimator believes ("idle": none = 1), `onset_ns` when it thinks it began.
    """

    def __init__(self, **settings):
        self.rejected: list[str] = []
        self.said: list[str] = []
        self.activation = Activation(
            ActivationSettings(limits=LIMITS, home=HOME, **settings),
            self._reject,
        )
        self.now_ns = START_NS
        self.commands = []
        self.modes = [Mode.IDLE]
        self.tasks_seen = [""]
        self.task, self.onset_ns = "idle", 0
        self.shift, self.push = 0.0, np.zeros(7)
        self.duration_s, self.end_std = DURATION_S, 0.1
        self.speaks = self.measures = True
        self.rng = np.random.default_rng(0)

    def _reject(self, reason, text):
        self.rejected.append(reason)
        self.said.append(text)

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

    def serve(self, task, already_s=0.8):
        """Begin, until the arm is on its way."""
        self.begin(task, already_s)
        self.run_until(Mode.EXECUTING)

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
                duration = self.duration_s * (1.0 + self.rng.normal(0.0, 0.01))
                predicted = prediction(self.task, self.onset_ns, self.shift, duration, self.end_std)
                self.activation.take_prediction(self.now_ns, predicted)
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

    def until(self, happened, longest_s=20.0):
        for _ in range(round(longest_s * 1e9 / STEP_NS)):
            if happened():
                return
            self.step()
        raise AssertionError(f"not within {longest_s} s: {self.modes}, {self.tasks_seen}")

    def run_until(self, mode, longest_s=20.0):
        self.until(lambda: self.activation.mode is mode, longest_s)

    def go_home(self):
        """Until it is idle at home; all commands on the way there were continuous."""
        self.run_until(Mode.IDLE)
        np.testing.assert_allclose(self.arm(), HOME, atol=1e-9)
        self.check_continuous()

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


def executing(already_s=0.2, **settings):
    """A world whose arm has begun to serve a plate."""
    world = World(**settings)
    world.serve("plate", already_s)
    return world
