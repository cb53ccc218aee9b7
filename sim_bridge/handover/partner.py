# SPDX-License-Identifier: Apache-2.0
"""A person who takes an object from the robot, or gives it one.

The person sees whether the robot rests and whether its fingers have closed, and feels the load on
their hand, each with a delay. Times are drawn for each person and trial.
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
"""Shortest and longest time [s] of a visual reaction (Woods, Wyma, Yund, Herron and Reed 2015: 0.23
on average), of the reach, of taking over or giving up a load (Chan et al. 2012), of bringing the
object to oneself, and of finishing something else before."""
MISSED_M = 0.005
"""Standard deviation of the position at which the hand takes hold [m]."""
PUSHED_N, AGAIN_M = 3.0, 0.05
"""Load beyond the carried one at which a giver feels that the object met a finger [N], and distance
by which the giver then takes it back before bringing it again [m]."""


class SeenRobot(NamedTuple):
    """What the person sees: where to hold the object (3,), its orientation (4,), and the robot."""

    point_m: Floats
    turn: Floats
    rests: bool
    closed: bool = False


@dataclass(frozen=True)
class Manner:
    """How a person acts in one trial: times [s], expected weight [N], and aiming errors."""

    reaction_s: float
    reach_s: float
    load_s: float
    pull_s: float
    busy_s: float
    weight_n: float  # force with which the person lifts
    toward: Floats  # direction in which the object is brought to the person (3,)
    miss_m: Floats  # offset of the hand's hold from the right place (3,)
    brought_m: float = 0.3  # distance by which a taker brings the object, and a giver withdraws

    @classmethod
    def draw(cls, rng: np.random.Generator, weight_n: float) -> "Manner":
        """Draw a manner for an object of a weight; the person is in the direction of x."""
        times_s = {f"{name}_s": float(rng.uniform(*span)) for name, span in SPANS_S.items()}
        expected = weight_n * float(np.clip(1.0 + 0.2 * rng.standard_normal(), 0.5, 1.5))
        way = np.array([1.0, rng.uniform(-0.4, 0.4), rng.uniform(0.1, 0.6)])
        miss_m = rng.normal(0.0, MISSED_M, 3)
        toward = way / np.linalg.norm(way)
        return cls(**times_s, weight_n=expected, toward=toward, miss_m=miss_m)

    def careful(self) -> "Manner":
        """The manner of the same person when bringing an object between fingers in sight.

        A slower movement has a proportionally smaller error (Schmidt, Zelaznik, Hawkins, Frank and
        Quinn 1979).
        """
        # 2.3 bits more (Fitts 1954): 1 cm to spare on each side instead of 5 cm
        reach_s = self.reach_s + 0.3
        return replace(self, reach_s=reach_s, miss_m=self.miss_m * self.reach_s / reach_s)


class Taker:
    """Reaches for an object at rest in the robot's hand, takes over its weight and takes it away.

    Attributes:
        brought: whether the movement is over.
    """

    def __init__(self, hand: CompliantHand, manner: Manner) -> None:
        self.hand, self._manner, self.brought = hand, manner, False
        self._rested_s: float | None = None
        self._from_m, self._to_m = hand.position_m.copy(), hand.position_m.copy()
        self._begun_s = self._held_s = np.inf

    def step(self, time_s: float, seen: SeenRobot) -> None:
        """Set target and lift of the hand at a time."""
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
        to_m: position to which the hand brings it (3,); it may change on the way.
    """

    def __init__(self, hand: CompliantHand, manner: Manner, to_m: Floats) -> None:
        self.hand, self._manner = hand, manner
        self._from_m, self.to_m = hand.position_m.copy(), to_m
        self._closed_s: float | None = None
        self._opened_s: float | None = None
        self._met_s = self._gone_s = np.inf
        self._carried_n, hand.lift_n = hand.felt_n, manner.weight_n

    def step(self, time_s: float, seen: SeenRobot) -> None:
        """Set target and lift of the hand at a time; it starts after the reaction time."""
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
        """Notice whether the fingers closed, or opened again while the person holds the object."""
        if closed or not self.hand.holds:
            self._opened_s = None
            if closed and self._closed_s is None:
                self._closed_s = time_s
        elif self._closed_s is not None:
            self._opened_s = time_s if self._opened_s is None else self._opened_s
            if time_s - self._opened_s > self._manner.reaction_s:
                self._closed_s, self.hand.lift_n = None, self._manner.weight_n


def progress(share: float) -> float:
    """Minimum-jerk progress from 0 to 1 (Flash and Hogan 1985); `share` of the time is clipped."""
    tau = min(max(share, 0.0), 1.0) if np.isfinite(share) else 0.0
    return tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
