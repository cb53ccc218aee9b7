# SPDX-License-Identifier: Apache-2.0
"""Plans the commands of the activation from the motion under way."""

from dataclasses import replace

import numpy as np

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.settings import Common
from intent_recognition.activation.slowing import Slowing
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
    Via,
    brake_along,
    make_path,
    posture_plan,
    way_of,
)


class Motions:
    """Plans from the reference that the arm will have when a command takes over.

    Attributes:
        things: keeps plans clear of things.
        slowing: keeps plans slow near people and at slow places.
        corrected: the prediction that is followed, if a person corrected it by hand; else None.
    """

    def __init__(self, common: Common, arm: ArmTracking):
        self._common, self._arm = common, arm
        self._reject, self._counts = common.reject, common.counts
        self._followed: ClearPath | None = None  # of the interaction under way
        self._planned_under: tuple[object, ...] = ((), None, None, None, None)
        self._tried_ns = 0
        self.corrected: PredictedInteraction | None = None
        self.things, self.slowing = Things(common, arm), Slowing(common, arm)

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
            limits, cure = self._common.settings.limits, ""
            outside = position_violation(start.position, limits)
            if limits.largest(outside) > 0.1:
                far = limits.in_words(outside)
                cure = f" from {far} outside: is joint_states in radians (or metres)?"
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
        own = replace(plan, phase=plan.times_s * rate, phase_rate=uniform)
        progress = PhaseState(rate=rate) if start.velocity.any() else BEGINNING
        plan, slowed = self.slowing.plan(path, timing, start_ns, start, progress, own)
        return None if plan is None else PlannedWay(kind, plan, path, slowed=slowed)

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
        plan, slowed = self.slowing.plan(path, timing, start_ns, start, progress)
        return None if plan is None else PlannedWay(kind, plan, path, onset_ns, slowed)

    def _send_way(self, now_ns: int, start_ns: int, way: PlannedWay) -> Command:
        plan, way = way.plan, way._replace(people=self.slowing.people)
        if way.kind != "interaction":
            standing = np.zeros_like(plan.phase)
            plan = replace(plan, kind=way.kind, phase=standing, phase_rate=standing)
        command = self._arm.put_in_force(now_ns, Command(start_ns, plan, way=way))
        self._planned_under = self._conditions
        return command

    @property
    def _conditions(self) -> tuple[object, ...]:
        """What plans depend on: their speed on the first four, clearance on the last two."""
        settings, slowing = self._common.settings, self.slowing
        arm = self._arm.current, settings.clearance
        return slowing.people, settings.separation, settings.slow_places, *arm

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
        paced, moved = self.slowing.slows and (brakes or any(new[:4])), any(new[3:])
        if not (paced or moved or brakes) or (not brakes and start_ns >= current.end_ns):
            return None
        too_fast = paced and self.slowing.too_fast(current.plan, current.start_ns, start_ns)
        since_s = (start_ns - current.start_ns) * 1e-9
        touches = moved and self._obstruction(current.plan, since_s) is not None
        # where people are unknown, a slowed way stays slow
        seen = paced and way.slowed and bool(self.slowing.people)
        quicker = seen and (new[1] or self.slowing.moved(current, way.people))
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
        people = too_fast and bool(self.slowing.people)
        self._counts["braked for person" if people else "braked for things"] += 1
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
