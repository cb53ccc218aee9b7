# SPDX-License-Identifier: Apache-2.0
"""No command is faster near the person than permitted, at any millisecond of it.

`PYTHONPATH=.:test python test/activation/test_separation_fuzz.py 100000` runs so many steps.
"""

import sys

import numpy as np
import pytest
from activation_world import HOME, START_NS, World
from clearance_world import ROBOT

from intent_recognition.kinematics import Arm
from intent_recognition.motion import PredictedPerson, Separation
from intent_recognition.motion.separation import permitted_speed

ARM = Arm.from_urdf(ROBOT.description)
SEPARATION = Separation(ARM)
END = ARM.skeleton(HOME[None] + 0.4)[0, -1]
MS_NS = 1_000_000
TUBE_NS = np.arange(0, 3_000_000_000, 100 * MS_NS)
NOT_PACED = ("stop", "yield")
"""Kinds of plans that are not slowed: a brake is as fast as it can be, and a hand leads the arm."""


class Person:
    """Somebody near the arm, of one kind, predicted from now on as it will be."""

    def __init__(self, kind, rng):
        self.kind, self.rng = kind, rng
        self.at = END + rng.normal(0.0, 0.15, 3)
        self.way = rng.normal(0.0, 1.0, 3) * np.array([1.0, 1.0, 0.2])
        self.way /= np.linalg.norm(self.way)
        self.speed, self.since_ns = rng.uniform(0.2, 1.6), START_NS + int(rng.uniform(0, 6e9))

    def positions(self, times_ns):
        since_s = np.asarray(times_ns - self.since_ns, float)[:, None] * 1e-9
        if self.kind == "crosses":
            return self.at + self.way * self.speed * since_s
        if self.kind == "approaches":
            return self.at + self.way * self.speed * np.maximum(2.0 / self.speed - since_s, 0.0)
        return np.tile(self.at, (len(times_ns), 1))

    def predicted(self, now_ns):
        times_ns = now_ns + TUBE_NS
        std = np.zeros(len(times_ns))
        if self.kind == "late":
            if now_ns < self.since_ns:
                return None
        elif self.kind == "flickers":
            if self.rng.random() < 0.5:
                times_ns = times_ns[:2]
                return PredictedPerson(times_ns, np.tile(self.at + 3.0, (2, 1)), np.zeros(2))
        elif self.kind == "uncertain":
            std = np.abs(self.rng.normal(0.0, 0.1)) * np.linspace(0.2, 1.0, len(times_ns))
        return PredictedPerson(times_ns, self.positions(times_ns), std)


KINDS = ("stands", "crosses", "approaches", "late", "flickers", "uncertain")


def ratios(command, person, until_ns):
    """Of the speed of the arm's points to the permitted one, by the difference of milliseconds."""
    times_ns = np.arange(command.start_ns, min(until_ns, command.end_ns), MS_NS)
    if len(times_ns) < 2:
        return np.zeros(1)
    q = command.plan.sampled((times_ns - command.start_ns) * 1e-9)[0]
    points = ARM.skeleton(q)
    speed = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1) / 1e-3
    permitted = permitted_speed(
        SEPARATION.distance_m(points, times_ns, person), SEPARATION.settings
    )
    return speed / np.maximum(permitted[1:], permitted[:-1])


def largest_ratio(kind, seed, n_steps):
    """Over random tasks, each command until the next one, by the person it was planned with."""
    rng = np.random.default_rng(seed)
    world, person = World(separation=SEPARATION), Person(kind, rng)
    known, worst = None, 0.0
    commands = []
    for k in range(n_steps):
        if k % 4 == 0:
            known = person.predicted(world.now_ns)
            world.activation.take_person(known)
        if k == 20 or rng.random() < 0.004:
            world.begin(rng.choice(["plate", "screw"]), rng.uniform(0.0, 0.6))
        elif rng.random() < 0.003:
            world.task = "idle"
        n = len(world.commands)
        world.step()
        commands += [(command, known) for command in world.commands[n:]]
    starts = [command.start_ns for command, _ in commands] + [sys.maxsize]
    for (command, who), end_ns in zip(commands, starts[1:], strict=True):
        if who is not None and command.plan.kind not in NOT_PACED:
            worst = max(worst, float(ratios(command, who, end_ns).max()))
    if commands:
        world.check_continuous()
    return worst, len(commands), world.activation.counts


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_command_is_faster_than_permitted_at_any_millisecond(kind):
    worst, n_commands, _ = largest_ratio(kind, 1, 500)
    assert n_commands > 5
    assert worst <= 1.0 + 1e-6


if __name__ == "__main__":
    left, seed = int(sys.argv[1]), 100
    while left > 0:
        for kind in KINDS:
            worst, n_commands, counts = largest_ratio(kind, seed, 1000)
            often = {key: counts[f"{key} person"] for key in ("slowed by", "braked for")}
            print(f"{kind} {seed}: {worst:.4f}, {n_commands} commands, {often}", flush=True)
            left -= 1000
        seed += 1
