# SPDX-License-Identifier: Apache-2.0
"""Plans the commands of the activation from the motion under way."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import Command, PlannedWay, PredictedInteraction
from intent_recognition.activation.things import SEARCH_EVERY_NS, Things
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import position_violation
from intent_recognition.motion import (
    BEGINNING,
    ClearPath,
    JointPath,
    JointPlan,
    JointReference,
    NominalTiming,
    Obstruction,
    PhaseState,
    PredictedPerson,
    Separation,
    Via,
    brake_along,
    make_path,
    phase_times_ns,
    plan_interaction,
    posture_plan,
    stop_plan,
    way_of,
)

_HEADROOM = 0.93
"""Share of the permitted speed that a further plan aims at, since its grid and its offset add to
it: the first or second further plan mostly keeps the permitted speed."""

_STRETCHES = (1.0, 2.0, 4.0, 4.0, 4.0, 4.0)
"""Factor on the time in which the start's offset decays, for each further plan. At 4 it decays no
faster than permitted near people; a larger one would leave some offset until the arm comes near
somebody else."""

_MOVED_M = 0.01
"""Change of where people are predicted to be from which a slowed motion is planned again [m]: by
the formula it permits some 0.02 m/s more, and a person's point moves as much at rest."""

_Planner = Callable[[Floats | None, float], JointPlan | None]
"""Function of a ceiling of the phase rate (G,) [1/s] or None, and of a factor on the time in which
the offset decays. Returns a plan, or None if there is none."""


