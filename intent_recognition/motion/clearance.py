# SPDX-License-Identifier: Apache-2.0
"""Plans that keep clear of boxes and of the arm itself: bent within the spread, or refused."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics import Bodies, Contact, JointLimits
from intent_recognition.motion.bending import Spread, bend
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.plan import JointPlan

LARGEST_BEND = 3.0
"""A path is bent by at most so many standard deviations. Convention: nearly all that was taught."""
N_SAMPLES = 61
"""Samples of a path that is looked at. Convention: some centimetres of a reach from one to the
next; of a plan, nothing is left out."""


class Obstruction(NamedTuple):
    """What a motion would come too near to first.

    Attributes:
        bodies: names of the two.
        where: of the motion, for people.
    """

    bodies: tuple[str, str]
    where: str

    def __str__(self) -> str:
        return f"{self.bodies[0]} would touch {self.bodies[1]} {self.where}"


class Clearance:
    """Keeps motions clear of things.

    Args:
        bodies: the arm among boxes.
        spreads: how each task's motion may vary, by label; other tasks are never bent.
        largest_bend: standard deviations by which a path is bent at most.
    """

    def __init__(
        self, bodies: Bodies, spreads: Mapping[str, Spread], largest_bend: float = LARGEST_BEND
    ) -> None:
        self.bodies, self._spreads, self._largest = bodies, spreads, largest_bend

    def obstruction(self, plan: JointPlan) -> Obstruction | None:
        """What a plan comes too near to, between its samples too; None if it is clear."""
        n = self.bodies.steps(plan.subdivided(1)[1])
        positions, travel = plan.subdivided(n)
        found = self.bodies.contacts(positions, travel, first_only=True)
        if not found:
            return None
        when = f"{float(plan.times_s[found[0].sample // n]):.2f} s from its start"
        return self._named(found[0], when)

    def clear(
        self,
        path: JointPath,
        label: str,
        phase: float,
        limits: JointLimits,
        before: NDArray[np.float64] | None = None,
    ) -> tuple[JointPath, NDArray[np.float64] | None] | Obstruction:
        """A path that keeps clear from a phase on, and by which weights it was bent.

        Args:
            path: predicted.
            label: its task.
            phase: what comes before is past.
            limits: what it must keep inside.
            before: weights by which the path of the same task was last bent: it goes on like that
                where that still serves.

        Returns:
            The path itself and None where it is clear; where no bend within the spread makes it so,
            what is in its way.
        """
        phases = np.linspace(0.0, 1.0, N_SAMPLES)
        first = min(int(phase * (N_SAMPLES - 1)), N_SAMPLES - 2)
        positions = path.spline(phases)
        found = self.bodies.contacts(positions[first:])
        if not found:
            return path, None
        in_the_way = self._named(found[0], f"at phase {phases[first + found[0].sample]:.2f}")
        spread = self._spreads.get(label)
        if spread is None:
            return in_the_way
        design = spread.design(phases, positions)
        bent = before
        if bent is None or self.bodies.contacts((positions + design @ bent)[first:]):
            bent = bend(
                self.bodies, spread, positions[first:], design[first:], found, self._largest
            )
        if bent is None:
            return in_the_way
        return path.shifted(phases, design @ bent, limits), bent

    def _named(self, contact: Contact, where: str) -> Obstruction:
        return Obstruction(self.bodies.pairs[contact.pair], where)
