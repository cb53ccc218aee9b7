# SPDX-License-Identifier: Apache-2.0
"""State machine of a handover, from forces at the hand to grip forces.

Its inputs are what the arm wants (`Request`) and what is measured (`Situation`); its output says
who holds the object and how hard to grip. Its only clock is the time of the measurements.
"""

from collections import deque
from enum import Enum
from typing import NamedTuple

import numpy as np
from scipy.constants import g

from intent_recognition.array_types import Floats
from intent_recognition.transfer.load import CLOCK_BACK_S
from intent_recognition.transfer.sharing import (
    LIGHTEST_N,
    MOST_N,
    carrying_grip,
    load_share,
    offering_grip,
)

SETTLED_M_S, SETTLED_S = 0.05, 0.1
"""Speed of the hand, and time below it, before an object is offered [m/s], [s]; the simulated arm's
overshoot is over by then."""
SHARE_PER_S = 5.0
"""Fastest change of the person's share [1/s]. People take at least 0.2 s to take over a load (Chan
et al. 2012, Fig. 4); a bump of 0.1 s ends before, even delayed by the filter."""
TAKEN_SHARE, LEFT_SHARE = 0.9, 0.3
"""Share at which the hand opens, and share below which an offer may end: nearly all of the load,
and less than a hand that rests on the object takes."""
PATIENCE_S = 4.0
"""Time after which the arm takes back an object that nobody takes [s] (docs/transfer.md)."""
SLIP_SHARE, SLIP_NS, SLIP_S = 0.2, 0.015, 0.02
"""Detection of slips by a cumulative sum (Page 1954): share of the weight that may be missing in
motion, as model and acceleration leave it unexplained; impulse beyond it that is a slip [N s]; and
shortest time for which the sum must grow [s]. Single loads have a noise of 1 N, which mostly
cancels in the sum, as it comes from differenced velocities: in 450 s of the cell's demo 11 sums
exceeded the impulse, of which two also exceeded the time, both with the Panda."""
INSISTS_S = 1.2
"""Time after which a pull to any side counts as well [s]: longer than the mistaken pulls in
docs/transfer.md, and much shorter than `PATIENCE_S`."""
PRESENT_S = 0.6
"""Time that the person's tracked hand must rest nearby before open fingers close [s]. If the wrist
is tracked, the fingers may still be bringing the object: the time covers a reaction to the arrived
arm (0.23 s: Woods et al. 2015) and half a reach."""
GRIPPED_S, EMPTY_M = 0.15, 0.0015
"""Time for which the fingers must have stood still on something [s], and half opening below which
nothing is between them [m]."""
STEADY_S, STEADY_N = 0.8, 0.3
"""The person has let go when the mean loads of the two halves of this time [s] differ by less than
this force [N]: four standard deviations of the difference. Single loads have a noise of 1 N, which
comes from differenced velocities (5 mrad/s) and mostly cancels in the mean (0.05 N at 200 Hz). A
load that is released over a second changes by more. The time is twice the longest in which people
release a load (0.4 s: Chan et al. 2012): after lowering an object a person may pause before opening
the hand, as the simulated giver does."""
WEIGHED, REMEMBERED = 20, 400
"""Smallest and largest number of loads that give an object's weight: 0.2 s at 100 Hz, and the
longest motion of an arm."""


class Request(Enum):
    """What the arm wants to do."""

    NOTHING = "nothing"
    HOLD = "hold"
    GIVE = "give"
    TAKE = "take"
    PUT_DOWN = "put down"


class Holding(Enum):
    """State of the handover: who holds the object, and what is happening."""

    EMPTY = "empty"
    RECEIVING = "receiving"
    CLOSING = "closing"
    TAKING = "taking"
    CARRYING = "carrying"
    OFFERING = "offering"
    RELEASING = "releasing"
    RETURNING = "returning"


EXCHANGES = frozenset(
    {Holding.RECEIVING, Holding.CLOSING, Holding.TAKING, Holding.OFFERING, Holding.RELEASING}
)
"""States in which an object is about to change hands, so that the arm must stay."""


