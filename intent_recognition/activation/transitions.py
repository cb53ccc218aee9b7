# SPDX-License-Identifier: Apache-2.0
"""From one state of the activation to the next as time advances."""

from dataclasses import replace

from intent_recognition.activation.correcting import Correcting
from intent_recognition.activation.interacting import Interacting
from intent_recognition.activation.parts import Parts
from intent_recognition.activation.states import (
    ActiveInteraction,
    Arrived,
    Command,
    Executing,
    Homing,
    Idle,
    Pretriggered,
    State,
    Stopped,
    Transition,
    Yielding,
)
from intent_recognition.activation.waiting import Waiting

_PACED = (Executing, Arrived, Pretriggered)
"""States whose motion may go on at another speed; Homing first checks whether the arm is near its
reference (`Waiting.step_homing`)."""


class Transitions:
    """Decides the next state and its command."""

    def __init__(self, parts: Parts, waiting: Waiting, correcting: Correcting) -> None:
        self._parts, self._waiting, self._correcting = parts, waiting, correcting
        self._arm, self._motions, self._people = parts.arm, parts.motions, parts.people
        self._pretrigger, self._counts = parts.pretrigger, parts.counts
        self.exchanging_until_ns = 0
        self.interacting = Interacting(parts, waiting)

    def following(self, state: State, now_ns: int) -> Transition:
        """The next state, and the command to send on the way there.

        If no motion begins or is updated, the motion under way keeps the pace that people permit.
        """
        found = self._following(state, now_ns)
        if found.command is None and isinstance(found.state, _PACED):
            found = found._replace(command=self._motions.keep_pace(now_ns))
        return found

    def _following(self, state: State, now_ns: int) -> Transition:
        match state:
            case Idle():
                begun = self.interacting.begin(now_ns) or self._waiting.go_ahead(now_ns)
                return begun or Transition(state, self._brake_again(now_ns))
            case Executing():
                return self._from_executing(state, now_ns)
            case Arrived():
                return self._from_arrived(state, now_ns)
            case Stopped():
                return self._from_stopped(state, now_ns)
            case Homing():
                begun = self.interacting.begin(now_ns) or self._waiting.go_ahead(now_ns)
                return begun or self._waiting.step_homing(now_ns, state)
            case Pretriggered():
                return self._from_pretriggered(state, now_ns)
            case Yielding():
                return self._from_yielding(state, now_ns)

    def _from_executing(self, state: Executing, now_ns: int) -> Transition:
        interaction = state.interaction
        if self._correcting.pushed(now_ns):
            return self._from_yielding(self._correcting.begin(now_ns, interaction), now_ns)
        if self._arm.current is None:  # the arm was moved, and from there nothing could begin
            return Transition(Stopped(interaction, "arm_off_reference", now_ns))
        if self._arm.phase(now_ns) >= 1.0 - 1e-6:
            if not interaction.over:
                self._parts.inbox.mark_served(interaction)
            rests_ns = self._arm.in_force().end_ns  # later where it is still joining the path
            return Transition(Arrived(interaction, max(now_ns, rests_ns)))
        expected = now_ns < interaction.prediction.end_ns and not interaction.over
        waits = interaction.ordered and (self._parts.inbox.decision.idle or not self._people.named)
        withdrawn = expected and not (self._parts.inbox.decision.active or waits)
        reason = self._reason_to_halt(now_ns) or ("withdrawn" if withdrawn else "")
        if self._motions.waited_in_vain(now_ns):
            self._motions.things.refuse(interaction.prediction.label)
            reason = "would_touch"
        if reason:
            return self._stop(now_ns, reason, interaction)
        if expected and self._parts.inbox.decision.active not in ("", interaction.prediction.label):
            return self.interacting.begin(now_ns) or Transition(state)
        return self.interacting.follow(state, now_ns)

    def _from_arrived(self, state: Arrived, now_ns: int) -> Transition:
        if self._correcting.pushed(now_ns):
            return self._from_yielding(self._correcting.begin(now_ns, state.interaction), now_ns)
        interaction, active = state.interaction, self._parts.inbox.decision.active
        if active and (interaction.over or interaction.ordered):
            return self.interacting.begin(now_ns) or Transition(state)
        if self._parts.inbox.ordered is not None and (following := self.interacting.begin(now_ns)):
            return following
        if self.held(state, now_ns) and not self._correcting.deviates:
            away = self._waiting.go_ahead(now_ns) or self._waiting.go_home(now_ns, interaction)
            return away or Transition(state)
        return self.interacting.follow(state, now_ns)

    def _from_stopped(self, state: Stopped, now_ns: int) -> Transition:
        if self._arm.under_way(now_ns):
            brake = self._brake_again(now_ns)
            return Transition(replace(state, rest_ns=brake.end_ns) if brake else state, brake)
        if now_ns < self.exchanging_until_ns:
            return Transition(state)
        interaction, decision = state.interaction, self._parts.inbox.decision
        silent = self._parts.inbox.silent(now_ns)
        over = interaction is not None and interaction.over
        if decision.active and not silent and not over:
            if interaction is None or not self._goes_on(interaction, decision.active):
                return self.interacting.begin(now_ns) or Transition(state)
            resumed = self.interacting.follow(Executing(interaction), now_ns)
            if resumed.command is not None:
                return resumed
        at_rest = decision.idle and not decision.active and not silent
        if not at_rest and now_ns - state.rest_ns < self._parts.settings.hold_s * 1e9:
            return Transition(state)
        if interaction is None:
            return self._waiting.withdraw(now_ns) or Transition(state)
        home = self._waiting.go_home(now_ns, interaction)
        if home is not None and state.reason != "withdrawn" and not over:
            self._parts.inbox.mark_served(interaction)
        return home or Transition(state)

    def _goes_on(self, interaction: ActiveInteraction, label: str) -> bool:
        """Whether a task is active for the movement already served, not for a later one."""
        served, newest = interaction.prediction, self._parts.inbox.prediction
        latest_ns = max(interaction.began_ns, served.onset_ns)
        return label == served.label and (newest is None or newest.onset_ns <= latest_ns)

    def _from_pretriggered(self, state: Pretriggered, now_ns: int) -> Transition:
        activated = self.interacting.begin(now_ns)
        if activated is not None:
            return activated
        reason = self._reason_to_halt(now_ns) if self._arm.under_way(now_ns) else ""
        if reason:
            self._pretrigger.end()
            return self._stop(now_ns, reason, None)
        return self._waiting.step_ahead(now_ns, state)

    def _from_yielding(self, state: Yielding, now_ns: int) -> Transition:
        newest = self._parts.inbox.prediction if self._parts.inbox.decision.active else None
        found = self._correcting.step(now_ns, state, newest)
        return self._stop(now_ns, found, state.interaction) if isinstance(found, str) else found

    def held(self, state: Arrived, now_ns: int) -> bool:
        """Whether the arm has stayed at the end for `hold_s`, and no object is changing hands."""
        waited = now_ns - state.since_ns >= self._parts.settings.hold_s * 1e9
        return waited and now_ns >= self.exchanging_until_ns

    # Halting

    def _stop(self, now_ns: int, reason: str, interaction: ActiveInteraction | None) -> Transition:
        self._counts[f"stopped: {reason}"] += 1
        command = self._motions.stop(now_ns)
        return Transition(Stopped(interaction, reason, self._arm.in_force().end_ns), command)

    def _brake_again(self, now_ns: int) -> Command | None:
        """Brake an arm under way whose last brake was lost, or would have left the limits."""
        due = self._arm.under_way(now_ns) and self._arm.is_update_due(now_ns)
        return self._motions.stop(now_ns) if due else None

    def _reason_to_halt(self, now_ns: int) -> str:
        silent = self._parts.inbox.silent(now_ns)
        return "stream_stopped" if silent else self._arm.off_command(now_ns)
