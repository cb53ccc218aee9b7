# SPDX-License-Identifier: Apache-2.0
"""One transfer, or one bump or false pull, from its draw to its outcome."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.handover.cell import OBJECTS, TransferCell
from benchmarks.handover.robot_side import RobotSide, TransferSample
from intent_recognition.array_types import Floats
from intent_recognition.transfer import (
    LIGHTEST_N,
    PATIENCE_S,
    Holding,
    Request,
    Situation,
    TransferMachine,
    TransferOutput,
    carrying_grip,
)
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import SimulatedArm
from sim_bridge.handover import HELD_SHARE, CompliantHand, Giver, Manner, SeenRobot, Strength, Taker

TRANSFERS = ("give", "take")
DISTURBANCES = ("bump", "bump on the way", "pull on the way", "tug", "wrong way", "partly")
"""What does not take an object: bumps and tugs shorter than 0.1 s, pulls while the arm moves,
pushes and pulls that are not toward the person, and a hand that carries less than half."""
KINDS = (*TRANSFERS, *DISTURBANCES, "slippery")
"""Kinds of trials: the robot gives, it takes, and what disturbs it."""
STAND_M, LIFT_M = np.array([0.50, -0.25, 0.36]), np.array([0.0, 0.0, 0.06])
OFFER_M, OFFER_RANGE_M = np.array([0.60, 0.0, 0.42]), np.array([0.03, 0.08, 0.06])
"""Where the grip is at the stand, how far it lifts, and about where it offers [m]."""
LIFT_S, WAY_S = 0.5, (1.0, 1.5)
"""Time to lift, and range of the time to go to the offer [s]."""
REST_M = np.array([0.35, 0.0, -0.15])
"""From the offer to where the person's hand waits [m]."""
BACK_S = 0.9
"""Time to bring the object back above its stand [s]."""
LONGEST_S, AFTER_S = 14.0, 0.6
"""Longest trial, and the time watched after its end [s]."""
WAIT_S = 1.8
"""Patience of the robot while it is only disturbed [s]: longer than any of that."""
LOST_M = 0.05
"""Distance from its place in the grip at which an object is lost [m]."""
WET, SLIDES_M_S = (0.45, 0.6), 0.01
"""Share of its weight that the usual grip holds of an object that turns wet on the way, and speed
in the hand from which it slides [m/s]."""
BESIDE_M = np.array([0.08, 0.0, 0.0])
"""From where the object is held to a hand that does not take it [m]."""


class ClockMachine(TransferMachine):
    """For comparison: a clock replaces the measured load while the object is given or taken.

    A fixed time after the begin of an offer the load is taken for gone, so that the hand opens
    0.2 s later, whoever holds the object; what was received counts as the robot's as soon as the
    fingers have closed.
    """

    def __init__(self, patience_s: float, clock_s: float) -> None:
        super().__init__(patience_s)
        self._clock_s, self._offered_s = clock_s, np.inf

    def step(self, request: Request, now: Situation) -> TransferOutput:
        """As `TransferMachine.step`, with the force by the clock."""
        if self.holding is not Holding.OFFERING:
            self._offered_s = now.time_s
        if self.holding in (Holding.OFFERING, Holding.TAKING):
            is_time = now.time_s - self._offered_s >= self._clock_s
            up_n = LIGHTEST_N if is_time else -max(self.weight_n, LIGHTEST_N)
            now = now._replace(force_n=np.array([0.0, 0.0, up_n]), near=True)
        return super().step(request, now)


class TransferTrial(NamedTuple):
    """One trial: kind, object, arm and seed; the clock of a robot without a load signal."""

    kind: str
    thing: str
    robot: str
    seed: int
    clock_s: float | None = None


class TransferOutcome(NamedTuple):
    """Outcome of a trial.

    Attributes:
        success: of a transfer: the other one has the object at the end, and this one not; of a
            disturbance: the object was not let go, and is back on its stand.
        dropped: nobody has it, and it is not on its stand.
        peak_n: largest force between person and object [N].
        release_s: from the pull until no finger touches [s]; NaN if there was none. The pull is
            when the person first lifts and pulls with the weight of the object, or with
            `LIGHTEST_N` if that is more.
        slip_s: from the begin of a slide until it was noticed [s]; NaN if there was none.
        end: state at the end.
        samples: over time.
    """

    success: bool
    dropped: bool
    peak_n: float
    release_s: float
    slip_s: float
    end: Holding
    samples: list[TransferSample]


