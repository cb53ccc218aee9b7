# SPDX-License-Identifier: Apache-2.0
"""Estimates who holds each body, from what the topics report. No ROS, no page.

Bodies are not tracked. The task and the positions of the robot's hand and the person's wrist tell
when a body is taken or given, as `docs/dashboard.md` describes; without evidence a body stays where
it is.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.scene_file import PERSON, ROBOT, Body
from intent_recognition.signals import homogeneous

CARRIED_M = 0.12
"""Shortest distance over which a body is carried [m], as in the simulated gripper; below it the
body is neither given nor laid down."""
GLIDE_S = 0.5
"""Duration of the drawn motion when a body changes its place without a measured path [s]."""


class BodyHolder(Enum):
    """Who holds a body, or where it lies."""

    PLACE = "place"
    ROBOT = "robot"
    PERSON = "person"
    LAID = "laid"


class Rest:
    """Detects whether a point rests: within 12 mm for 0.3 s."""

    def __init__(self) -> None:
        self._anchor: Floats | None = None
        self._since_s = 0.0

    def update(self, point: Floats | None, now_s: float) -> bool:
        """Take the newest position (3,) [m], None if unknown; return whether the point rests."""
        if point is None:
            self._anchor = None
            return False
        if self._anchor is None or np.linalg.norm(point - self._anchor) > 0.012:
            self._anchor, self._since_s = point, now_s
        return bool(now_s - self._since_s >= 0.3)


@dataclass(frozen=True)
class HandlingMoment:
    """What the topics report at one moment."""

    now_s: float
    active: str  # task that the robot is executing, "" if none
    begun: str  # task that the person does, as far as is known, "" if none
    hand: Floats | None  # pose of the robot's hand (4, 4), world; None if it is unknown
    # wrist position of each person by name (3,) [m], world; None if it is unknown
    wrists: Mapping[str, Floats | None]
    helped: str = ""  # person whom the robot helps; empty for nobody, or for the only person

    @property
    def wrist(self) -> Floats | None:
        """Wrist of the person whom the robot helps."""
        return self.wrists.get(self.helped)

    @property
    def together(self) -> bool:
        """Whether the robot's hand and the person's wrist are close to each other."""
        if self.hand is None or self.wrist is None:
            return False
        return bool(np.linalg.norm(self.hand[:3, 3] - self.wrist) <= 0.4)  # with a body between


class Handling:
    """Tracks where the bodies of a scene are."""

    def __init__(self, bodies: Sequence[Body]):
        self._followed = {body.name: _Followed(body) for body in bodies}
        self._hand_rest, self._rests = Rest(), defaultdict[str, Rest](Rest)

    def update(self, moment: HandlingMoment) -> None:
        """Update all bodies."""
        hand = None if moment.hand is None else moment.hand[:3, 3]
        hand_rests = self._hand_rest.update(hand, moment.now_s)
        resting = {
            name
            for name, wrist in moment.wrists.items()
            if self._rests[name].update(wrist, moment.now_s)
        }
        for followed in self._followed.values():
            followed.update(moment, hand_rests, followed.who in resting)

    def follows_hand(self, active: str) -> bool:
        """Whether any body's place depends on the robot's hand while this task is active."""
        return any(
            active == followed.task or followed.holder is BodyHolder.ROBOT
            for followed in self._followed.values()
        )

    def holder(self, name: str) -> BodyHolder:
        """Who holds a body."""
        return self._followed[name].holder

    def pose(self, name: str) -> Floats:
        """Pose of a body (4, 4), world."""
        return self._followed[name].pose


class _Followed:
    """One body and its holder."""

    def __init__(self, body: Body):
        self._body, self.task = body, body.task
        self._laid = body.pose if body.laid is None else with_position(body.pose, body.laid)
        self.holder, self.who = BodyHolder.PLACE, ""  # who: the person who held it last
        self.pose = body.pose
        self._local: Floats = np.eye(4)  # pose in the holder's frame
        self._glides_from: Floats | None = None
        self._glides_since_s = 0.0
        self._nearest_m, self._came_m = np.inf, 0.0
        self._taken_m: Floats | None = None
        self._was_active = self._had_begun = False

    def update(self, moment: HandlingMoment, hand_rests: bool, wrist_rests: bool) -> None:
        """Decide who holds the body, and update its pose."""
        active, begun = moment.active == self.task, moment.begun == self.task
        if active and not self._was_active:
            self._nearest_m = np.inf
            self._taken_m = None if moment.hand is None else moment.hand[:3, 3]
        if self.holder is BodyHolder.LAID and (active or begun):
            self._put(BodyHolder.PLACE, moment)
            self._glides_from = None  # a new body of the same kind appears at once
        if self.holder is BodyHolder.PLACE:
            self._from_place(moment, active, begun and not self._had_begun, hand_rests)
        elif self.holder is BodyHolder.ROBOT:
            self._from_robot(moment, active, hand_rests)
        elif self.holder is BodyHolder.PERSON:
            self._from_person(moment, active, begun, hand_rests, wrist_rests)
        self._was_active, self._had_begun = active, begun
        self._move(moment)

    def _from_place(
        self, moment: HandlingMoment, active: bool, begins: bool, hand_rests: bool
    ) -> None:
        if self._body.brought_by == PERSON:
            if begins and moment.wrist is not None:
                self._put(BodyHolder.PERSON, moment)
        elif active and moment.hand is not None and self._body.grasp is not None:
            distance = float(np.linalg.norm(moment.hand[:3, 3] - self._body.grasp))
            self._nearest_m = min(self._nearest_m, distance)
            # 4 mm: more than the noise of the joints
            passed = distance > self._nearest_m + 0.004 or hand_rests
            if passed and self._nearest_m <= 0.06 and distance <= 0.12:
                self._hold(moment)

    def _from_robot(self, moment: HandlingMoment, active: bool, hand_rests: bool) -> None:
        brings = self._body.brought_by == ROBOT
        gives = hand_rests and self._is_away(moment) if brings else not active
        if gives and moment.together:
            self._put(BodyHolder.PERSON, moment)
        elif not active:
            self._put(BodyHolder.PLACE, moment)

    def _from_person(
        self, moment: HandlingMoment, active: bool, begun: bool, hand_rests: bool, wrist_rests: bool
    ) -> None:
        brings = self._body.brought_by == PERSON
        if brings and active and hand_rests and moment.together and self._is_away(moment):
            self._hold(moment)
        elif (wrist := moment.wrists.get(self.who)) is not None:
            self._came_m = max(self._came_m, float(np.linalg.norm(wrist - self._given_m)))
            if wrist_rests and self._came_m > CARRIED_M and not active and not begun:
                self._put(BodyHolder.LAID, moment)

    def _is_away(self, moment: HandlingMoment) -> bool:
        """Whether the hand has moved since it took the body, or since the task began."""
        if moment.hand is None or self._taken_m is None:
            return False
        return bool(np.linalg.norm(moment.hand[:3, 3] - self._taken_m) > CARRIED_M)

    def _hold(self, moment: HandlingMoment) -> None:
        """Let the robot hold the body as it is, without a jump."""
        assert moment.hand is not None
        self.holder, self._glides_from = BodyHolder.ROBOT, None
        self._local = np.asarray(np.linalg.solve(moment.hand, self.pose))
        self._taken_m = moment.hand[:3, 3]

    def _put(self, holder: BodyHolder, moment: HandlingMoment) -> None:
        """Change the holder or put the body down; the drawn body glides to a different place."""
        self.holder = holder
        self._glides_from, self._glides_since_s = self.pose, moment.now_s
        if holder is BodyHolder.PERSON:
            assert moment.wrist is not None
            self.who, self._given_m, self._came_m = moment.helped, moment.wrist, 0.0
            offset = self.pose[:3, 3] - moment.wrist
            offset *= 0.1 / max(float(np.linalg.norm(offset)), 0.1)  # so far reaches a hand [m]
            self._local = with_position(self.pose, self._body.in_hand or offset)

    def _target(self, moment: HandlingMoment) -> Floats:
        if self.holder is BodyHolder.ROBOT:
            return self.pose if moment.hand is None else moment.hand @ self._local
        if self.holder is BodyHolder.PERSON:
            wrist = moment.wrists.get(self.who)
            if wrist is None:
                return self.pose
            return with_position(self._local, self._local[:3, 3] + wrist)
        return self._laid if self.holder is BodyHolder.LAID else self._body.pose

    def _move(self, moment: HandlingMoment) -> None:
        target = self._target(moment)
        share = (moment.now_s - self._glides_since_s) / GLIDE_S
        if self._glides_from is None or share >= 1.0:
            self._glides_from, self.pose = None, target
        else:
            self.pose = between(self._glides_from, target, share)


def with_position(pose: Floats, position: ArrayLike) -> Floats:
    """Pose (4, 4) with the orientation of another, at a position (3,)."""
    moved = pose.copy()
    moved[:3, 3] = position
    return moved


def between(start: Floats, end: Floats, share: float) -> Floats:
    """Pose (4, 4) between two poses, smooth at both ends; `share` runs from 0 to 1."""
    way = share * share * (3.0 - 2.0 * share)
    turns = Rotation.from_matrix(np.stack((start[:3, :3], end[:3, :3])))
    place = start[:3, 3] + way * (end[:3, 3] - start[:3, 3])
    return homogeneous(Slerp([0.0, 1.0], turns)(way).as_matrix(), place)
