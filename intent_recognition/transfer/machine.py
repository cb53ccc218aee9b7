# SPDX-License-Identifier: Apache-2.0
"""From forces at the hand to a grip: a state machine.

It is told what the arm wants (`Request`) and what is felt (`Situation`), and says who holds the
object and how hard to grip. It knows no clock but the times of what is felt.
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
"""Speed of the hand, and how long below it, from which on an object is offered [m/s], [s].
Convention: the simulated arm's overshoot is over."""
SHARE_PER_S = 5.0
"""Fastest change of the share that counts [1/s]. People take 0.2 s and more to take over a load
(Chan et al. 2012, Fig. 4); a bump of 0.1 s, and what the filter adds to it, ends before."""
TAKEN_SHARE, LEFT_SHARE = 0.9, 0.3
"""Share at which the hand opens, and below which an offer may end. Convention: nearly all, and
less than a hand that rests on the object."""
PATIENCE_S = 4.0
"""Time after which what nobody takes is brought back [s] (docs/transfer.md)."""
SLIP_SHARE, SLIP_NS, SLIP_S = 0.2, 0.015, 0.02
"""Share of the weight that may be missing while the arm moves: what its model and the acceleration
leave unexplained; the impulse beyond it that is a slip [N s] (a cumulative sum: Page 1954), and how
long it must grow at least [s]. Single loads have a noise of 1 N, but its sum stays small, as it
comes from differences of the velocity: in 450 s of the cell's demo two sums were larger for as long
(of 11 that were larger), both with the Panda."""
INSISTS_S = 1.2
"""Time of a pull to the side after which it counts as well [s]: longer than any of
docs/transfer.md's wrong ones, and well within `PATIENCE_S`."""
PRESENT_S = 0.6
"""Time that the person's tracked hand must rest near before open fingers close [s]: it may be the
wrist that is tracked, while the fingers still bring the object. A reaction to the arm that has come
(0.23 s: Woods et al. 2015) and half a reach."""
GRIPPED_S, EMPTY_M = 0.15, 0.0015
"""Time that the fingers must have stood still on something [s], and half opening below which there
is nothing between them [m]. Convention."""
STEADY_S, STEADY_N = 0.8, 0.3
"""The person has let go when the mean load of the first and of the second half of such a time [s]
differ by less than this [N]: four standard deviations of that difference. Single loads have a noise
of 1 N, as they come from differences of velocities with 5 mrad/s, and so it cancels in their mean
(0.05 N at 200 Hz). A load that is given up over a second changes by more. The time is twice the
longest in which people give up a load (0.4 s: Chan et al. 2012): who has lowered an object may
pause, as the simulated giver does, before the hand opens."""
WEIGHED, REMEMBERED = 20, 400
"""Loads from which, and of which at most, an object is weighed. Convention: at 100 Hz 0.2 s, and
the longest way of an arm."""


class Request(Enum):
    """What the arm is about to do."""

    NOTHING = "nothing"
    HOLD = "hold"
    GIVE = "give"
    TAKE = "take"
    PUT_DOWN = "put down"


class Holding(Enum):
    """Who holds the object, and what is going on."""

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
"""States in which an object is about to change hands, and the arm must not leave."""


class Situation(NamedTuple):
    """What is felt at one moment."""

    time_s: float
    force_n: Floats  # on the hand (3,), world
    moving: bool  # whether the arm is under way to where it was told to go
    speed_m_s: float
    # distance of a finger from the middle; NaN if it is not measured
    half_opening_m: float = np.nan
    near: bool | None = None  # whether the person's hand is at the object; None if nobody tracks it
    person_m_s: float = 0.0  # speed of the person's hand; 0 if nobody tracks it
    toward: Floats | None = None  # horizontal unit vector to the person (3,); None if unknown
    rise_m_s2: float = 0.0  # acceleration of the hand upward, as late as the force
    doubt_n: float = 0.0  # how wrong the vertical force may be, as late
    open_m: float = np.inf  # half opening of fingers that are fully open

    @property
    def heaviness(self) -> float:
        """Vertical load of an object by its weight, as the hand accelerates; at least 0.5."""
        return max(1.0 + self.rise_m_s2 / g, 0.5)


class TransferOutput(NamedTuple):
    """What to do in a state: how hard each finger presses, 0 for open.

    The person has a share of the load from 0 to 1, or 0 where it does not matter. The weight is as
    far as it is known.
    """

    holding: Holding
    share: float
    weight_n: float
    grip_n: float
    slip: bool