def run_trial(trial: TransferTrial) -> TransferOutcome:
    """Do one trial in a fresh world; the same trial has the same outcome, bit for bit."""
    thing = OBJECTS[trial.thing]
    rng = np.random.default_rng([trial.seed, KINDS.index(trial.kind)])
    weight_n = thing.mass_kg * GRAVITY_M_S2
    offer_m = OFFER_M + OFFER_RANGE_M * rng.uniform(-1.0, 1.0, 3)
    hand = CompliantHand(offer_m + REST_M, Strength.draw(rng), rng)
    manner = Manner.draw(rng, weight_n)
    with TransferCell(trial.robot, thing, STAND_M, rng) as cell:
        patience_s = WAIT_S if trial.kind in DISTURBANCES else PATIENCE_S
        machine = TransferMachine(patience_s)
        if trial.clock_s is not None:
            machine = ClockMachine(patience_s, trial.clock_s)
        robot = RobotSide(cell, rng, machine)
        run = _Run(cell, robot, offer_m, float(rng.uniform(*WAY_S)))
        if trial.kind == "take":
            run.receive(hand, manner.careful())
        else:
            if trial.kind == "give":
                run.person = Taker(hand, manner)
                cell.person = hand
            else:
                run.disturb = _disturbance(trial.kind, weight_n, rng)
                if trial.kind == "slippery":
                    run.wet = float(rng.uniform(*WET))
                else:
                    run.lurker = hand
                    cell.person = hand
            run.give()
        return run.outcome(trial, weight_n)


class _Run:
    """The course of a trial."""

    def __init__(self, cell: TransferCell, robot: RobotSide, offer_m: Floats, way_s: float) -> None:
        self.cell, self.robot, self._way_s = cell, robot, way_s
        self.person: Taker | Giver | None = None
        self.disturb: Callable[[float, float], Floats] | None = None
        self.lurker: CompliantHand | None = None
        self.wet: float | None = None
        self._weight_n = cell.thing.mass_kg * GRAVITY_M_S2
        self._lift = cell.way(cell.home, STAND_M + LIFT_M)
        self._way = cell.way(self._lift[-1], offer_m)
        self._offer_m = cell.model.forward_kinematics(self._way[-1])[:3, 3]
        self._left_s = self._rested_s = np.inf
        cell.arm.before_step.insert(0, self._act)

    def give(self) -> None:
        """Take the object from its stand, offer it, and bring it back if nobody takes it."""
        robot = self.robot
        robot.request = Request.HOLD
        self._until(lambda: robot.holding is Holding.CARRYING)
        self._wait(0.2)
        self._go(self._lift, LIFT_S)
        self._left_s = self.cell.arm.time_s
        robot.request = Request.GIVE
        self._go(self._way, self._way_s)
        self._rested_s = self.cell.arm.time_s
        if self.wet is not None:
            self._wait(AFTER_S)
            return
        self._until(lambda: robot.holding in (Holding.EMPTY, Holding.RETURNING))
        if robot.holding is Holding.RETURNING:
            self._go(self._way[::-1], BACK_S)
            self._go(self._lift[::-1], LIFT_S)
            self._wait(0.2)
            robot.request = Request.PUT_DOWN
            self._until(lambda: robot.holding is Holding.EMPTY)
        self._wait(AFTER_S if self.person is None else AFTER_S + 1.0)

    def receive(self, hand: CompliantHand, manner: Manner) -> None:
        """Wait with open fingers, take what the person brings, and carry it off."""
        cell, robot = self.cell, self.robot
        robot.move(self._way[[-1, -1]], 0.0)
        cell.arm.reset(self._way[-1])
        lever = HELD_SHARE * cell.thing.half_edges_m[2] + cell.thing.grasp_m
        to_m = self._offer_m + [lever, 0.0, 0.0] + manner.miss_m
        from_m = to_m + REST_M
        hand.position_m, hand.target_m = from_m.copy(), from_m.copy()
        cell.held.put(from_m - [HELD_SHARE * cell.thing.half_edges_m[2], 0.0, 0.0])
        hand.grasp(*cell.held.held_point())
        hand.force_n = np.array([0.0, 0.0, cell.thing.mass_kg * GRAVITY_M_S2])
        hand.felt_n = cell.thing.mass_kg * GRAVITY_M_S2
        self.person = Giver(hand, manner, to_m)
        cell.person = hand
        robot.request = Request.TAKE
        self._until(lambda: robot.holding is Holding.CARRYING)
        robot.request = Request.HOLD
        self._go(self._way[::-1], self._way_s)
        self._wait(AFTER_S)

    def outcome(self, trial: TransferTrial, weight_n: float) -> TransferOutcome:
        """Score what happened."""
        cell, samples = self.cell, self.robot.samples
        centre = cell.held.pose()[0]
        person = cell.person
        has = person is not None and person.holds
        fingers = cell.fingers.touching(cell.body)
        in_grip = fingers == 2 and self._from_grip() < LOST_M
        stands = bool(cell.arm.client.getContactPoints(cell.body, cell.stand))
        peak_n = max(float(np.linalg.norm(s.person_n)) for s in samples)
        if trial.kind == "give":
            success = has and not fingers
        elif trial.kind == "take":
            success = in_grip and not has
        elif trial.kind == "slippery":
            success = in_grip
        else:
            let_go = any(s.output.holding is Holding.EMPTY for s in samples[-200:]) and not stands
            success = stands and not let_go and float(np.linalg.norm(centre - self._start_m)) < 0.03
        dropped = not (has or in_grip or stands)
        slip_s = _slip_s(samples) if self.wet is not None else np.nan
        release_s = _release_s(samples, weight_n) if trial.kind == "give" else np.nan
        return TransferOutcome(
            success, dropped, peak_n, release_s, slip_s, self.robot.holding, samples
        )

    @property
    def _start_m(self) -> Floats:
        return STAND_M + [self.cell.thing.grasp_m, 0.0, 0.0]

    def _from_grip(self) -> float:
        expected = self.cell.grip_m() + [self.cell.thing.grasp_m, 0.0, 0.0]
        return float(np.linalg.norm(self.cell.held.pose()[0] - expected))

    def _act(self, arm: SimulatedArm) -> None:
        """What the person and the disturbance do in the coming step."""
        cell, now_s = self.cell, arm.time_s
        if self.person is not None:
            point, turn = cell.held.held_point()
            closed = cell.fingers.touching(cell.body) == 2
            self.person.step(now_s, SeenRobot(point, turn, now_s > self._rested_s, closed))
        if self.disturb is not None:
            cell.push_n = self.disturb(now_s - self._left_s, now_s - self._rested_s)
        if self.lurker is not None:  # the tracker sees a hand beside the object all the time
            self.lurker.target_m = cell.held.held_point()[0] + BESIDE_M
        if self.wet is not None and now_s > self._left_s + 0.4:
            holds_n = 2.0 * carrying_grip(self._weight_n)
            cell.held.set_friction(self.wet * self._weight_n / holds_n)

    def _go(self, way: Floats, length_s: float) -> None:
        self.robot.move(way, length_s)
        self._until(lambda: not self.robot.moving)

    def _wait(self, length_s: float) -> None:
        end_s = self.cell.arm.time_s + length_s
        self._until(lambda: self.cell.arm.time_s >= end_s)

    def _until(self, done: Callable[[], bool]) -> None:
        while not done() and self.cell.arm.time_s < LONGEST_S:
            self.cell.arm.step()


