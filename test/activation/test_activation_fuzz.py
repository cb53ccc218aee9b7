# SPDX-License-Identifier: Apache-2.0
"""Random faults around the activation: whatever happens, its commands are safe to execute.

Run as a program, with `test` on the path, it takes so many steps as it is told, each 2500 of
another seed (docs/reliability.md).
"""

import sys
from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from activation_world import HOME, LABELS, LIMITS, START_NS
from clearance_world import accept
from hermite import cubic, hermite
from simulation import make_library

from intent_recognition.activation import Activation, ActivationSettings, Mode, PredictedInteraction
from intent_recognition.activation.arm_tracking import HELD_WITHIN_RAD
from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.composing import Moment, Step, ViaPoint, advance, awaited, bend_all
from intent_recognition.composing.sequences import Condition, SequenceProgress
from intent_recognition.errors import IntentError
from intent_recognition.motion import Correction, DeviationDetector, Spread, make_path

STEPS = 2500
MOVED_RAD = 0.05
"""An arm that is nearer to its reference than this was not moved by others."""
SHARES = np.linspace(0.0, 1.0, 13)[:, None, None]
DETECTOR = DeviationDetector(np.zeros((3, 7)), np.full(7, 1e-3), 0.5, 0.05)
SEQUENCES = {
    "toolbox": (
        Step("plate"),
        Step("screw", Condition(after_s=0.3), 20.0),
        Step("screw", Condition(rest_s=0.2), 20.0),
        Step("plate", Condition(after_s=0.0), 5.0),
    )
}


@cache
def library():
    """Tasks that are known beforehand: of sequences, via points and corrections."""
    return make_library(np.random.default_rng(0), n_controlled=7)


@cache
def spreads():
    return {
        label: Spread.given_person(library().primitive(k)) for k, label in enumerate(LABELS[:2])
    }


def place(command, time_ns):
    """Position and velocity that a command asks for at a time."""
    plan, at_s = command.plan, (time_ns - command.start_ns) * 1e-9
    return hermite(plan.times_s, plan.positions, plan.velocities, at_s)