class Motions:
    """Plans from the reference that the arm will have when a command takes over.

    Attributes:
        people: where people are predicted to be, as far as that is known.
        corrected: the prediction that is followed, if a person corrected it by hand; else None.
    """

    def __init__(self, common: Common, arm: ArmTracking):
        self._common, self._arm = common, arm
        self._reject, self._counts = common.reject, common.counts
        self._followed: ClearPath | None = None  # of the interaction under way
        self._planned_under: tuple[object, ...] = ((), None, None, None)
        self._tried_ns = 0
        self.people: tuple[PredictedPerson, ...] = ()
        self.corrected: PredictedInteraction | None = None
        self.things = Things(common, arm)

    def interact(
        self,
        now_ns: int,
        prediction: PredictedInteraction,
        start_ns: int,
        start: JointReference,
        progress: PhaseState = BEGINNING,
        vias: tuple[Via, ...] = (),
    ) -> Command | None:
        """Follow a prediction from a reference on; None if no plan keeps limits and is clear."""
        if vias and self._common.settings.correction is not None:
            path = self._common.settings.correction.corrected(
                prediction.path, prediction.label, vias, self._common.settings.limits
            )
            prediction = prediction._replace(path=path)
        if progress is BEGINNING:
            self._followed = None
        label, self.things.obstruction = prediction.label, None
        found = self.things.clear(now_ns, prediction.path, label, progress.phase, self._followed)
        if isinstance(found, Obstruction):
            self.things.block(label, found)
            return None
        start_ns += round(1e9 * found.later_s)
        way = self._way_along(
            "interaction", found.path, prediction.onset_ns, start_ns, start, progress
        )
        if way is None:
            far = position_violation(start.position, self._common.settings.limits).max()
            cure = f" from {far:.1f} rad outside: is joint_states in radians?" if far > 0.1 else ""
            self._reject("infeasible", f"no plan for {label} keeps the limits{cure}")
            return None
        plan, touched = way.plan, self._obstruction(way.plan)
        if touched is not None:
            self.things.block(label, touched)
            return None
        self.things.begun()
        self._followed = found
        self.corrected = prediction if vias else None
        self._counts["planned"] += 1
        self._counts["slowed"] += plan.slowed
        self._counts["clamped"] += bool(plan.clamped)
        for how in ("bent", "replanned"):
            self._counts[how] += found.how == how
        return self._send_way(now_ns, start_ns, way)

    def _along(
        self, path: JointPath, timing: NominalTiming, start: JointReference, progress: PhaseState
    ) -> _Planner:
        """A planner for a path under ceilings of the phase rate; a faster arm brakes along it."""
        limits = self._common.settings.limits

        def plan(rate_ceiling: Floats | None, stretch: float) -> JointPlan | None:
            if rate_ceiling is not None and progress.rate > 0.0:
                brake = stop_plan(path, start, limits, progress)
                begins = np.arange(len(rate_ceiling)) / len(rate_ceiling)
                braking = np.interp(begins, brake.phase, brake.phase_rate, left=progress.rate)
                rate_ceiling = np.maximum(rate_ceiling, braking)
            return plan_interaction(path, timing, start, limits, progress, rate_ceiling, stretch)

        return plan

    def _planner(
        self, path: JointPath, timing: NominalTiming, start: JointReference, progress: PhaseState
    ) -> _Planner:
        """A planner as `_along` makes it, slow at slow places, too."""
        again = self._along(path, timing, start, progress)
        places = self._common.settings.slow_places
        if places is None:
            return again
        always = places.rate_ceiling(path)

        def plan(rate_ceiling: Floats | None, stretch: float) -> JointPlan | None:
            ceiling = always if rate_ceiling is None else np.minimum(always, rate_ceiling)
            for longer in (stretch, 4.0):  # a slower decay of the offset is slower at places, too
                found = again(ceiling, longer)
                slow = self._slow_at_places(found, start)
                if slow is not None or found is None:
                    return slow
            return None

        return plan

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
                slow = replace(slow, clamped=plan.clamped, slowed=plan.slowed)
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

    def _slowed(
        self,
        plan: JointPlan | None,
        path: JointPath,
        start_ns: int,
        start: JointReference,
        again: _Planner,
    ) -> JointPlan | None:
        """A plan along a path that keeps the speeds permitted near people; None if there is none.

        Slowing changes where the arm is at each time, hence its distance from people: each round
        lowers the ceiling of the rate by the distances along the plan before. At last, from
        rest, the plan's own way is slowed, since the decay of an offset may be too fast itself.
        """
        separation, people, ceiling = self._separation, self.people, None
        if plan is None or separation is None:
            return plan

        def ceiling_of(path: JointPath, plan: JointPlan) -> Floats:
            times_ns = phase_times_ns(plan, start_ns)
            there, _, _ = plan.sampled((times_ns - start_ns) * 1e-9)
            ceilings = [separation.rate_ceiling(path, times_ns, who, there) for who in people]
            return np.asarray(_HEADROOM * np.min(ceilings, axis=0))

        slow: JointPlan | None = plan
        for stretch in (*_STRETCHES, None):
            if slow is None:
                break
            if separation.worst_excess(slow, start_ns, people) <= 1.0:
                self._counts["slowed by person"] += ceiling is not None
                return slow
            plan = slow
            if stretch is not None:
                newer = ceiling_of(path, plan)
                ceiling = newer if ceiling is None else np.minimum(_HEADROOM * ceiling, newer)
                slow = again(ceiling, stretch)
        if start.velocity.any():
            return None
        own = replace(plan, phase=plan.times_s / plan.duration_s)
        places = self._common.settings.slow_places
        slow = self._slow_on_its_way(
            plan,
            start,
            lambda way: ceiling_of(way, own),
            lambda plan: max(
                separation.worst_excess(plan, start_ns, people),
                0.0 if places is None else places.excess(plan),
            ),
        )
        self._counts["slowed by person"] += slow is not None
        return slow

    def _obstruction(self, plan: JointPlan, since_s: float = 0.0) -> Obstruction | None:
        clearance = self._common.settings.clearance
        return None if clearance is None else clearance.obstruction(plan, since_s)

    def stop(self, now_ns: int) -> Command | None:
        """Stop along the way of the command in force.

        None if that is a stop already, or if stopping would leave the limits: the command in force
        ends at rest inside them.
        """
        if self._arm.under_way(now_ns) and self._arm.in_force().plan.kind == "stop":
            return None
        return self._brake(now_ns)

    def go_home(
        self, now_ns: int, target: Floats, start: JointReference | None = None
    ) -> Command | None:
        """Go to a posture, braking first if no plan starts from the motion under way.

        The motion begins at `start`, by default the running reference. If the straight way is not
        clear, another one is planned once the arm is at rest. None if the command under way goes
        home already, braking would leave the limits, or no way is clear.
        """
        current, moves = self._arm.current, self._arm.under_way(now_ns)
        if current is not None and moves and current.plan.kind == "home":
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.in_force().at(start_ns) if start is None else start
        way = self._way_to(start_ns, start, target)
        if way is None and not moves:
            self._reject("infeasible", "no plan home keeps the limits and the permitted speeds")
            return None
        if way is None or (moves and self._obstruction(way.plan) is not None):
            return self._brake(now_ns)
        return self._send_clear(now_ns, start_ns, start, way, "the way home")

    def _way_to(
        self, start_ns: int, start: JointReference, target: Floats, kind: str = "home"
    ) -> PlannedWay | None:
        """A way to a posture, slowed near people; None if no plan keeps limits and speeds."""
        settings = self._common.settings
        plan = posture_plan(start, target, settings.limits)
        if plan is None:
            return None
        rate = 1.0 / plan.duration_s
        path = way_of(plan)
        timing = NominalTiming(0.0, plan.duration_s)
        uniform = np.full_like(plan.times_s, rate)
        timed = replace(plan, phase=plan.times_s * rate, phase_rate=uniform)
        free = self._slow_at_places(timed, start)
        progress = PhaseState(rate=rate) if start.velocity.any() else BEGINNING
        again = self._planner(path, timing, start, progress)
        slowed = self._slowed(free, path, start_ns, start, again)
        if slowed is None:
            return None
        plan = replace(slowed, clamped=plan.clamped)
        return PlannedWay(kind, plan, path, slowed=slowed is not free)

    def _way_along(
        self,
        kind: str,
        path: JointPath,
        onset_ns: int | None,
        start_ns: int,
        start: JointReference,
        progress: PhaseState,
    ) -> PlannedWay | None:
        """A way along a path from a phase on; None if no plan keeps limits and permitted speeds."""
        onset_s = -progress.phase * path.duration_s
        if onset_ns is not None:
            onset_s = (onset_ns - start_ns) * 1e-9
        timing = NominalTiming(onset_s, path.duration_s)
        again = self._planner(path, timing, start, progress)
        free = again(None, 1.0)
        plan = self._slowed(free, path, start_ns, start, again)
        return None if plan is None else PlannedWay(kind, plan, path, onset_ns, plan is not free)

    def _send_way(self, now_ns: int, start_ns: int, way: PlannedWay) -> Command:
        plan, way = way.plan, way._replace(people=self.people)
        if way.kind != "interaction":
            standing = np.zeros_like(plan.phase)
            plan = replace(plan, kind=way.kind, phase=standing, phase_rate=standing)
        command = self._arm.put_in_force(now_ns, Command(start_ns, plan, way=way))
        self._planned_under = self._conditions
        return command

    def _moved(self, command: Command, before: tuple[PredictedPerson, ...]) -> bool:
        """Whether people, as predicted for the time of a command, are not where they were."""
        if len(self.people) != len(before):
            return True
        times_ns = command.start_ns + 1e9 * command.plan.times_s
        pairs = zip(self.people, before, strict=True)
        return any(now.moved_m(was, times_ns) > _MOVED_M for now, was in pairs)

    @property
    def _conditions(self) -> tuple[object, ...]:
        """What plans depend on: their speed on the first three, clearance on the last two."""
        settings = self._common.settings
        return self.people, settings.separation, self._arm.current, settings.clearance

    def keep_pace(self, now_ns: int) -> Command | None:
        """Change the speed of the motion under way, or brake along its path; None to leave it.

        Checks the motion when the prediction of people, the things or the described arm have
        changed since it was planned, or later commands were lost. If no plan keeps the permitted
        speeds and is clear, the arm brakes, and looks for a way on every `SEARCH_EVERY_NS`.
        """
        current, start_ns = self._arm.current, self._arm.switch_ns(now_ns)
        if current is None or current.way is None:
            return None
        way = current.way
        brakes = way.plan.kind == "stop"
        waits = brakes and 0 <= now_ns - self._tried_ns < SEARCH_EVERY_NS
        if waits or not self._arm.is_update_due(now_ns):
            return None
        before, self._planned_under = self._planned_under, self._conditions
        new = [now is not was for now, was in zip(self._planned_under, before, strict=True)]
        paced, moved = bool(self.people) and (brakes or any(new[:3])), any(new[2:])
        if not (paced or moved or brakes) or (not brakes and start_ns >= current.end_ns):
            return None
        separation, begun_ns = self._separation, current.start_ns
        too_fast = (
            paced
            and separation is not None
            and separation.worst_excess(current.plan, begun_ns, self.people, start_ns) > 1.0
        )
        since_s = (start_ns - current.start_ns) * 1e-9
        touches = moved and self._obstruction(current.plan, since_s) is not None
        quicker = paced and way.slowed and (new[1] or self._moved(current, way.people))
        if not (too_fast or touches or brakes or quicker):
            return None
        self._tried_ns = now_ns
        progress, start = way.plan.phase_at(since_s), current.at(start_ns)
        found: ClearPath | Obstruction = ClearPath(way.path)
        if touches or brakes:
            found = self.things.clear(now_ns, way.path, "", progress.phase, None)
        if isinstance(found, ClearPath):
            start_ns += round(1e9 * found.later_s)
            newer = self._way_along(way.kind, found.path, way.onset_ns, start_ns, start, progress)
            if newer is not None and self._obstruction(newer.plan) is None:
                self._counts["replanned"] += bool(found.how)
                if found.how and self._followed is not None and way.kind == "interaction":
                    self._followed = ClearPath(found.path)
                return self._send_way(now_ns, start_ns, newer)
        if brakes or not (too_fast or touches):
            return None
        self._counts["braked for person" if too_fast else "braked for things"] += 1
        brake = brake_along(way.plan, since_s, self._common.settings.limits)
        way = way._replace(plan=brake, slowed=True, blocked=touches and not too_fast)
        command = self._arm.put_in_force(now_ns, Command(start_ns, brake, way=way))
        self._planned_under = self._conditions
        return command

    def waited_in_vain(self, now_ns: int) -> bool:
        """Whether the arm has rested for `wait_s` since things came in the way."""
        current, clearance = self._arm.current, self._common.settings.clearance
        if clearance is None or current is None or current.way is None or not current.way.blocked:
            return False
        return (now_ns - current.end_ns) * 1e-9 > clearance.wait_s

    def _send_clear(
        self, now_ns: int, start_ns: int, start: JointReference, way: PlannedWay, what: str
    ) -> Command | None:
        """Go straight to a posture, or around what is in the way; None if no way is clear."""
        touched = self._obstruction(way.plan)
        if touched is not None and not self._arm.under_way(now_ns):
            ends = np.stack([start.position, way.plan.end])
            times_s = np.array([0.0, way.plan.duration_s])
            straight = make_path(times_s, ends, self._common.settings.limits)
            found = self.things.clear(now_ns, straight, "", 0.0, None)
            if isinstance(found, ClearPath):
                start_ns += round(1e9 * found.later_s)
                around = self._way_along(way.kind, found.path, None, start_ns, start, BEGINNING)
                if around is None:
                    self._reject("infeasible", f"no plan of {what} keeps limits and speeds")
                    return None
                way, touched = around, self._obstruction(around.plan)
                self._counts["replanned"] += touched is None
            else:
                touched = found
        if touched is not None:
            self.things.refuse(what, touched)
            return None
        return self._send_way(now_ns, start_ns, way)

    def _brake(self, now_ns: int) -> Command | None:
        current, start_ns = self._arm.in_force(), self._arm.switch_ns(now_ns)
        since_s = (start_ns - current.start_ns) * 1e-9
        brake = brake_along(current.plan, since_s, self._common.settings.limits)
        return None if brake.outside else self._arm.put_in_force(now_ns, Command(start_ns, brake))

    def yield_to(self, now_ns: int, target: Floats, phase: float) -> Command | None:
        """Move the reference to where a person leads the arm; None if no plan keeps the limits."""
        start_ns = self._arm.switch_ns(now_ns)
        start, settings = self._arm.in_force().at(start_ns), self._common.settings
        plan = posture_plan(start, target, settings.limits)
        if plan is None:
            return None
        done, still = np.full_like(plan.phase, phase), np.zeros_like(plan.phase)
        plan = replace(plan, kind="yield", phase=done, phase_rate=still)
        return self._arm.put_in_force(now_ns, Command(start_ns, plan))

    def go_ahead(
        self, now_ns: int, start_ns: int, start: JointReference, target: Floats
    ) -> Command | None:
        """Go to where a task begins; None if no plan keeps the limits and is clear."""
        way = self._way_to(start_ns, start, target, "pretrigger")
        if way is None or way.plan.clamped:
            self._reject("infeasible", "no plan to the start of the expected task keeps the limits")
            return None
        return self._send_clear(now_ns, start_ns, start, way, "the start of the expected task")
