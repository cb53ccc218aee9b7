# SPDX-License-Identifier: Apache-2.0
"""Plans along paths that are slow near people and at slow places."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import Command
from intent_recognition.array_types import Floats
from intent_recognition.motion import (
    BEGINNING,
    JointPath,
    JointPlan,
    JointReference,
    NominalTiming,
    PhaseState,
    PredictedPerson,
    Separation,
    phase_times_ns,
    plan_interaction,
    stop_plan,
    way_of,
)

_HEADROOM = 0.93
"""Share of the permitted speed that a further plan aims at, since its grid and its offset add to
it: the first or second further plan mostly keeps the permitted speed."""

_LONGEST = 4.0
"""Largest factor on the time in which the start's offset decays: with it, the decay is no faster
than permitted near people; a larger one would leave some offset until the arm comes near somebody
else."""

_STRETCHES = (1.0, 2.0, _LONGEST, _LONGEST, _LONGEST, _LONGEST)
"""Factor on the time in which the start's offset decays, for each further plan."""

_MOVED_M = 0.01
"""Change of where people are predicted to be from which a slowed motion is planned again [m]: by
the formula it permits some 0.02 m/s more, and a person's point moves as much at rest."""

_Planner = Callable[[Floats | None, float], JointPlan | None]
"""Function of a ceiling of the phase rate (G,) [1/s] or None, and of a factor on the time in which
the offset decays. Returns a plan, or None if there is none."""