class Fuzz:
    """An arm that executes the commands, an estimator and people who do what they like."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        start = HOME + rng.uniform(-0.2, 0.2, 7)
        self.rejected = []
        correction = Correction(DETECTOR, spreads() if rng.random() < 0.8 else {})
        self.settings = ActivationSettings(
            limits=LIMITS,
            correction=correction if rng.random() < 0.7 else None,
            home=HOME if rng.random() < 0.7 else None,
            pretrigger=PretriggerSettings(0.5, 3.0, {"plate": HOME + 0.3, "screw": HOME - 0.2}),
        )
        self.activation = Activation(
            self.settings, lambda reason, text: self.rejected.append(reason)
        )
        self.now_ns = START_NS
        self.commands, self.sent, self.n_commands = [], [], 0
        self.rest, self.push = start, np.zeros(7)
        self.pushed_at_ns = self.moving_ns = 0
        self.task, self.onset_ns, self.shape = "idle", 0, None
        self.speaks = self.measures = True
        self.has_velocity = rng.random() < 0.6
        self.last_q = start
        self.held = None
        self.progress, self.follows_sequence = SequenceProgress(), rng.random() < 0.5
        self.modes = set()

    def reference(self, time_ns):
        """Position and velocity the controller is at, by the commands sent to it alone."""
        for command in reversed(self.commands):
            if time_ns >= command.start_ns:
                return place(command, time_ns)
        return self.rest, np.zeros(7)

    def arm(self):
        """Where the arm is, and its velocity: a person may hold it."""
        q, v = self.reference(self.now_ns)
        return (q + self.push, v) if self.held is None else (self.held, np.zeros(7))

    def step(self):
        rng = self.rng
        self.now_ns += int(rng.choice([2e6, 1e7, 1e7, 2e7, 4e7]))
        if rng.random() < 0.005:
            self.now_ns += int(rng.uniform(0.1e9, 3e9))
        if rng.random() < 0.04:
            self.happen()
        if self.measures:
            self.measure()
        if self.speaks:
            self.speak()
        if self.follows_sequence:
            self.run_sequence()
        self.take(self.activation.step(self.now_ns))
        self.modes.add(self.activation.mode)

    def happen(self):
        """One of the things that can happen."""
        rng = self.rng
        (kind,) = rng.choice(
            ["task"] * 8
            + ["push"] * 2
            + ["release"] * 10
            + ["hold", "lead"] * 3
            + ["order"] * 8
            + ["speaks", "measures", "velocity", "halt", "reset", "settings", "clock", "next"],
            1,
        )
        if kind == "task":
            self.task = str(rng.choice(["plate", "screw", "none", "idle", "idle", "idle"]))
            self.onset_ns = self.now_ns - round(rng.uniform(0.1, 1.0) * 1e9)
            self.shape = self.draw_shape()
        elif kind == "push":
            size = rng.choice([0.003, 0.04, 0.3, 0.8, 3.0])
            self.push = rng.uniform(-size, size, 7) * (rng.random(7) < 0.4)
        elif kind == "hold":
            size = rng.choice([0.003, 0.04, 0.3, 0.8])
            self.held = self.arm()[0] + rng.uniform(-size, size, 7) * (rng.random(7) < 0.4)
        elif kind == "lead" and self.held is not None:
            self.held = self.held + rng.normal(0.0, 0.05, 7)
        elif kind == "order":
            self.activation.inbox.order(self.draw_order() if rng.random() < 0.9 else None)
        elif kind == "release":
            self.push, self.held = np.zeros(7), None
            self.speaks = self.measures = True
        elif kind in ("speaks", "measures"):
            setattr(self, kind, False)
        elif kind == "velocity":
            self.has_velocity = not self.has_velocity
        elif kind == "halt":
            self.take(self.activation.halt(self.now_ns))
        elif kind == "reset":
            self.take(self.activation.reset(self.now_ns))
        elif kind == "settings":
            home = HOME + rng.uniform(-0.3, 0.3, 7)
            if self.activation.mode is Mode.IDLE:
                self.activation.change(
                    replace(
                        self.settings,
                        home=home,
                        return_home=bool(rng.random() < 0.8),
                        lead_s=float(rng.choice([0.0, 0.02, 0.05, 0.1])),
                    )
                )
        elif kind == "clock" and rng.random() < 0.3:
            self.rest, self.commands = self.arm()[0], []
            self.push, self.held, self.progress = np.zeros(7), None, SequenceProgress()
            self.now_ns -= int(rng.uniform(1e9, 1e11))
            self.onset_ns = self.now_ns
            assert self.activation.step(self.now_ns) is None
        elif kind == "next":
            p = np.array([0.8, 0.15, 0.05]) if rng.random() < 0.5 else np.array([0.1, 0.8, 0.1])
            self.activation.pretrigger.take_expectation(self.now_ns, LABELS, p)

    def draw_order(self):
        """A task to begin without recognition: drawn, or what is known of it through via points."""
        rng = self.rng
        task = int(rng.integers(2))
        if rng.random() < 0.3:
            times, q = self.draw_shape()
        else:
            times, q = self.through_points(task)
        end_std = {"rad": float(rng.choice([0.1, 0.1, 5.0]))}
        return PredictedInteraction(LABELS[task], 0, make_path(times, q, LIMITS), end_std)

    def through_points(self, task):
        """A task on average, through a via point where that can be."""
        rng, known = self.rng, library()
        mean = known.primitive(task).predict_controlled(50)
        dof, phase = int(rng.integers(7)), float(rng.uniform(0.2, 1.0))
        value = mean.positions[round(phase * 49), dof] + rng.normal(0.0, 0.1)
        point = ViaPoint("v", {f"robot_{dof}": (value,)}, (0.01,), phase, None, known.labels[task])
        with suppress(IntentError):  # too far for what is known of the task
            mean = bend_all(known, [point]).primitive(task).predict_controlled(50)
        return mean.times_s - mean.times_s[0], HOME + mean.positions

    def run_sequence(self):
        """As the sequences' node does: orders the next step where its condition holds."""
        activation = self.activation
        known = activation.counts["started"], activation.active_task, activation.arrived
        moment = Moment(self.now_ns * 1e-9, *known, 1.0 * activation.inbox.decision.idle)
        self.progress = advance(SEQUENCES, self.progress, moment)
        if self.progress.ordered and activation.inbox.ordered is None:
            task = LABELS.index(awaited(SEQUENCES, self.progress).task)
            times, q = self.through_points(task)
            path = make_path(times, q, LIMITS)
            activation.inbox.order(PredictedInteraction(LABELS[task], 0, path, {"rad": 0.1}))

    def draw_shape(self):
        """A way to somewhere, also outside the limits, slow or too fast, of few points or many."""
        rng = self.rng
        n = int(rng.choice([3, 8, 50, 200]))
        s = np.linspace(0.0, 1.0, n)[:, None]
        blend = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        size = rng.choice([0.1, 0.4, 1.0, 3.0])
        duration_s = float(rng.choice([0.4, 1.0, 2.0, 2.0, 4.0, 40.0]))
        at, width = rng.uniform(0.2, 0.8, 7), rng.uniform(0.5, 2.0, 7) / duration_s
        via = rng.normal(0.0, size, 7) * np.exp(-0.5 * ((s - at) / width) ** 2)
        q = HOME + blend * rng.normal(0.0, size, 7) + (via if rng.random() < 0.5 else 0.0)
        return s[:, 0] * duration_s, q

    def measure(self):
        """A joint state, at times with a stamp or velocity that is wrong."""
        rng, (q, v) = self.rng, self.arm()
        if self.push.any() and rng.random() < 0.2:
            self.push = self.push + rng.normal(0.0, 2e-4, 7)
        if rng.random() < 0.02:
            wrong_s = rng.choice([-100.0, -0.3, -0.02, 0.3, 0.9, 5.0, 1e6])
            self.take_joints(self.now_ns + round(wrong_s * 1e9), q, v)
        else:
            self.take_joints(self.now_ns, q, v)
        self.last_q = q

    def take_joints(self, stamp_ns, q, v):
        velocity = v if self.has_velocity else None
        self.activation.take_joint_state(stamp_ns, q, velocity, now_ns=self.now_ns)

    def speak(self):
        """What the estimator believes now."""
        rng = self.rng
        p = np.full(3, 0.02)
        p[LABELS.index("none" if self.task == "idle" else self.task)] = 0.96
        if self.task == "idle":
            p = np.array([0.0, 0.0, 1.0])
        elif rng.random() < 0.05:
            p = rng.dirichlet(np.ones(3))
        self.activation.take_tasks(self.now_ns, self.now_ns, LABELS, p)
        if self.task in ("plate", "screw") and rng.random() < 0.3:
            times, q = self.shape
            q = q + rng.normal(0.0, 0.004, 7) * np.linspace(0.0, 1.0, len(q))[:, None]
            path = make_path(times * (1.0 + rng.normal(0.0, 0.01)), q, LIMITS)
            self.activation.take_prediction(
                self.now_ns, PredictedInteraction(self.task, self.onset_ns, path, {"rad": 0.1})
            )

    def take(self, command):
        """Execute a command, after a look at whether that is safe."""
        if command is None:
            return
        self.n_commands += 1
        q, v = check_curve(command.plan)
        assert command.start_ns >= self.now_ns
        before_q, before_v = self.reference(command.start_ns)
        same = np.abs(q - before_q).max() <= 1e-9 and np.abs(v - before_v).max() <= 1e-8
        if self.commands:
            assert command.start_ns >= self.commands[-1].start_ns
        if not same:  # then from the arm, at rest, where others moved it
            assert not v.any() and not self.reference(self.now_ns)[1].any()
            off = np.abs(q - self.last_q).max()  # one that is held where an earlier one has it
            earlier = [np.abs(q - place(one, command.start_ns)[0]).max() for one in self.sent]
            assert off <= 1e-9 or (off <= HELD_WITHIN_RAD and min(earlier) <= 1e-9)
            moved = np.abs(self.last_q - before_q).max() > MOVED_RAD
            assert moved or not self.commands
            self.rest, self.push, self.commands = q, np.zeros(7), []
        accept(command.plan, np.stack([self.last_q, self.reference(self.now_ns)[0]]))
        self.commands = [*self.commands[-3:], command]
        self.sent = [*self.sent[-7:], command]