def _disturbance(
    kind: str, weight_n: float, rng: np.random.Generator
) -> Callable[[float, float], Floats]:
    """Force on the object (3,) [N], from the times since it left its stand and since it rests."""
    way = rng.standard_normal(3)
    way /= np.linalg.norm(way)
    size, length_s, begin_s = 0.0, 1.0, float(rng.uniform(0.3, 0.7))
    on_the_way = kind.endswith("on the way")
    if kind.startswith("bump"):
        size, length_s = rng.uniform(4.0, 12.0), rng.uniform(0.03, 0.1)
    elif kind == "pull on the way":
        way, size = np.array([0.9, 0.0, 0.44]), rng.uniform(3.0, 10.0)
        length_s, begin_s = rng.uniform(0.2, 0.5), 0.2
    elif kind == "tug":
        way = np.array([0.9, 0.0, 0.44])
        size, length_s = rng.uniform(4.0, 10.0), rng.uniform(0.06, 0.1)
    elif kind == "wrong way":
        choices = ([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0])
        way = np.array(choices[rng.integers(4)])
        size, length_s = rng.uniform(3.0, 8.0), rng.uniform(0.3, 1.0)
    elif kind == "partly":
        way = np.array([0.0, 0.0, 1.0])
        size, length_s = rng.uniform(0.2, 0.5) * weight_n, rng.uniform(0.5, 1.0)

    def force(since_left_s: float, since_rest_s: float) -> Floats:
        share = ((since_left_s if on_the_way else since_rest_s) - begin_s) / length_s
        inside = 0.0 < share < 1.0
        return size * np.sin(np.pi * share) * way if inside else np.zeros(3)

    return force


def _release_s(samples: list[TransferSample], weight_n: float) -> float:
    """From the pull until no finger touches."""
    needed = max(weight_n, LIGHTEST_N)
    forces = np.array([s.person_n for s in samples])
    pull = np.maximum(forces[:, 2], 0.0) + np.maximum(forces[:, 0], 0.0)
    pulled = np.flatnonzero(pull >= needed)
    touched = np.array([s.fingers > 0 for s in samples])
    free = np.flatnonzero(~touched & (np.cumsum(touched) > 0))
    if not pulled.size or not free.size:
        return float("nan")
    return samples[free[0]].time_s - samples[pulled[0]].time_s


def _slip_s(samples: list[TransferSample]) -> float:
    """From the begin of the first slide until it was noticed."""
    offsets = np.array([s.object_m - s.grip_m for s in samples])
    speed = np.linalg.norm(np.diff(offsets, axis=0), axis=1) / np.diff([s.time_s for s in samples])
    carried = [s.output.holding in (Holding.CARRYING, Holding.OFFERING) for s in samples[1:]]
    begun = np.flatnonzero((speed > SLIDES_M_S) & carried)
    seen = [k for k, s in enumerate(samples) if s.output.slip]
    if not begun.size:
        return float("nan")
    later = [k for k in seen if k >= begun[0]]
    return samples[later[0]].time_s - samples[begun[0] + 1].time_s if later else float("inf")
