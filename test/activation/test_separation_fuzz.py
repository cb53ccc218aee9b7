# SPDX-License-Identifier: Apache-2.0
"""No command is faster near people than permitted, at any millisecond of it.

`PYTHONPATH=.:test python test/activation/test_separation_fuzz.py 100000 [SEED]` runs so many steps.
"""

import sys
from dataclasses import replace

import numpy as np
import pytest
from activation_world import HOME, START_NS, World
from clearance_world import ARM

from intent_recognition.activation import slowing
from intent_recognition.motion import Separation, SeparationSettings, plan_interaction
from intent_recognition.motion.separation import PredictedPerson, permitted_speed

SEPARATION = Separation(ARM)
END = ARM.skeleton(HOME[None] + 0.4)[0, -1]
MS_NS = 1_000_000
TUBE_NS = np.arange(0, 3_000_000_000, 100 * MS_NS)
REACTION_NS = 100 * MS_NS
"""After it comes what is known [ns]: the next update, and the lead of a command (T_r)."""
NOT_PACED = ("stop", "yield")
"""Kinds of plans that are not slowed: a brake is as fast as it can be, and a hand leads the arm."""


class RecordingWorld(World):
    """Keeps when commands were sent."""

    def __init__(self, **settings):
        super().__init__(**settings)
        self.sent = []

    def step(self):
        n, before_ns = len(self.commands), self.now_ns
        super().step()
        self.sent += [(before_ns, command) for command in self.commands[n:]]


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


KINDS = ("stands", "crosses", "approaches", "late", "flickers", "uncertain", "several")


def speeds(command, until_ns):
    """Every millisecond of what is executed of a command [ns], the arm's points, their speed."""
    times_ns = np.arange(command.start_ns, min(until_ns, command.end_ns), MS_NS)
    q = command.plan.sampled((times_ns - command.start_ns) * 1e-9)[0]
    points = ARM.skeleton(q)
    return times_ns, points, np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1) / 1e-3


def ratios(times_ns, points, speed, people):
    """Of the speed of the arm's points to the permitted one, by the difference of milliseconds."""
    found = np.zeros(len(speed))
    for person in people:
        distance_m = SEPARATION.distance_m(points, times_ns, person)
        permitted = permitted_speed(distance_m, SEPARATION.settings)
        found = np.maximum(found, speed / np.maximum(permitted[1:], permitted[:-1]))
    return found


def largest_ratios(world, known):
    """Of what is executed, brakes left out: by what was known when it was planned, and since.

    The second counts by what of the last `REACTION_NS` permits the most.

    Args:
        known: (when, people) in the order in which they were taken.
    """
    planned = since = 0.0
    starts = [command.start_ns for command in world.commands] + [sys.maxsize]
    taken = [when for when, _ in known] + [sys.maxsize]
    for (sent_ns, command), until_ns in zip(world.sent, starts[1:], strict=True):
        times_ns, points, speed = speeds(command, until_ns)
        if len(times_ns) < 2 or command.plan.kind in NOT_PACED:
            continue
        least = np.full(len(speed), np.inf)
        for (when, people), next_ns in zip(known, taken[1:], strict=True):
            counts = (times_ns[1:] >= when) & (times_ns[1:] - REACTION_NS < next_ns)
            if counts.any() or when <= sent_ns < next_ns:
                found = ratios(times_ns, points, speed, people)
                least = np.where(counts, np.minimum(least, found), least)
                if when <= sent_ns < next_ns:
                    planned = max(planned, float(found.max()))
        since = max(since, float(least.max()))
    return planned, since


def session(kind, seed, n_steps):
    """Random tasks near people of a kind: the world, and what was known when."""
    rng = np.random.default_rng(seed)
    kinds = rng.choice(KINDS[:-1], 3) if kind == "several" else [kind]
    world, people = RecordingWorld(separation=SEPARATION), [Person(each, rng) for each in kinds]
    known = []
    for k in range(n_steps):
        if k % 4 == 0:
            predicted = [person.predicted(world.now_ns) for person in people]
            known.append((world.now_ns, tuple(one for one in predicted if one is not None)))
            world.activation.take_people(known[-1][1])
        if k == 20 or rng.random() < 0.004:
            world.begin(rng.choice(["plate", "screw"]), rng.uniform(0.0, 0.6))
        elif rng.random() < 0.003:
            world.task = "idle"
        world.step()
    if world.commands:
        world.check_continuous()
    return world, known


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed"), [(kind, 1 + (kind in ("approaches", "several"))) for kind in KINDS]
)
def test_no_command_is_faster_than_permitted_at_any_millisecond(kind, seed, monkeypatch):
    """Of sessions in which the arm is slowed by people, or braked for them.

    Seven plans, each slower than the last, do not get past who stands there too late to be evaded:
    an arm that has braked does not plan at each step.
    """
    plans = []
    monkeypatch.setattr(
        slowing, "plan_interaction", lambda *way: plans.append(way) or plan_interaction(*way)
    )
    world, known = session(kind, seed, 500)
    counts = world.activation.counts
    assert counts["slowed by person"] + counts["braked for person"] > 0
    assert len(world.commands) > 5
    assert max(largest_ratios(world, known)) <= 1.0 + 1e-6
    if kind == "late":
        assert counts["braked for person"] == 1 and len(plans) < 500


def test_a_motion_slows_while_another_task_that_is_recognised_cannot_begin():
    """Somebody comes to the arm when the task changes: there is no way along which to begin.

    The other task begins once the arm has braked, no faster than permitted.
    """
    world = RecordingWorld(separation=SEPARATION)
    world.begin("plate", already_s=0.3)
    world.run(0.7)
    hand = ARM.skeleton(world.arm()[None])[0, -1]
    person = PredictedPerson(world.now_ns + TUBE_NS[:1], hand[None], np.zeros(1))
    world.activation.take_people((person,))
    known = [(START_NS, ()), (world.now_ns, (person,))]
    world.begin("screw", already_s=0.0)
    world.run(1.0)
    assert world.rejected.count("infeasible") > 2 and world.tasks_seen[:2] == ["", "plate"]
    assert max(largest_ratios(world, known)) <= 1.0 + 1e-6


def test_a_motion_under_way_slows_when_more_separation_is_asked_for():
    """Nothing new is known of the person meanwhile."""
    world = RecordingWorld(separation=SEPARATION)
    person = PredictedPerson(START_NS + TUBE_NS[:1], END[None] + [0.0, 0.0, 0.8], np.zeros(1))
    world.activation.take_people((person,))
    world.begin("plate", already_s=0.3)
    world.run(0.9)
    world.speaks = False
    wider = Separation(ARM, SeparationSettings(intrusion_m=0.5))
    world.activation.change(replace(world.activation._parts.settings, separation=wider))
    world.run(0.2)
    command = world.commands[-1]
    assert world.sent[-1][0] > START_NS + 900 * MS_NS
    assert command.plan.kind == "stop" or wider.excess(command.plan, command.start_ns, person) <= 1


if __name__ == "__main__":
    left, seed = map(int, [*sys.argv[1:], 100][:2])
    while left > 0:
        for kind in KINDS:
            world, known = session(kind, seed, 1000)
            counts, (planned, since) = world.activation.counts, largest_ratios(world, known)
            often = {key: counts[f"{key} person"] for key in ("slowed by", "braked for")}
            text = f"{kind} {seed}: {planned:.4f} {since:.4f}, {len(world.commands)} commands"
            print(text, often, flush=True)
            left -= 1000
        seed += 1
