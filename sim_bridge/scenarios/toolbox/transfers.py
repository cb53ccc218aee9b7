# SPDX-License-Identifier: Apache-2.0
"""The toolbox assembly with objects that are held by force, by fingers and by a person's hand.

Plate and screws are put between the fingers when the hand passes their stand; from then on, only
forces hold them. The worker's hand follows the tracked wrist, except for the last decimetres, in
which it follows what the person sees and feels (`sim_bridge.handover`).
"""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.transfer import FIRM_N, Holding
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import TIME_STEP_S, SimulatedArm
from sim_bridge.coworker import HOLD, PLATE, SCREW
from sim_bridge.handover import (
    HELD_SHARE,
    CompliantHand,
    Fingers,
    Giver,
    GripFollower,
    HandedThing,
    Manner,
    SeenRobot,
    Strength,
    Taker,
    TransferObject,
    in_grip,
)
from sim_bridge.scenarios.toolbox.scene import STANDS_M, takes

THINGS = {
    PLATE: TransferObject(0.4, (0.06, 0.004, 0.06), 0.03),
    SCREW: TransferObject(0.1, (0.02, 0.015, 0.05), 0.015),
    HOLD: TransferObject(0.3, (0.014, 0.014, 0.1), 0.05),
}
"""The object of each task: a plate, a box of screws, a screwdriver."""
NEAR_M, AWAY_M = 0.3, 0.12
"""Distance from the grip to the wrist below which the person acts, and motion of the wrist after
which the person turns to something else [m]."""
REST_M_S = 0.03
"""Speed of the robot's hand below which it rests, so that a person takes or brings an object
[m/s]."""
ASIDE_M = np.array([0.16, 0.0, 0.0])
"""Offset at which the person holds an object, from the wrist until the robot is near and then from
the fingers, out of their way [m]."""
BETWEEN = 0.5
"""Fingers hold an object if they are further apart than this share of its thickness: pads yield,
and fingers that closed in front of the object touch each other."""


class Holder(Enum):
    """Who holds the object of the task."""

    NONE = ""
    STAND = "stand"
    ROBOT = "robot"
    BOTH = "both"
    PERSON = "person"
    NOBODY = "nobody"


class HandContact(NamedTuple):
    """Ground truth of a transfer: who holds the object, and the person's force on it (3,) [N]."""

    holder: Holder
    force_n: Floats


