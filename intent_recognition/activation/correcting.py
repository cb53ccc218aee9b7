# SPDX-License-Identifier: Apache-2.0
"""Corrections by hand: detects that a person moves the arm, yields, and goes on from there."""

from dataclasses import replace

import numpy as np

from intent_recognition.activation.arm_tracking import same_posture
from intent_recognition.activation.parts import Parts
from intent_recognition.activation.states import (
    ActiveInteraction,
    Executing,
    PredictedInteraction,
    Transition,
    Yielding,
)
from intent_recognition.array_types import Floats
from intent_recognition.motion import Correction, PhaseState, Via, phase_of, with_via


class Correcting:
    """Detects pushes and yields to them, if `settings.correction` is set."""

    def __init__(self, parts: Parts) -> None:
        self._common, self._counts = parts.common, parts.counts
        self._arm, self._motions = parts.arm, parts.motions
        self._forget()

    def _forget(self) -> None:
        self._pushed_since_ns: int | None = None
        self._rests_since_ns: int | None = None
        self._off = False

    def observe(self) -> None:
        """Compare the newest joint state with its reference."""
        compared, correction = self._arm.compared(), self._common.settings.correction
        if compared is None or correction is None:
            self._forget()
            return
        measured, reference = compared
        position, time_ns, detector = measured.position, measured.time_ns, correction.detector
        settings = self._common.settings
        error_rad = settings.limits.largest(position - reference.position)
        self._off = bool(error_rad > settings.max_tracking_error_rad)
        if not (self._off or detector.deviates(position, reference)):
            self._pushed_since_ns = None
        elif self._pushed_since_ns is None:
            self._pushed_since_ns = time_ns
        if self._pushed_since_ns is not None or not self._arm.at_rest(measured):
            self._rests_since_ns = None
        elif self._rests_since_ns is None:
            self._rests_since_ns = time_ns

    @property
    def deviates(self) -> bool:
        """Whether the arm is off its reference, even if only for a moment."""
        return self._pushed_since_ns is not None

    def pushed(self, now_ns: int) -> bool:
        """Whether the arm is pushed: far off its reference, or off it for long enough."""
        correction = self._common.settings.correction
        if correction is None or self._arm.current is None or not self._arm.fresh(now_ns):
            return False
        return self._off or _lasts(self._pushed_since_ns, now_ns, correction.detector.sustained_s)

    def begin(self, now_ns: int, interaction: ActiveInteraction) -> Yielding:
        """The state in which the arm yields from now on."""
        self._counts["yielded"] += 1
        since_ns = now_ns if self._pushed_since_ns is None else self._pushed_since_ns
        return Yielding(interaction, since_ns, self._arm.phase(now_ns))

    def step(
        self, now_ns: int, state: Yielding, newest: PredictedInteraction | None
    ) -> Transition | str:
        """Follow the person who leads the arm, go on once they let go, or return why to stop."""
        compared, correction = self._arm.compared(), self._common.settings.correction
        if compared is None or correction is None or not self._arm.fresh(now_ns):
            return "stale_joint_states"
        measured, reference = compared
        if _lasts(self._rests_since_ns, now_ns, correction.release_s):
            return self._go_on(now_ns, state, measured.position, newest, correction)
        explained = correction.detector.explained
        residual = correction.detector.residual(measured.position, reference)
        # short of the led posture by what the controller explains, so that the arm does not sink
        target = reference.position + residual - np.clip(residual, -explained, explained)
        plan = self._arm.in_force().plan
        led = plan.kind != "yield" or not same_posture(target, plan.end)
        if not (led and self._arm.is_update_due(now_ns)):
            return Transition(state)
        return Transition(state, self._motions.yield_to(now_ns, target, state.phase))

    def _go_on(
        self,
        now_ns: int,
        state: Yielding,
        position: Floats,
        newest: PredictedInteraction | None,
        correction: Correction,
    ) -> Transition | str:
        interaction, phase = state.interaction, state.phase
        label = interaction.prediction.label
        if newest is not None and newest.label == label:
            interaction = interaction.recognised(newest)
        led_ns = (self._rests_since_ns or now_ns) - state.since_ns
        sustained_ns = correction.detector.sustained_s * 1e9
        if label in correction.spreads and led_ns >= sustained_ns:
            phase = phase_of(interaction.prediction.path, position, phase)
            vias = with_via(interaction.vias, Via(phase, position))
            interaction = replace(interaction, vias=vias)
            self._counts["corrected"] += 1
        self._forget()
        start_ns = self._arm.switch_ns(now_ns)
        command = self._motions.interact(
            now_ns,
            interaction.prediction,
            start_ns,
            self._arm.in_force().at(start_ns),
            PhaseState(phase),
            interaction.vias,
        )
        if command is None:
            return "correction_infeasible"
        return Transition(Executing(interaction), command)


def _lasts(since_ns: int | None, now_ns: int, duration_s: float) -> bool:
    return since_ns is not None and now_ns - since_ns >= duration_s * 1e9
