# SPDX-License-Identifier: Apache-2.0
"""Plans that keep clear of boxes and of the arm itself: bent, planned anew, or refused."""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Bodies, Contact, JointLimits
from intent_recognition.motion.bending import Spread, TouchingPath, bend, detours, replan
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.plan import JointPlan
from intent_recognition.motion.self_motion import HandKept, Turn

LARGEST_BEND = 3.0
"""Largest bend of a path [standard deviations]: nearly all variation of the demonstrations."""
REPLAN_BUDGET_S = 0.1
"""Processor time that replanning a path may take [s]: a requirement."""
WAIT_S = 3.0
"""Longest wait for a clear way after the person's movement [s]: as long as a prediction may be
late (`ActivationSettings.max_lateness_s`)."""
N_SAMPLES = 61
"""Samples of a path at which it is checked, some centimetres apart on a reach. A plan is checked
between its samples, too."""


class Obstruction(NamedTuple):
    """The first two bodies that come too near to each other on a motion."""

    bodies: tuple[str, str]  # names of both
    where: str  # place on the motion, in words

    def __str__(self) -> str:
        return f"{self.bodies[0]} would touch {self.bodies[1]} {self.where}"


class ClearPath(NamedTuple):
    """A path that is clear, and how it was moved."""

    path: JointPath
    # how far it was moved at `N_SAMPLES` phases (T, n) [rad]; None where it was not
    away: Floats | None = None
    how: str = ""  # "", "bent" within the spread of its task, or "replanned"
    later_s: float = 0.0  # delay of its command for the time that the search took [s]
    # how the arm turned about its hand before it was moved; None where it did not
    turn: Turn | None = None


class Clearance:
    """Keeps motions of the arm clear of things.

    Args:
        bodies: the arm among boxes.
        spreads: how each task's motion may vary, by label; paths of other tasks are never bent.
        largest_bend: largest bend of a path, in standard deviations.
        replan_budget_s: processor time that replanning a path may take; 0 switches it off.
        wait_s: how long to retry a motion without a clear way after the person's movement.
        clock: processor time [s].
    """

    def __init__(
        self,
        bodies: Bodies,
        spreads: Mapping[str, Spread],
        largest_bend: float = LARGEST_BEND,
        replan_budget_s: float = REPLAN_BUDGET_S,
        wait_s: float = WAIT_S,
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self.bodies, self._spreads, self._largest = bodies, spreads, largest_bend
        self.replan_budget_s, self.wait_s, self._clock = replan_budget_s, wait_s, clock

    def obstruction(self, plan: JointPlan, since_s: float = 0.0) -> Obstruction | None:
        """The first obstruction of a plan from a time on, also between samples; None if clear."""
        past = int(np.searchsorted(plan.times_s, since_s, side="right")) - 1
        past = int(np.clip(past, 0, len(plan.times_s) - 2))
        n = self.bodies.steps(plan.subdivided(1)[1][past:])
        positions, travel = plan.subdivided(n)
        first = past * n
        found = self.bodies.contacts(positions[first:], travel[first:], first_only=True)
        if not found:
            return None
        when = f"{float(plan.times_s[past + found[0].sample // n]):.2f} s from its start"
        return self._named(found[0], when)

    def clear(
        self,
        path: JointPath,
        label: str,
        phase: float,
        limits: JointLimits,
        before: ClearPath | None = None,
        tries: int | None = None,
    ) -> ClearPath | Obstruction:
        """A path that keeps clear from a phase on.

        Args:
            path: the predicted path.
            label: its task.
            phase: the part of the path before this phase is not checked.
            limits: limits that the path must keep.
            before: the last clear path of the same task; if moving alike is clear, that is kept.
            tries: number of failed searches, so that this one draws other detours; None draws no
                detours, for lack of time.

        Returns:
            The path itself if it is clear, a moved one, or the obstruction if no clear path is
            found. If the end of a predicted hand's path touches, a redundant arm first turns about
            the hand.
        """
        hand = self._hand(label, limits)
        if hand is None:
            return self._moved(path, label, phase, limits, before, tries)
        turn = None if before is None else before.turn
        turned = None if turn is None else hand.turned(path, turn)
        turn = None if turned is None else turn
        found = self._moved(turned or path, label, phase, limits, before, tries)
        if isinstance(found, Obstruction):
            end = hand.clear_end(self.bodies, (turned or path).spline(1.0))
            if end is not None:
                turn = Turn(phase if turn is None else turn.since, end - path.spline(1.0))
                turned = hand.turned(path, turn)
                if turned is not None:
                    found = self._moved(turned, label, phase, limits, before, tries)
        if isinstance(found, Obstruction) or turn is None:
            return found
        return found._replace(how=found.how or "replanned", turn=turn)

    def _hand(self, label: str, limits: JointLimits) -> HandKept | None:
        """The hand about which a task's arm may turn; None if its joints are predicted."""
        spread = self._spreads.get(label)
        if spread is None or spread.arm is None or not self.replan_budget_s:
            return None
        return HandKept(spread.arm, bool(spread.reference), limits)

    def _moved(
        self,
        path: JointPath,
        label: str,
        phase: float,
        limits: JointLimits,
        before: ClearPath | None,
        tries: int | None,
    ) -> ClearPath | Obstruction:
        """The path moved until it is clear, both ends fixed; arguments as of `clear`."""
        phases = np.linspace(0.0, 1.0, N_SAMPLES)
        first = min(int(phase * (N_SAMPLES - 1)), N_SAMPLES - 2)
        positions = path.spline(phases)
        found = self.bodies.contacts(positions[first:])
        if not found:
            return ClearPath(path)
        base, touching = positions, found
        if before is not None and before.away is not None:
            base = positions + before.away
            touching = self.bodies.contacts(base[first:])
            if not touching:
                same = path.shifted(phases, before.away, limits)
                return ClearPath(same, before.away, before.how)
        spread, moves = self._spreads.get(label), np.empty((*positions.shape, 0))
        if spread is not None:
            moves = spread.moves(phases, positions)
            own = TouchingPath(self.bodies, positions[first:], moves[first:], found, limits)
            z = bend(own, self._largest)
            if z is not None:
                away = moves @ z
                return ClearPath(path.shifted(phases, away, limits), away, "bent")
        z, searched = None, False
        if self.replan_budget_s:
            until_s = self._clock() + self.replan_budget_s
            waves = detours(phases, positions.shape[1], float(phases[first]))
            moves = np.concatenate([moves, waves], axis=2)
            own = TouchingPath(self.bodies, base[first:], moves[first:], touching, limits)
            z, searched = replan(own, tries, lambda: self._clock() > until_s)
        if z is None:
            return self._named(found[0], f"at phase {phases[first + found[0].sample]:.2f}")
        away = base - positions + moves @ z
        later_s = self.replan_budget_s if searched else 0.0
        return ClearPath(path.shifted(phases, away, limits), away, "replanned", later_s)

    def _named(self, contact: Contact, where: str) -> Obstruction:
        return Obstruction(self.bodies.pairs[contact.pair], where)