def check_curve(plan):
    """Inside all limits everywhere, to rest inside them; returns its first position, velocity."""
    h = np.diff(plan.times_s)[:, None]
    assert np.all(h > 0.0) and np.all(np.isfinite(plan.positions))
    ends = plan.positions[:-1], plan.positions[1:], plan.velocities[:-1], plan.velocities[1:]
    q, v, a = cubic(SHARES, h, *ends)
    first, last = plan.positions[0], plan.positions[-1]
    outside = np.maximum(np.maximum(LIMITS.lower - first, first - LIMITS.upper), 0.0)
    room = outside + 1e-9
    assert np.all(q >= LIMITS.lower - room) and np.all(q <= LIMITS.upper + room)
    if plan.kind != "stop" or not outside.any():
        assert np.all(last >= LIMITS.lower - 1e-9) and np.all(last <= LIMITS.upper + 1e-9)
    assert np.all(np.abs(v) <= LIMITS.velocity * (1.0 + 2e-6))
    assert np.all(np.abs(a) <= LIMITS.acceleration * (1.0 + 2e-6))
    assert not plan.velocities[-1].any()
    return first, plan.velocities[0]


def run(seed, steps=STEPS):
    """So many random steps, ending at rest once nothing happens any more."""
    fuzz = Fuzz(seed)
    for _ in range(steps):
        fuzz.step()
    end_ns = fuzz.commands[-1].end_ns if fuzz.commands else 0
    assert not fuzz.reference(max(end_ns, fuzz.now_ns))[1].any()
    return fuzz


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 5, 6])
def test_random_faults_never_make_an_unsafe_command(seed):
    fuzz = run(seed)
    assert fuzz.n_commands > 20
    assert fuzz.modes >= set(Mode) - {Mode.PRETRIGGERED}


if __name__ == "__main__":
    n_seeds = int(sys.argv[1]) // STEPS
    total = sum(run(seed).n_commands for seed in range(100, 100 + n_seeds))
    print(f"{n_seeds * STEPS} steps, {total} commands, all safe")