class ToolboxTransfers:
    """The objects, the fingers and the worker's hand in an arm's world.

    Args:
        arm: an arm with fingers.
        seed: seed of the person.
        lever_m: distance from the hand as it was taught to the grip, along the hand's z.
        report: called with whether the fingers hold an object taken from a stand.
    """

    def __init__(
        self, arm: SimulatedArm, seed: int, lever_m: float, report: Callable[[bool], None]
    ) -> None:
        self._arm, self._lever_m, self._report = arm, lever_m, report
        self._seed, self._n_tasks, self._attended = [seed, 17], 0, ""
        self._fingers = Fingers(arm)
        self._grip = GripFollower(arm, self._fingers)
        self._wrists_m: dict[str, Floats] = {}
        self._hands: dict[str, CompliantHand] = {}
        self._thing: HandedThing | None = None
        self._person: Taker | Giver | None = None
        self._manner: Manner | None = None
        self._offset_m, self._since_m, self._since_s = np.zeros(3), np.zeros(3), 0.0
        self._blocked_s = 0.0
        self._closed_on = self._served = False
        self.task = ""
        arm.before_step.append(self._act)

    @property
    def held(self) -> str:
        """Label of the object between the fingers, "" if none."""
        return self.task if self.contact().holder in (Holder.ROBOT, Holder.BOTH) else ""

    def contact(self) -> HandContact:
        """Who holds the object now."""
        hand, thing = self._hand, self._thing
        if thing is None or hand is None:
            return HandContact(Holder.STAND if self.task in STANDS_M else Holder.NONE, np.zeros(3))
        robot = self._gripped(thing)
        if robot and hand.holds:
            holder = Holder.BOTH
        elif robot:
            holder = Holder.ROBOT
        else:
            holder = Holder.PERSON if hand.holds else Holder.NOBODY
        return HandContact(holder, hand.force_n.copy())

    def _gripped(self, thing: HandedThing) -> bool:
        """Whether the object is between both fingers, and not in front of them."""
        between = self._fingers.half_opening_m() > BETWEEN * thing.what.half_edges_m[1]
        return between and self._fingers.touching(thing.body) == 2

    @property
    def _hand(self) -> CompliantHand | None:
        """Hand of the person for whom the task is."""
        return self._hands.get(self._attended)

    @property
    def _wrist_m(self) -> Floats:
        return self._wrists_m[self._attended]

    def move_wrist(self, position_m: Floats, person: str = "") -> None:
        """Set the tracked position of a person's wrist (3,); a single person has no name."""
        self._wrists_m[person] = np.array(position_m)
        if person not in self._hands:
            rng = np.random.default_rng([*self._seed, *person.encode()])
            hand = CompliantHand(self._wrists_m[person], Strength.draw(rng), rng)
            self._hands[person] = hand

    def attend(self, person: str) -> None:
        """Set the person for whom the task is; the object of another person is removed."""
        if person and person != self._attended:
            task = self.task
            self.set_task("")
            self._attended = person
            self.set_task(task)

    def set_task(self, task: str) -> None:
        """Set the task being executed, "" when idle; the object of the task before is removed."""
        task = task if task in THINGS else ""
        if task == self.task:
            return
        self._put_away()
        self.task = task
        if task and self._hand is not None:
            weight_n = THINGS[task].mass_kg * GRAVITY_M_S2
            self._n_tasks += 1  # each task has its own seed
            drawn = Manner.draw(np.random.default_rng([*self._seed, self._n_tasks]), weight_n)
            # the taker pulls the object 0.1 m toward the wrist
            self._manner = replace(drawn, brought_m=0.1, busy_s=0.0, reach_s=0.5 * drawn.reach_s)
            if task not in STANDS_M:
                self._manner = self._manner.careful()
                self._bring(self._hand)

    def follow(self, holding: Holding, share: float, weight_n: float, grip_n: float) -> None:
        """Grip as `intent/transfer` commands, once that reflects an object taken from a stand."""
        if self._closed_on and holding is Holding.EMPTY:
            return
        self._closed_on = False
        self._grip.follow(holding, share, weight_n, grip_n, 5 * TIME_STEP_S)

    def update(self) -> None:
        """Take an object from its stand if the hand is there; call this every few milliseconds."""
        pose = self._arm.hand_pose()
        if self._hand is not None and self._hand.holds and not self._served:
            what = THINGS[self.task]  # the person aligns it with the robot's hand
            self._hand.turn_to(in_grip(what, pose.position, pose.orientation)[1])
        if self.task not in STANDS_M or self._thing is not None:
            return
        hand_m = pose.position - self._lever_m * _outward(pose.orientation)
        if takes(self.task, hand_m, self._speed()):
            what = THINGS[self.task]
            self._thing = self._make(what, *in_grip(what, pose.position, pose.orientation))
            self._fingers.close_on(what.half_edges_m[1])
            self._fingers.press(FIRM_N)
            self._closed_on = True
            self._report(True)

    def _make(self, what: TransferObject, centre_m: Floats, turn: Floats) -> HandedThing:
        """Put an object into the world, which touches only the fingers of the arm."""
        client, body = self._arm.client, self._arm.body
        thing = HandedThing(client, what, centre_m, turn)
        for link in range(-1, client.getNumJoints(body)):
            if link not in self._fingers.links:
                client.setCollisionFilterPair(body, thing.body, link, -1, 0)
        return thing

    def _bring(self, hand: CompliantHand) -> None:
        """Put the task's object into the person's hand."""
        what, pose = THINGS[self.task], self._arm.hand_pose()
        _, turn = in_grip(what, pose.position, pose.orientation)
        out = Rotation.from_quat(turn).as_matrix()[:, 0]
        self._thing = self._make(
            what, hand.position_m - HELD_SHARE * what.half_edges_m[2] * out, turn
        )
        weight_n = what.mass_kg * GRAVITY_M_S2
        hand.grasp(*self._thing.held_point())
        hand.lift_n = hand.felt_n = weight_n
        hand.force_n = np.array([0.0, 0.0, weight_n])

    def _put_away(self) -> None:
        robot = self._thing is not None and self.held
        if self._thing is not None:
            self._arm.client.removeBody(self._thing.body)
        if self._hand is not None:
            self._hand.let_go()
        self._thing = self._person = None
        self._served = self._closed_on = False
        if robot:
            self._report(False)

    def _act(self, arm: SimulatedArm) -> None:
        """Let people act in the next step."""
        hand, thing = self._hand, self._thing
        for person, other in self._hands.items():
            if other is not hand:
                other.target_m = self._wrists_m[person]
                _let_rest(other)
        if hand is None:
            return
        follow_s = 0.5  # time constant with which the hand returns to the wrist
        self._offset_m += TIME_STEP_S / follow_s * (self._aside_m(hand, thing) - self._offset_m)
        if self._person is None:
            hand.target_m = self._wrist_m + self._offset_m
            if thing is not None and not self._served:
                self._begin(hand, thing)
        else:
            self._go_on(hand, self._person)
        if thing is not None:
            thing.act(hand)
        else:
            _let_rest(hand)

    def _begin(self, hand: CompliantHand, thing: HandedThing) -> None:
        """Begin to take or to give if the robot is near."""
        gives, pose = hand.holds, self._arm.hand_pose()
        near = np.linalg.norm(pose.position - self._wrist_m) < NEAR_M
        if self._manner is None or not near or self._speed() >= REST_M_S:
            return
        manner = replace(
            self._manner, toward=_turned(self._manner.toward, _outward(pose.orientation))
        )
        room_m = self._fingers.half_opening_m() - thing.what.half_edges_m[1]
        # the fingers' opening leaves 2.4 cm to each side
        if gives and room_m > 0.02 > self._off_line_m(hand, thing):
            self._person = Giver(hand, manner, self._place(thing))
        elif not gives and self._gripped(thing):
            self._person = Taker(hand, manner)
        self._since_m, self._since_s = self._wrist_m.copy(), self._arm.time_s
        self._blocked_s = 0.0

    def _go_on(self, hand: CompliantHand, person: Taker | Giver) -> None:
        """Let the person act, and end if the object has changed hands or the person leaves."""
        thing = self._thing
        assert thing is not None
        gripped = self._gripped(thing)
        if isinstance(person, Giver) and not gripped and hand.holds:
            person.to_m = self._place(thing)
        point, turn = thing.held_point()
        rests = self._speed() < REST_M_S
        now_s = self._arm.time_s - self._since_s
        person.step(now_s, SeenRobot(point, turn, rests, gripped))
        if isinstance(person, Giver) and self._gives_way(hand, thing):
            self._person, self._offset_m = None, hand.position_m - self._wrist_m
            return
        leaves = np.linalg.norm(self._wrist_m - self._since_m) > AWAY_M
        gave = isinstance(person, Giver) and not hand.holds
        touched = self._fingers.touching(thing.body)
        took = isinstance(person, Taker) and person.brought and hand.holds and not touched
        if leaves or gave or took:
            self._person, self._served = None, bool(gave or took)
            self._offset_m = hand.target_m - self._wrist_m

    def _gives_way(self, hand: CompliantHand, thing: HandedThing) -> bool:
        """Whether a giver has noticed that the fingers closed in front of the object."""
        blocked = self._fingers.half_opening_m() < BETWEEN * thing.what.half_edges_m[1]
        self._blocked_s = self._blocked_s + TIME_STEP_S if blocked and hand.holds else 0.0
        return self._manner is not None and self._blocked_s > self._manner.reaction_s

    def _place(self, thing: HandedThing) -> Floats:
        """Position of the person's hand (3,) when the object is between the fingers."""
        pose, what = self._arm.hand_pose(), thing.what
        reach_m = what.grasp_m + HELD_SHARE * what.half_edges_m[2]
        miss_m = np.zeros(3) if self._manner is None else self._manner.miss_m
        return pose.position + reach_m * _outward(pose.orientation) + miss_m

    def _aside_m(self, hand: CompliantHand, thing: HandedThing | None) -> Floats:
        """Offset of the waiting hand from the wrist (3,); with an object, before the fingers."""
        if thing is None or self._served or not hand.holds:
            return np.zeros(3)
        pose = self._arm.hand_pose()
        if np.linalg.norm(pose.position - self._wrist_m) >= NEAR_M:
            return ASIDE_M
        before = np.linalg.norm(ASIDE_M) * _outward(pose.orientation)
        return self._place(thing) + before - self._wrist_m

    def _off_line_m(self, hand: CompliantHand, thing: HandedThing) -> float:
        """Distance of the hand from the line along which it should bring the object [m]."""
        off = hand.position_m - self._place(thing)
        out = _outward(self._arm.hand_pose().orientation)
        return float(np.linalg.norm(off - (off @ out) * out))

    def _speed(self) -> float:
        return float(np.linalg.norm(self._arm.hand_velocity()))


def _outward(turn: Floats) -> Floats:
    """The direction in which a hand points (3,)."""
    return Rotation.from_quat(turn).as_matrix()[:, 2]


def _turned(toward: Floats, way: Floats) -> Floats:
    """Turn a direction (3,) about z by the angle between x and the level part of `way` (3,)."""
    return Rotation.from_euler("z", np.arctan2(way[1], way[0])).apply(toward)


def _let_rest(hand: CompliantHand) -> None:
    """Let an empty hand follow its target for a step."""
    none = np.zeros(3)
    hand.step(TIME_STEP_S, hand.position_m, none, np.array([0.0, 0.0, 0.0, 1.0]), none, 1.0)