class Situation(NamedTuple):
    """Measurements at one moment."""

    time_s: float
    force_n: Floats  # force on the hand (3,), world
    moving: bool  # whether the arm is still moving to its goal
    speed_m_s: float
    # distance of a finger from the centre; NaN if not measured
    half_opening_m: float = np.nan
    near: bool | None = None  # whether the person's hand is at the object; None if not tracked
    person_m_s: float = 0.0  # speed of the person's hand; 0 if not tracked
    toward: Floats | None = None  # horizontal unit vector to the person (3,); None if unknown
    rise_m_s2: float = 0.0  # upward acceleration of the hand, delayed like the force
    doubt_n: float = 0.0  # possible error of the vertical force, with the same delay
    open_m: float = np.inf  # half opening of fully open fingers

    @property
    def heaviness(self) -> float:
        """Factor on an object's weight from the hand's acceleration; at least 0.5."""
        return max(1.0 + self.rise_m_s2 / g, 0.5)


class TransferOutput(NamedTuple):
    """State and grip force of each finger, which is 0 for open fingers.

    `share` is the person's share of the load from 0 to 1, and 0 in states where it does not matter.
    `weight_n` is the weight as far as it is known.
    """

    holding: Holding
    share: float
    weight_n: float
    grip_n: float
    slip: bool