class Slowing:
    """Keeps the speeds that are permitted near people and at slow places.

    `people` is where people are predicted to be, as far as that is known.
    """

    def __init__(self, common: Common, arm: ArmTracking):
        self._common, self._arm, self._counts = common, arm, common.counts
        self.people: tuple[PredictedPerson, ...] = ()

    def plan(
        self,
        path: JointPath,
        timing: NominalTiming,
        start_ns: int,
        start: JointReference,
        progress: PhaseState,
        own: JointPlan | None = None,
    ) -> tuple[JointPlan | None, bool]:
        """A plan along a path, and whether people slow it; None if no plan keeps the speeds.

        `own` is a plan whose way is the path; by default the path is followed at its own timing.
        Slowing changes where the arm is at each time, hence its distance from people: each round
        lowers the ceiling of the rate by the distances along the plan before. At last, from
        rest, the plan's own way is slowed, since the decay of an offset may be too fast itself.
        """
        raw, again = self._planners(path, timing, start, progress)
        plan = raw(None, 1.0) if own is None else own
        separation, people, ceiling = self._separation, self.people, None

        def excess(plan: JointPlan) -> float:
            return 0.0 if separation is None else separation.worst_excess(plan, start_ns, people)

        if plan is not None and excess(plan) <= 1.0:
            at_own_speed, plan = plan, self._slow_at_places(plan, start)
            if plan is None and own is None:
                plan = again(None, _LONGEST)
            if plan is None or plan is at_own_speed or excess(plan) <= 1.0:
                return plan, False
        if plan is None or separation is None:
            return plan, False

        def ceiling_of(path: JointPath, plan: JointPlan) -> Floats:
            times_ns = phase_times_ns(plan, start_ns)
            there, _, _ = plan.sampled((times_ns - start_ns) * 1e-9)
            ceilings = [separation.rate_ceiling(path, times_ns, who, there) for who in people]
            return np.asarray(_HEADROOM * np.min(ceilings, axis=0))

        for stretch in _STRETCHES:
            newer = ceiling_of(path, plan)
            ceiling = newer if ceiling is None else np.minimum(_HEADROOM * ceiling, newer)
            slow = again(ceiling, stretch)
            if slow is None:
                break
            if excess(slow) <= 1.0:
                self._counts["slowed by person"] += 1
                return slow, True
            plan = slow
        if start.velocity.any():
            return None, True
        uniform = replace(plan, phase=plan.times_s / plan.duration_s)
        places = self._common.settings.slow_places
        slow = self._slow_on_its_way(
            plan,
            start,
            lambda way: ceiling_of(way, uniform),
            lambda plan: max(excess(plan), 0.0 if places is None else places.excess(plan)),
        )
        self._counts["slowed by person"] += slow is not None
        return slow, True

    @property
    def slows(self) -> bool:
        """Whether anybody is near, or any place is slow."""
        return bool(self.people) or self._common.settings.slow_places is not None

    def too_fast(self, plan: JointPlan, start_ns: int, since_ns: int) -> bool:
        """Whether a plan exceeds the speeds that are permitted after a time."""
        separation, places = self._separation, self._common.settings.slow_places
        if places is not None and places.excess(plan, (since_ns - start_ns) * 1e-9) > 1.0:
            return True
        if separation is None:
            return False
        return separation.worst_excess(plan, start_ns, self.people, since_ns) > 1.0

    def moved(self, command: Command, before: tuple[PredictedPerson, ...]) -> bool:
        """Whether people, as predicted for the time of a command, are not where they were."""
        if len(self.people) != len(before):
            return True
        times_ns = command.start_ns + 1e9 * command.plan.times_s
        pairs = zip(self.people, before, strict=True)
        return any(now.moved_m(was, times_ns) > _MOVED_M for now, was in pairs)

    def _along(
        self, path: JointPath, timing: NominalTiming, start: JointReference, progress: PhaseState
    ) -> _Planner:
        """A planner for a path under ceilings of the phase rate; a faster arm brakes along it."""
        limits = self._common.settings.limits
        brake_of = cache(partial(stop_plan, path, start, limits, progress))

        def plan(rate_ceiling: Floats | None, stretch: float) -> JointPlan | None:
            if rate_ceiling is not None and progress.rate > 0.0:
                brake = brake_of()
                begins = np.arange(len(rate_ceiling)) / len(rate_ceiling)
                braking = np.interp(begins, brake.phase, brake.phase_rate, left=progress.rate)
                rate_ceiling = np.maximum(rate_ceiling, braking)
            return plan_interaction(path, timing, start, limits, progress, rate_ceiling, stretch)

        return plan

    def _planners(
        self, path: JointPath, timing: NominalTiming, start: JointReference, progress: PhaseState
    ) -> tuple[_Planner, _Planner]:
        """A planner as that of `_along`, and one whose plans keep the speeds at slow places."""
        along = self._along(path, timing, start, progress)
        places = self._common.settings.slow_places
        if places is None:
            return along, along
        always = places.rate_ceiling(path)

        def raw(rate_ceiling: Floats | None, stretch: float) -> JointPlan | None:
            return along(
                always if rate_ceiling is None else np.minimum(always, rate_ceiling), stretch
            )

        def plan(rate_ceiling: Floats | None, stretch: float) -> JointPlan | None:
            for longer in sorted({stretch, _LONGEST}):  # a slower decay is slower at places, too
                found = raw(rate_ceiling, longer)
                slow = self._slow_at_places(found, start)
                if slow is not None or found is None:
                    return slow
            return None

        return raw, plan

    def _slow_at_places(self, plan: JointPlan | None, start: JointReference) -> JointPlan | None:
        """A plan, or its own way slowed down at slow places; None if no plan keeps their speed."""
        places = self._common.settings.slow_places
        if plan is None or places is None or places.excess(plan) <= 1.0:
            return plan
        return self._slow_on_its_way(plan, start, places.rate_ceiling, places.excess)

    def _slow_on_its_way(
        self,
        plan: JointPlan,
        start: JointReference,
        ceiling_of: Callable[[JointPath], Floats],
        excess_of: Callable[[JointPlan], float],
    ) -> JointPlan | None:
        """The way of a plan under a ceiling of its rate; None if that leaves an excess above 1."""
        way = way_of(plan)
        timing, ceiling = NominalTiming(0.0, way.duration_s), ceiling_of(way)
        progress = PhaseState(rate=1.0 / way.duration_s) if start.velocity.any() else BEGINNING
        start = start._replace(acceleration=way.derivative(0.0, 1) * progress.rate**2)
        again = self._along(way, timing, start, progress)
        for share in (1.0, _HEADROOM, _HEADROOM**2):
            slow = again(share * ceiling, 1.0)
            if slow is not None and excess_of(slow) <= 1.0:
                slow = replace(slow, slowed=plan.slowed)
                return slow.with_phases_of(plan, 0.0, way.duration_s)
        return None

    @property
    def _separation(self) -> Separation | None:
        """The separation; its reaction time includes an update and the present lead of commands."""
        settings = self._common.settings
        separation, least_s = settings.separation, settings.command_period_s
        least_s += self._arm.lead_ns * 1e-9
        if separation is None or least_s <= separation.settings.reaction_s:
            return separation
        return Separation(separation.arm, replace(separation.settings, reaction_s=least_s))
