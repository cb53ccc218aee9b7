# SPDX-License-Identifier: Apache-2.0
"""An interaction begins when a task is active, and follows the newest prediction of it."""

from collections import Counter
from dataclasses import replace

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.inbox import EstimatorInbox
from intent_recognition.activation.motions import Motions
from intent_recognition.activation.people import People
from intent_recognition.activation.pretrigger import Pretrigger
from intent_recognition.activation.states import (
    ActiveInteraction,
    Arrived,
    Executing,
    Transition,
)
from intent_recognition.activation.waiting import Waiting


class Interacting:
    """Begins an interaction, and plans it anew while it runs.

    Args:
        arm: the commands sent, and the joints measured.
        motions: plans.
        people: whom to help; which task of theirs is active, and what is predicted.
        waiting: learns where home is when the first interaction begins.
        pretrigger: whether the arm has gone ahead for a task.
        counts: gets how often an interaction began, and whether the arm had gone ahead for it.
    """

    def __init__(
        self,
        arm: ArmTracking,
        motions: Motions,
        people: People,
        waiting: Waiting,
        pretrigger: Pretrigger,
        counts: Counter[str],
    ) -> None:
        self._arm, self._motions, self._people = arm, motions, people
        self._waiting, self._pretrigger, self._counts = waiting, pretrigger, counts

    @property
    def _inbox(self) -> EstimatorInbox:
        """Of whom the arm attends to."""
        return self._people.inbox

    def begin(self, now_ns: int) -> Transition | None:
        """Start the active task, if there is one to start and it can be started."""
        prediction = self._inbox.startable(now_ns)
        if prediction is None:
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.start_reference(now_ns, start_ns)
        self._inbox.unused, self._inbox.refused = False, True
        if start is None:
            return None
        self._inbox.ordered = None
        if self._waiting.home is None:
            self._waiting.home = start.position
        command = self._motions.interact(now_ns, prediction, start_ns, start)
        if command is None:
            return None
        if self._pretrigger.label:
            right = self._pretrigger.label == prediction.label
            self._counts["pretrigger right" if right else "pretrigger wrong"] += 1
        self._inbox.refused = False
        self._pretrigger.interaction_began()
        self._inbox.mark_served(None)
        self._counts["started"] += 1
        ordered = not self._inbox.decision.active
        interaction = ActiveInteraction(prediction, now_ns, ordered=ordered)
        return Transition(Executing(interaction), command)

    def follow(self, state: Executing | Arrived, now_ns: int) -> Transition:
        """Follow the newest prediction of the running task, if it is time for an update."""
        inbox, arm, current = self._inbox, self._arm, self._arm.current
        label, prediction = state.interaction.prediction.label, inbox.prediction
        if not (arm.is_update_due(now_ns) and inbox.unused) or state.interaction.over:
            return Transition(state, self._motions.keep_pace(now_ns))
        if prediction is None or current is None or prediction.label != label:
            return Transition(state)
        if self._inbox.decision.active != label or not arm.follows(now_ns):
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