class TransferMachine:
    """Holds, offers, releases, receives and takes back one object after another.

    Once its patience has passed it ends an offer, and stops receiving.
    """

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self.holding, self.weight_n = Holding.EMPTY, 0.0
        self._share, self._factor, self._waited_in_vain = 0.0, 1.0, False
        self._bias_n = np.zeros(3)
        self._opened_s, self._closed_in_vain = 0.0, False
        self._loads: deque[tuple[float, Floats]] = deque(maxlen=REMEMBERED)
        self._since: dict[str, float] = {}
        self._entered_s, self._time_s = 0.0, np.nan
        self._half_opening_m, self._missing_ns, self._missing_s = np.nan, 0.0, 0.0

    def carry(self, weight_n: float = 0.0) -> None:
        """Start with an object between the fingers; an unknown weight (0) is measured."""
        self._enter(Holding.CARRYING, self._time_s)
        self.weight_n, self._factor, self._bias_n = weight_n, 1.0, np.zeros(3)

    def drop(self) -> None:
        """Start with empty fingers."""
        self._enter(Holding.EMPTY, self._time_s)
        self.weight_n, self._factor, self._bias_n = 0.0, 1.0, np.zeros(3)

    def step(self, request: Request, now: Situation) -> TransferOutput:
        """Update with measurements; return the state and the grip force.

        Times should increase. A gap or a small step back counts as a short step; if the clock was
        set back, the present state starts anew.
        """
        first = np.isnan(self._time_s)
        step_s = 0.0 if first else now.time_s - self._time_s
        if step_s < -CLOCK_BACK_S:
            self._enter(self.holding, now.time_s)
            self._opened_s = now.time_s
        step_s = min(max(step_s, 0.0), 0.02)  # limits the change of the share after a gap
        self._time_s = now.time_s
        grips = EMPTY_M <= now.half_opening_m < now.open_m - EMPTY_M
        carries = -now.force_n[2] > 0.5 * LIGHTEST_N and grips
        if first and carries and self.holding is Holding.EMPTY:
            self.carry()  # after a restart; fingers closed on nothing will open again
        reach = SHARE_PER_S * step_s
        self._share += float(np.clip(self._felt_share(now) - self._share, -reach, reach))
        slip = False
        if self.holding in (Holding.CARRYING, Holding.OFFERING, Holding.RETURNING):
            self._weigh(now)
            slip = self._slips(now, step_s)
            if self._lasts("lost", now.half_opening_m < EMPTY_M, now.time_s, GRIPPED_S):
                self.drop()  # it was pulled out, or fell
        getattr(self, f"_{self.holding.value}")(request, now)
        self._half_opening_m = now.half_opening_m
        return TransferOutput(self.holding, self._share, self.weight_n, self._grip(now), slip)

    def _empty(self, request: Request, now: Situation) -> None:
        if request is Request.HOLD:
            self._enter(Holding.CLOSING, now.time_s)
        elif request is not Request.TAKE:
            self._waited_in_vain = False
        elif not (now.moving or self._waited_in_vain):
            self._opened_s, self._closed_in_vain = now.time_s, False
            self._enter(Holding.RECEIVING, now.time_s)

    def _receiving(self, request: Request, now: Situation) -> None:
        """Wait for an object between open fingers, also after they closed on nothing."""
        presented = now.near is not False and now.person_m_s < SETTLED_M_S
        late = now.time_s - self._opened_s > self._patience_s
        self._waited_in_vain = late and (self._closed_in_vain or not presented)
        ready = self._fingers_stand(now) and presented
        if request is not Request.TAKE or now.moving or self._waited_in_vain:
            self._enter(Holding.EMPTY, now.time_s)
        elif self._lasts("present", ready, now.time_s, PRESENT_S):
            self._enter(Holding.CLOSING, now.time_s)

    def _closing(self, request: Request, now: Situation) -> None:
        """Wait until the fingers stand still; if they hold nothing, open them again."""
        if self._lasts("gripped", self._fingers_stand(now), now.time_s, GRIPPED_S):
            if now.half_opening_m < EMPTY_M:
                self._closed_in_vain = True
                again = Holding.RECEIVING if request is Request.TAKE else Holding.EMPTY
                self._enter(again, now.time_s)
            elif request is Request.TAKE:
                self._enter(Holding.TAKING, now.time_s)
            else:
                self.carry()

    def _taking(self, _: Request, now: Situation) -> None:
        """Hold the object together with the person until its whole load is on the hand."""
        self._remember(now, STEADY_S)
        span_s = now.time_s - self._loads[0][0]
        loads = np.array([force for _, force in self._loads])
        half = len(loads) // 2
        change = loads[half:].mean(axis=0) - loads[:half].mean(axis=0) if half else np.inf
        steady = span_s >= 0.9 * STEADY_S and bool(np.all(np.abs(change) < STEADY_N))
        mean = loads.mean(axis=0)
        carries = mean[2] < -0.25 * LIGHTEST_N and np.hypot(*mean[:2]) < max(1.0, -0.5 * mean[2])
        gone = now.near is False
        if gone or (steady and carries):
            self.carry()

    def _carrying(self, request: Request, now: Situation) -> None:
        if request is Request.PUT_DOWN:
            self._put_down(now)
        at_rest = not now.moving and now.speed_m_s < SETTLED_M_S
        if self._lasts("rest", request is Request.GIVE and at_rest, now.time_s, SETTLED_S):
            self._enter(Holding.OFFERING, now.time_s)

    def _offering(self, request: Request, now: Situation) -> None:
        if request is not Request.GIVE or now.moving:
            self._enter(Holding.CARRYING, now.time_s)
        elif self._share >= TAKEN_SHARE:
            self._enter(Holding.RELEASING, now.time_s)
        elif now.time_s - self._entered_s > self._patience_s and self._share < LEFT_SHARE:
            self._enter(Holding.RETURNING, now.time_s)

    def _returning(self, request: Request, now: Situation) -> None:
        if request is Request.PUT_DOWN:
            self._put_down(now)
        elif request is Request.HOLD:
            self._enter(Holding.CARRYING, now.time_s)

    def _releasing(self, _: Request, now: Situation) -> None:
        if now.time_s - self._entered_s > 0.3:  # opens 40 mm at 0.15 m/s
            self.drop()

    def _grip(self, now: Situation) -> float:
        if self.holding in (Holding.EMPTY, Holding.RECEIVING, Holding.RELEASING):
            return 0.0
        if self.holding is Holding.CLOSING:
            return 8.0  # firm, but harmless
        load_n = float(np.linalg.norm(now.force_n))
        grip_n = carrying_grip(max(load_n, self.weight_n))
        # more load than a person's lifting and pulling together
        if load_n < 2.5 * max(self.weight_n, LIGHTEST_N):
            grip_n = min(grip_n, offering_grip(self._share, self.weight_n))
        return min(self._factor * grip_n, MOST_N)

    def _felt_share(self, now: Situation) -> float:
        """Share of an offer that the person has taken over; a long pull to any side counts, too."""
        if self.holding is not Holding.OFFERING or now.near is False:
            return 0.0
        force_n, toward = now.force_n - self._bias_n, now.toward
        if toward is not None:
            level_n = np.hypot(*force_n[:2])
            # not a push: the force is within 120 degrees of the direction to the person
            pulls = level_n > LIGHTEST_N and force_n @ toward > -0.5 * level_n
            if self._lasts("pull", bool(pulls), now.time_s, INSISTS_S):
                toward = None
        return load_share(force_n, self.weight_n, toward)

    def _slips(self, now: Situation, step_s: float) -> bool:
        """Detect that less than the weight is carried while nobody takes it; then grip harder."""
        if self._share > 0.0 or self.weight_n < 2.0:  # the smallest grip holds it
            self._missing_ns = self._missing_s = 0.0
            return False
        expected_n = self.weight_n * now.heaviness
        missing_n = (1.0 - SLIP_SHARE) * expected_n + float(now.force_n[2]) - now.doubt_n
        self._missing_ns = min(max(self._missing_ns + missing_n * step_s, 0.0), 2.0 * SLIP_NS)
        self._missing_s = self._missing_s + step_s if self._missing_ns > 0.0 else 0.0
        slips = self._missing_ns > SLIP_NS and self._missing_s > SLIP_S - 1e-9
        if slips:  # the mean load still carried shows the friction
            mean_n = self._missing_ns / self._missing_s
            carried_n = max((1.0 - SLIP_SHARE) * expected_n - mean_n, 0.1 * expected_n)
            # the grip must also stop the object, and the load is still falling
            self._factor = max(self._factor, 2.0 * expected_n / carried_n)
        return slips

    def _weigh(self, now: Situation) -> None:
        """Estimate weight and bias as the median of the loads since the lift, which ignores bumps.

        The bias is that of a sensor, or of torques: a horizontal load, or, if none is downward, one
        upward.
        """
        if self.holding is not Holding.CARRYING or abs(now.force_n[2]) < 0.25 * LIGHTEST_N:
            return
        self._remember(now._replace(force_n=now.force_n / now.heaviness), np.inf)
        if len(self._loads) >= WEIGHED:
            loads = [force for _, force in self._loads]
            hanging = [force for force in loads if force[2] < 0.0]  # not on a support
            usual_n = np.median(hanging if len(hanging) >= WEIGHED else loads, axis=0)
            self.weight_n = max(-float(usual_n[2]), 0.0)
            self._bias_n = usual_n + [0.0, 0.0, self.weight_n]

    def _remember(self, now: Situation, span_s: float) -> None:
        self._loads.append((now.time_s, np.array(now.force_n)))
        while now.time_s - self._loads[0][0] > span_s:
            self._loads.popleft()

    def _fingers_stand(self, now: Situation) -> bool:
        if np.isnan(now.half_opening_m):
            return True
        moved_m = abs(now.half_opening_m - self._half_opening_m)
        before = self._since.get("finger", now.time_s)
        self._since["finger"] = now.time_s
        return bool(moved_m <= 0.005 * max(now.time_s - before, 1e-6))

    def _put_down(self, now: Situation) -> None:
        if not now.moving and now.speed_m_s < SETTLED_M_S:
            self._enter(Holding.RELEASING, now.time_s)

    def _enter(self, holding: Holding, time_s: float) -> None:
        self.holding, self._entered_s = holding, time_s
        self._missing_ns = self._missing_s = 0.0
        self._loads.clear()
        self._since.clear()

    def _lasts(self, name: str, holds: bool, time_s: float, for_s: float) -> bool:
        if not holds:
            self._since.pop(name, None)
            return False
        return time_s - self._since.setdefault(name, time_s) >= for_s - 1e-9
