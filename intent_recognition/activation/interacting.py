# SPDX-License-Identifier: Apache-2.0
"""Begins the interaction of the active task, and follows its newest prediction."""

from dataclasses import replace
from typing import NamedTuple

from intent_recognition.activation.inbox import EstimatorInbox
from intent_recognition.activation.parts import Parts
from intent_recognition.activation.states import (
    ActiveInteraction,
    Arrived,
    Executing,
    PredictedInteraction,
    Transition,
)
from intent_recognition.activation.things import SEARCH_EVERY_NS
from intent_recognition.activation.waiting import Waiting


class _Blocked(NamedTuple):
    """An interaction that waits for a clear way, until a time."""

    inbox: EstimatorInbox
    prediction: PredictedInteraction
    tried_ns: int
    until_ns: int


class Interacting:
    """Begins an interaction, and replans it while it runs.

    If no way is clear, it tries again with each new prediction, and for `Clearance.wait_s` after
    the movement, since things and people move. If people have names, it tries as long as somebody
    waits, even while their hands are too near for the arm to come.
    """

    def __init__(self, parts: Parts, waiting: Waiting) -> None:
        self._parts, self._waiting, self._counts = parts, waiting, parts.counts
        self._arm, self._motions, self._pretrigger = parts.arm, parts.motions, parts.pretrigger
        self._blocked: _Blocked | None = None
        self._tried_ns = 0

    @property
    def waits_for(self) -> str:
        """The task that waits for a clear way, and what is in the way; empty if none waits."""
        obstruction = self._motions.things.obstruction
        if self._blocked is None or obstruction is None:
            return ""
        return f"{self._blocked.prediction.label}: {obstruction}"

    def forget(self) -> None:
        """Wait for a clear way no longer."""
        self._blocked = None

    def begin(self, now_ns: int) -> Transition | None:
        """Start the active, ordered or waiting task; None if there is none or it cannot start."""
        inbox = self._parts.inbox
        waits = self._parts.people.named and not inbox.decision.active
        if waits and inbox.refused and now_ns - self._tried_ns < SEARCH_EVERY_NS:
            return None
        prediction = inbox.startable(now_ns) or self._waited_for(now_ns)
        if prediction is None:
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.start_reference(now_ns, start_ns)
        inbox.unused, inbox.refused, self._tried_ns = False, True, now_ns
        if start is None:
            return None
        if not waits:
            inbox.ordered = None
        if self._waiting.home is None:
            self._waiting.home = start.position
        command = self._motions.interact(now_ns, prediction, start_ns, start)
        if command is None:
            self._wait(now_ns, prediction)
            return None
        self._blocked = None
        if self._pretrigger.label:
            right = self._pretrigger.label == prediction.label
            self._counts["pretrigger right" if right else "pretrigger wrong"] += 1
        inbox.refused, inbox.ordered = False, None
        self._pretrigger.interaction_began()
        inbox.mark_served(None)
        self._counts["started"] += 1
        ordered = not inbox.decision.active
        interaction = ActiveInteraction(prediction, now_ns, ordered=ordered)
        return Transition(Executing(interaction), command)

    def _wait(self, now_ns: int, prediction: PredictedInteraction) -> None:
        clearance, blocked = self._parts.settings.clearance, self._blocked
        if clearance is None or (blocked is None and self._motions.things.obstruction is None):
            return
        until_ns = now_ns + round(1e9 * clearance.wait_s)
        same = blocked is not None and blocked.prediction.label == prediction.label
        if blocked is None or not same or blocked.inbox is not self._parts.inbox:
            self._counts["waited"] += 1
        elif not self._parts.inbox.decision.active:
            until_ns = blocked.until_ns
        self._blocked = _Blocked(self._parts.inbox, prediction, now_ns, until_ns)

    def _waited_for(self, now_ns: int) -> PredictedInteraction | None:
        """The waiting prediction, if due; refused if another task has begun or the wait is over."""
        blocked = self._blocked
        if blocked is None:
            return None
        label, active = blocked.prediction.label, blocked.inbox.decision.active
        if active not in ("", label) or (not active and now_ns > blocked.until_ns):
            self._motions.things.refuse(label)
            self._blocked = None
            return None
        due = now_ns - blocked.tried_ns >= SEARCH_EVERY_NS and blocked.inbox is self._parts.inbox
        return blocked.prediction if due and not self._parts.inbox.silent(now_ns) else None

    def follow(self, state: Executing | Arrived, now_ns: int) -> Transition:
        """Follow the newest prediction of the running task, if an update is due."""
        inbox, arm, current = self._parts.inbox, self._arm, self._arm.current
        label, prediction = state.interaction.prediction.label, inbox.prediction
        due = inbox.unused and not state.interaction.over and arm.is_update_due(now_ns)
        if not due or prediction is None or current is None:
            return Transition(state)
        if not prediction.label == inbox.decision.active == label or arm.off_command(now_ns):
            return Transition(state)
        start_ns = arm.switch_ns(now_ns)
        start, progress = current.at(start_ns), current.phase_at(start_ns)
        inbox.unused = False
        vias = state.interaction.vias
        command = self._motions.interact(now_ns, prediction, start_ns, start, progress, vias)
        if command is None:
            return Transition(state)
        interaction = state.interaction.recognised(prediction)
        return Transition(replace(state, interaction=interaction), command)