class TransferMachine:
    """Holds, offers, releases, takes and brings back one object after the other.

    After its patience an offer ends, and nothing is received any more.
    """

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self.holding, self.weight_n = Holding.EMPTY, 0.0
        self._share, self._factor, self._waited_in_vain = 0.0, 1.0, False
        self._opened_s, self._closed_in_vain = 0.0, False
        self._loads: deque[tuple[float, Floats]] = deque(maxlen=REMEMBERED)
        self._since: dict[str, float] = {}
        self._entered_s, self._time_s = 0.0, np.nan
        self._half_opening_m, self._missing_ns, self._missing_s = np.nan, 0.0, 0.0

    def carry(self, weight_n: float = 0.0) -> None:
        """Begin with an object between the fingers; its weight is measured if it is not given."""
        self._enter(Holding.CARRYING, self._time_s)
        self.weight_n, self._factor = weight_n, 1.0

    def drop(self) -> None:
        """Begin with empty fingers."""
        self._enter(Holding.EMPTY, self._time_s)
        self.weight_n, self._factor = 0.0, 1.0

    def step(self, request: Request, now: Situation) -> TransferOutput:
        """Take what is felt, and say what to do.

        Times should grow; after a gap, or where they go back, one step counts as short. Where the
        clock was set back, the state begins anew.
        """
        first = np.isnan(self._time_s)
        step_s = 0.0 if first else now.time_s - self._time_s
        if step_s < -CLOCK_BACK_S:
            self._enter(self.holding, now.time_s)
            self._opened_s = now.time_s
        step_s = min(max(step_s, 0.0), 0.02)  # the share does not jump after a gap
        self._time_s = now.time_s
        grips = EMPTY_M <= now.half_opening_m < now.open_m - EMPTY_M
        carries = -now.force_n[2] > 0.5 * LIGHTEST_N and grips
        if first and carries and self.holding is Holding.EMPTY:
            self.carry()  # for a node that died; on nothing the fingers close, and open again
        reach = SHARE_PER_S * step_s
        self._share += float(np.clip(self._felt_share(now) - self._share, -reach, reach))
        slip = False
        if self.holding in (Holding.CARRYING, Holding.OFFERING, Holding.RETURNING):
            self._weigh(now)
            slip = self._slips(now, step_s)
            if self._lasts("lost", now.half_opening_m < EMPTY_M, now.time_s, GRIPPED_S):
                self.drop()  # somebody pulled it out, or it fell
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
        """Wait for an object between fingers that stand open, also after they closed on nothing."""
        presented = now.near is not False and now.person_m_s < SETTLED_M_S
        late = now.time_s - self._opened_s > self._patience_s
        self._waited_in_vain = late and (self._closed_in_vain or not presented)
        ready = self._fingers_stand(now) and presented
        if request is not Request.TAKE or now.moving or self._waited_in_vain:
            self._enter(Holding.EMPTY, now.time_s)
        elif self._lasts("present", ready, now.time_s, PRESENT_S):
            self._enter(Holding.CLOSING, now.time_s)

    def _closing(self, request: Request, now: Situation) -> None:
        """Wait until the fingers stand; on nothing they open again."""
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
        """Hold together with the person until the load is the object's alone."""
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
        if now.time_s - self._entered_s > 0.3:  # 40 mm at 0.15 m/s
            self.drop()

    def _grip(self, now: Situation) -> float:
        if self.holding in (Holding.EMPTY, Holding.RECEIVING, Holding.RELEASING):
            return 0.0
        if self.holding is Holding.CLOSING:
            return 8.0  # firm, and harmless
        load_n = float(np.linalg.norm(now.force_n))
        grip_n = carrying_grip(max(load_n, self.weight_n))
        # more than a person needs who lifts and pulls at once
        if load_n < 2.5 * max(self.weight_n, LIGHTEST_N):
            grip_n = min(grip_n, offering_grip(self._share, self.weight_n))
        return min(self._factor * grip_n, MOST_N)

    def _felt_share(self, now: Situation) -> float:
        """What the person has taken over of an offer; a long pull to any side counts, too."""
        if self.holding is not Holding.OFFERING or now.near is False:
            return 0.0
        toward = now.toward
        if toward is not None:
            level_n = np.hypot(*now.force_n[:2])
            # no push: the force is within 120 degrees of the way to the person
            pulls = level_n > LIGHTEST_N and now.force_n @ toward > -0.5 * level_n
            if self._lasts("pull", bool(pulls), now.time_s, INSISTS_S):
                toward = None
        return load_share(now.force_n, self.weight_n, toward)

    def _slips(self, now: Situation, step_s: float) -> bool:
        """Less than the weight is carried, and nobody takes it: grip harder from now on."""
        if self._share > 0.0 or self.weight_n < 2.0:  # the least grip holds it
            self._missing_ns = self._missing_s = 0.0
            return False
        expected_n = self.weight_n * now.heaviness
        missing_n = (1.0 - SLIP_SHARE) * expected_n + float(now.force_n[2]) - now.doubt_n
        self._missing_ns = min(max(self._missing_ns + missing_n * step_s, 0.0), 2.0 * SLIP_NS)
        self._missing_s = self._missing_s + step_s if self._missing_ns > 0.0 else 0.0
        slips = self._missing_ns > SLIP_NS and self._missing_s > SLIP_S - 1e-9
        if slips:  # what was still carried on average shows the friction
            mean_n = self._missing_ns / self._missing_s
            carried_n = max((1.0 - SLIP_SHARE) * expected_n - mean_n, 0.1 * expected_n)
            # it must stop the object, too, and the load is still falling
            self._factor = max(self._factor, 2.0 * expected_n / carried_n)
        return slips

    def _weigh(self, now: Situation) -> None:
        """The weight is the median of loads since the lift: a bump does not count."""
        if self.holding is not Holding.CARRYING or -now.force_n[2] < 0.25 * LIGHTEST_N:
            return
        self._remember(now._replace(force_n=now.force_n / now.heaviness), np.inf)
        if len(self._loads) >= WEIGHED:
            self.weight_n = -float(np.median([force[2] for _, force in self._loads]))

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
