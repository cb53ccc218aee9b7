# SPDX-License-Identifier: Apache-2.0
"""Reaches of the coworker with boxes in the arm's way, for estimator, activation and arm.

A run is one reach with one or two boxes, executed in physics without and with the guard, as the
nodes do it, with a clock of 100 Hz.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from experiments.clearance.distances import BulletCell
from experiments.execution import Executed, execute
from experiments.reaches import REST_S, STEP_NS, toolbox_recordings, watch_reach
from experiments.settings import Settings
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import LWR_LIMITS, Bodies, Box
from intent_recognition.learning import learn
from intent_recognition.motion import Clearance, Spread, scaled_limits
from sim_bridge.arm import Robot, find_robot

N_REACHES, N_BOXES = 40, 5
"""Reaches, and draws of boxes for each of them."""
N_QUICK = (3, 2)
CLEARANCE_M = 0.02
ARRIVED_M = 0.01
"""Distance from its resting place within which the hand has arrived [m]."""


class ClearanceRun(NamedTuple):
    """One reach with boxes, in physics.

    Attributes:
        task: of the reach.
        boxes: in the way.
        free: without boxes.
        unguarded: with boxes that the activation does not know.
        guarded: with boxes that it knows.
        free_m: least distance of the arm without boxes from where they stand [m], by PyBullet;
            negative inside.
        guarded_m: least distance of the guarded arm from the boxes [m]; negative inside.
    """

    task: str
    boxes: tuple[Box, ...]
    free: Executed
    unguarded: Executed
    guarded: Executed
    free_m: float
    guarded_m: float

    @property
    def outcome(self) -> str:
        """`as before`, `bent`, `replanned` (at any time) or `refused`."""
        if not self.guarded.interacting:
            return "refused"
        ways = (how for how in ("replanned", "bent") if self.guarded.counts.get(how))
        return next(ways, "as before")

    @property
    def lost_s(self) -> float:
        """How much later the guarded arm arrives than without boxes; infinite if it does not."""
        return arrival_s(self.guarded) - arrival_s(self.free)

    @property
    def off_m(self) -> float:
        """Distance from the free to the guarded hand's end [m]; NaN if it took no part."""
        ends = [done.hand_m[done.interacting - 1] for done in (self.free, self.guarded)]
        return float(np.linalg.norm(ends[1] - ends[0])) if self.guarded.interacting else np.nan


class ClearanceStudy(NamedTuple):
    """All runs, and those that a guard without replanning refuses.

    Attributes:
        runs: of each reach with each draw of boxes.
        refused: numbers of the runs in which a guard that only bends refuses.
        self_contacts: contacts of the arm with itself in the guarded runs.
    """

    runs: tuple[ClearanceRun, ...]
    refused: tuple[int, ...]
    self_contacts: int


def investigate(settings: Settings) -> ClearanceStudy:
    """Draw reaches and boxes, run each without and with the guard."""
    library, limits = learn(toolbox_recordings(settings)), scaled_limits(LWR_LIMITS)
    robot = find_robot("lwr")
    spreads = {label: Spread.of(library.primitive(k)) for k, label in enumerate(library.labels)}
    itself = Bodies(robot.description, robot.joint_names, clearance_m=1e-3)
    n_reaches, n_boxes = N_QUICK if settings.quick else (N_REACHES, N_BOXES)
    runs: list[ClearanceRun] = []
    refused: list[int] = []
    self_contacts = 0
    for k in range(n_reaches):
        rng = np.random.default_rng([settings.seed, 91, k])
        watched = watch_reach(library, k, rng, limits)
        perform = partial(execute, watched, library, limits, None, goes_home=True)
        free = perform(_noise(settings, k))
        for j in range(n_boxes):
            settings.progress(0.05 + 0.9 * (k + j / n_boxes) / n_reaches, f"reach {k + 1}")
            boxes = draw_boxes(rng, robot, free)
            bodies = Bodies(robot.description, robot.joint_names, boxes, clearance_m=CLEARANCE_M)
            unguarded = perform(_noise(settings, k), boxes=boxes)
            guard = Clearance(bodies, spreads)
            guarded = perform(_noise(settings, k), boxes=boxes, clearance=guard)
            if guarded.counts.get("replanned") or not guarded.interacting:
                bends = Clearance(bodies, spreads, replan_budget_s=0.0)
                bent = perform(_noise(settings, k), boxes=boxes, clearance=bends)
                if not bent.interacting:
                    refused.append(len(runs))
            self_contacts += len(itself.contacts(guarded.positions))
            nearest = nearest_m(robot, boxes, (free.positions, guarded.positions))
            runs.append(ClearanceRun(watched.task, boxes, free, unguarded, guarded, *nearest))
    return ClearanceStudy(tuple(runs), tuple(refused), self_contacts)


def _noise(settings: Settings, k: int) -> np.random.Generator:
    """Of the arm's sensors in reach number k, the same in all its runs."""
    return np.random.default_rng([settings.seed, 92, k])


def arrival_s(done: Executed) -> float:
    """Time from the onset to the hand's arrival, before it goes home; infinite if it never left."""
    if not done.interacting:
        return np.inf
    hand = done.hand_m[: done.interacting]
    far = np.flatnonzero(np.linalg.norm(hand - hand[-1], axis=1) > ARRIVED_M)
    return (far[-1] + 1) * STEP_NS * 1e-9 - REST_S if far.size else np.inf


def draw_boxes(rng: np.random.Generator, robot: Robot, free: Executed) -> tuple[Box, ...]:
    """One or two boxes beside or in the way of the hand of a free run, clear of where it starts
    and ends.
    """
    hand = free.hand_m[: free.interacting]
    ends = free.positions[[0, free.interacting - 1]]
    moved = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(hand, axis=0), axis=1)])
    boxes: list[Box] = []
    n = int(rng.integers(1, 3))
    while len(boxes) < n:
        at = hand[int(np.searchsorted(moved, rng.uniform(0.2, 0.8) * moved[-1]))]
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        size = rng.uniform(0.05, 0.2, 3)
        center = at + direction * (0.05 + size.max() / 2.0 + rng.uniform(-0.03, 0.12))
        turn = rng.uniform(-np.pi, np.pi) / 2.0
        quaternion = (0.0, 0.0, float(np.sin(turn)), float(np.cos(turn)))
        box = Box(f"box {len(boxes) + 1}", tuple(center), tuple(size), quaternion)
        bodies = Bodies(robot.description, robot.joint_names, [box], clearance_m=2 * CLEARANCE_M)
        if not any(bodies.contacts(ends[k : k + 1]) for k in range(2)):
            boxes.append(box)
    return tuple(boxes)


def nearest_m(robot: Robot, boxes: Sequence[Box], ways: Sequence[Floats]) -> tuple[float, ...]:
    """Least distance from a box on each of some joint paths (T, 7) [m], by PyBullet."""
    with BulletCell(robot, boxes) as cell:
        return tuple(min(min(cell.distances_m(q).values()) for q in way) for way in ways)
