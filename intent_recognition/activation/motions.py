# SPDX-License-Identifier: Apache-2.0
"""Commands of the activation, planned from the motion under way."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.settings import ActivationSettings, Command
from intent_recognition.activation.states import PredictedInteraction
from intent_recognition.motion import (
    JointPlan,
    JointReference,
    NominalTiming,
    brake_plan,
    home_plan,
    plan_interaction,
    stop_plan,
)


class Motions:
    """Plans from where the arm's reference will be when a command takes over.

    Args:
        settings: limits and how plans are made.
        arm: gets every command.
        reject: called with (reason, text) where no plan keeps the limits.
        counts: gets how often plans were made, slowed and clamped.
    """

    def __init__(
        self,
        settings: ActivationSettings,
        arm: ArmTracking,
        reject: Callable[[str, str], None],
        counts: Counter[str],
    ):
        self.settings, self._arm = settings, arm
        self._reject, self._counts = reject, counts

    def interact(
        self,
        now_ns: int,
        prediction: PredictedInteraction,
        start_ns: int,
        start: JointReference,
        progress: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Command | None:
        """Follow a prediction from a reference on; None where no plan keeps the limits.

        Args:
            now_ns: now.
            prediction: what to follow.
            start_ns: when the command takes over.
            start: the reference then.
            progress: phase, phase rate [1/s] and its derivative [1/s^2] then.
        """
        settings = self.settings
        onset_s = (prediction.onset_ns - start_ns) * 1e-9
        plan = plan_interaction(
            prediction.path,
            NominalTiming(onset_s, prediction.path.duration_s),
            start,
            *progress[:2],
            settings.limits,
            settings.plan,
            phase_acceleration=progress[2],
        )
        if plan is None:
            self._reject("infeasible", f"no plan for {prediction.label} keeps the limits")
            return None
        self._counts["planned"] += 1
        self._counts["slowed"] += plan.slowed
        self._counts["clamped"] += bool(plan.clamped)
        return self._arm.send(now_ns, Command(start_ns, plan))

    def stop(self, now_ns: int, executed: PredictedInteraction | None) -> Command | None:
        """Stop along the path of what is executed, or straight on where that is nothing.

        None where it is stopping already, and where a stop would leave the limits: the command in
        force ends at rest inside them.
        """
        if self._arm.under_way(now_ns) and self._arm.in_force().plan.kind == "stop":
            return None
        start_ns = self._arm.switch_ns(now_ns)
        return self._send_unless_outside(now_ns, start_ns, self._stop_plan(start_ns, executed))

    def go_home(
        self, now_ns: int, target: NDArray[np.float64], executed: PredictedInteraction | None
    ) -> Command | None:
        """Go to a posture, braking first where no plan starts from this motion.

        None where the command under way goes home already, or braking would leave the limits.
        """
        current, settings = self._arm.in_force(), self.settings
        if current.plan.kind == "home" and self._arm.under_way(now_ns):
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = current.at(start_ns)
        plan = home_plan(start, target, settings.limits, settings.plan)
        if plan is None:
            plan = self._stop_plan(start_ns, executed)
            return self._send_unless_outside(now_ns, start_ns, plan)
        return self._arm.send(now_ns, Command(start_ns, plan))

    def _send_unless_outside(self, now_ns: int, start_ns: int, brake: JointPlan) -> Command | None:
        """Send a brake, but none that leaves the position limits."""
        if brake.outside:
            return None
        return self._arm.send(now_ns, Command(start_ns, brake))

    def go_ahead(
        self, now_ns: int, start_ns: int, start: JointReference, target: NDArray[np.float64]
    ) -> Command | None:
        """Go to where a task begins; None where no plan keeps the limits."""
        settings = self.settings
        plan = home_plan(start, target, settings.limits, settings.plan)
        if plan is None or plan.clamped:
            self._reject("infeasible", "no plan to the start of the expected task keeps the limits")
            return None
        return self._arm.send(now_ns, Command(start_ns, replace(plan, kind="pretrigger")))

    def _stop_plan(self, start_ns: int, executed: PredictedInteraction | None) -> JointPlan:
        current = self._arm.in_force()
        start = current.at(start_ns)
        phase, rate, acceleration = current.phase_at(start_ns)
        limits, settings = self.settings.limits, self.settings.plan
        if executed is None or current.plan.kind == "home":
            return brake_plan(start, phase, limits, settings)
        return stop_plan(
            executed.path, start, phase, rate, limits, settings, phase_acceleration=acceleration
        )
