# SPDX-License-Identifier: Apache-2.0
"""What a person does who takes an object from the robot, or gives it one.

The person sees whether the robot rests and whether its fingers have closed, and feels the load on
the own hand; each with a delay. Times are drawn for each person and trial.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge.handover.grip import CompliantHand

SPANS_S = {
    "reaction": (0.18, 0.30),
    "reach": (0.6, 1.0),
    "load": (0.15, 0.4),
    "pull": (0.9, 1.5),
    "busy": (0.0, 1.0),
}
"""Least and most time [s] from what is seen to the begin of a movement (Woods, Wyma, Yund, Herron
and Reed 2015, simple visual reactions: 0.23 on average), of the reach, of taking over or giving up
a load (Chan et al. 2012), of bringing the object to oneself, and until the person turns to it.
Convention: other things end first."""
MISSED_M = 0.005
"""Standard deviation of where the hand takes hold [m]. Convention."""
PUSHED_N, AGAIN_M = 3.0, 0.05
"""Load beyond what was carried by which a giver feels that the object met a finger [N], and how far
it is taken back then, to be brought again where it should be [m]. Convention.
"""


class SeenRobot(NamedTuple):
    """What the person sees now: where to hold the object, its turn, and what the robot does."""

    point_m: Floats
    turn: Floats
    rests: bool
    closed: bool = False


@dataclass(frozen=True)
class Manner:
    """How one trial is done: times [s], the weight that is expected [N], and misses."""

    reaction_s: float
    reach_s: float
    load_s: float
    pull_s: float
    busy_s: float
    weight_n: float  # that the person lifts with
    toward: Floats  # direction in which the object is brought to the person (3,)
    miss_m: Floats  # from where the hand should hold to where it does (3,)
    brought_m: float = 0.3  # how far a taker brings the object, and a giver goes away

    @classmethod
    def draw(cls, rng: np.random.Generator, weight_n: float) -> "Manner":
        """Draw one for an object of a weight; the person is in the direction of x."""
        times_s = {f"{name}_s": float(rng.uniform(*span)) for name, span in SPANS_S.items()}
        expected = weight_n * float(np.clip(1.0 + 0.2 * rng.standard_normal(), 0.5, 1.5))
        way = np.array([1.0, rng.uniform(-0.4, 0.4), rng.uniform(0.1, 0.6)])
        miss_m = rng.normal(0.0, MISSED_M, 3)
        toward = way / np.linalg.norm(way)
        return cls(**times_s, weight_n=expected, toward=toward, miss_m=miss_m)

    def careful(self) -> "Manner":
        """That of the same person who brings an object between fingers, and sees them.

        A slower movement misses by less in proportion (Schmidt, Zelaznik, Hawkins, Frank and Quinn
        1979).
        """
        # 2.3 bits more (Fitts 1954): 1 cm to spare on each side, not 5
        reach_s = self.reach_s + 0.3
        return replace(self, reach_s=reach_s, miss_m=self.miss_m * self.reach_s / reach_s)


class Taker:
    """Reaches for what rests in the robot's hand, takes over its weight, and brings it along.

    Attributes:
        brought: whether the movement is over.
    """

    def __init__(self, hand: CompliantHand, manner: Manner) -> None:
        self.hand, self._manner, self.brought = hand, manner, False
        self._rested_s: float | None = None
        self._from_m, self._to_m = hand.position_m.copy(), hand.position_m.copy()
        self._begun_s = self._held_s = np.inf

    def step(self, time_s: float, seen: SeenRobot) -> None:
        """Set what the hand wants at a time."""
        manner, hand = self._manner, self.hand
        if not seen.rests and self._begun_s == np.inf:
            self._rested_s = None
            return
        self._rested_s = time_s if self._rested_s is None else self._rested_s
        if self._begun_s == np.inf and time_s - self._rested_s >= manner.reaction_s + manner.busy_s:
            self._begun_s, self._to_m = time_s, seen.point_m + manner.miss_m
        if self._held_s == np.inf:
            done = progress((time_s - self._begun_s) / manner.reach_s)
            hand.target_m = self._from_m + done * (self._to_m - self._from_m)
            if done >= 1.0 and np.linalg.norm(hand.position_m - self._to_m) < 4.0 * MISSED_M:
                hand.grasp(seen.point_m, seen.turn, 0.0)
                self._held_s = time_s
            return
        loading_s = time_s - self._held_s - 0.15
        hand.lift_n = manner.weight_n * progress(loading_s / manner.load_s)
        share = progress((loading_s - 0.5 * manner.load_s) / manner.pull_s)
        hand.target_m = self._to_m + share * manner.brought_m * manner.toward
        self.brought = share >= 1.0


class Giver:
    """Brings an object to the robot's hand, and lets go of it while the robot holds it.

    Attributes:
        to_m: where the hand brings it (3,); it may change on the way.
    """

    def __init__(self, hand: CompliantHand, manner: Manner, to_m: Floats) -> None:
        self.hand, self._manner = hand, manner
        self._from_m, self.to_m = hand.position_m.copy(), to_m
        self._closed_s: float | None = None
        self._opened_s: float | None = None
        self._met_s = self._gone_s = np.inf
        self._carried_n, hand.lift_n = hand.felt_n, manner.weight_n

    def step(self, time_s: float, seen: SeenRobot) -> None:
        """Set what the hand wants at a time; it comes when the time is its reaction."""
        manner, hand = self._manner, self.hand
        done = progress((time_s - manner.reaction_s) / manner.reach_s)
        again_s = time_s - self._met_s - manner.reaction_s
        back = progress(again_s / manner.load_s)
        hand.target_m = self._from_m + done * (self.to_m - self._from_m) - back * manner.miss_m
        back -= progress((again_s - 2.0 * manner.load_s) / manner.reach_s)
        hand.target_m += back * AGAIN_M * manner.toward
        self._look(time_s, seen.closed)
        if self._closed_s is None:
            if hand.felt_n > self._carried_n + PUSHED_N:
                self._met_s = min(self._met_s, time_s)
            return
        lowering_s = time_s - self._closed_s - manner.reaction_s
        if hand.holds:
            hand.lift_n = manner.weight_n * (1.0 - progress(lowering_s / manner.load_s))
            relieved = hand.felt_n < 0.5 * manner.weight_n
            if lowering_s > manner.load_s and (relieved or lowering_s > 2.0 * manner.load_s):
                hand.let_go()
                self._gone_s, self.to_m = time_s, hand.position_m.copy()
        if self._gone_s < np.inf:
            away = manner.brought_m * progress((time_s - self._gone_s) / manner.reach_s)
            hand.target_m = self.to_m + away * manner.toward

    def _look(self, time_s: float, closed: bool) -> None:
        """See whether the fingers have closed, or have opened again on what the person holds."""
        if closed or not self.hand.holds:
            self._opened_s = None
            if closed and self._closed_s is None:
                self._closed_s = time_s
        elif self._closed_s is not None:
            self._opened_s = time_s if self._opened_s is None else self._opened_s
            if time_s - self._opened_s > self._manner.reaction_s:
                self._closed_s, self.hand.lift_n = None, self._manner.weight_n


def progress(share: float) -> float:
    """Minimum jerk (Flash and Hogan 1985) from 0 to 1, for a share of its time in or out of 0-1."""
    tau = min(max(share, 0.0), 1.0) if np.isfinite(share) else 0.0
    return tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
