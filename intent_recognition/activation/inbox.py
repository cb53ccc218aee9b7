# SPDX-License-Identifier: Apache-2.0
"""Inbox for the estimator's messages: task probabilities, their decision, newest prediction."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import ActiveInteraction, PredictedInteraction
from intent_recognition.array_types import Floats
from intent_recognition.promp import NONE
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    decide,
    is_certain,
    possible_tasks,
    uncertain_end,
)

LARGEST_SKEW_NS = 1_000_000_000
"""Largest time by which a stamp may be ahead of the clock, or that of a joint state behind it [ns];
the clocks of one graph differ by less."""
RESTAMP = "Play recordings with --restamp, or with --clock to nodes with use_sim_time"
"""Cure named in messages about stamps that are long past."""


class TaskEstimate(NamedTuple):
    """One message of task probabilities."""

    labels: Sequence[str]
    probabilities: Floats
    log_evidence: Floats | None

    def repeats(self, other: "TaskEstimate | None") -> bool:
        """Whether it equals another estimate."""
        return other is not None and (
            list(self.labels) == list(other.labels)
            and np.array_equal(self.probabilities, other.probabilities)
            and np.array_equal(self.log_evidence, other.log_evidence)  # type: ignore[arg-type]
        )


def _question(
    settings: DecisionSettings, state: DecisionState, labels: Sequence[str], probabilities: Floats
) -> dict[str, float]:
    chances = dict(zip(labels, np.asarray(probabilities).tolist(), strict=True))
    if state.idle or state.active or chances[NONE] >= 0.5:
        return {}
    possible = possible_tasks(settings, labels, probabilities, state.last)
    return {label: chances[label] for label in possible} if len(possible) > 1 else {}


class EstimatorInbox:
    """Checks stamps, decides on a task, and keeps the newest prediction.

    Attributes:
        question: possible tasks of the movement under way and their probabilities, while no task
            is active; empty if fewer than two are possible or `none` has at least 0.5.
        held_back: why a recognised task is not executed (its end is uncertain), or empty.
        prediction: the newest prediction; None while the human rests.
        unused: whether no plan has used the newest prediction yet.
        refused: whether the last attempt to begin an interaction failed.
        ordered: prediction to begin without recognition once no task is active; None for none.
        idle_since_ns: stamp of the first observation of the human at rest again.
    """

    def __init__(self, common: Common):
        self._common, self._reject = common, common.reject
        self.forget()

    def forget(self) -> None:
        """Return to the initial state."""
        self.forget_interaction()
        self.unused = False
        self.idle_since_ns = 0
        self._stamp_ns: int | None = None
        self._estimate: TaskEstimate | None = None
        self._received_ns = 0

    def forget_interaction(self) -> None:
        """Forget decision and predictions, but not the stamp of the last observation."""
        self.decision, self.held_back = DecisionState(), ""
        self.question: dict[str, float] = {}
        self.prediction: PredictedInteraction | None = None
        self._of_active: PredictedInteraction | None = None  # the newest before `prediction`
        self.ordered: PredictedInteraction | None = None
        self.refused = False
        self._served_ns: int | None = None

    def silent(self, now_ns: int) -> bool:
        """Whether no observation has come for too long."""
        return now_ns - self._received_ns > self._common.settings.timeout_s * 1e9

    def is_ahead(self, now_ns: int, stamp_ns: int, topic: str) -> bool:
        """Whether the stamp of a message is too far in the future; if so, rejects the message."""
        ahead_ns = stamp_ns - now_ns
        if ahead_ns > LARGEST_SKEW_NS:
            self._reject("stamp_in_future", f"{topic} {ahead_ns * 1e-9:.1f} s ahead")
        return ahead_ns > LARGEST_SKEW_NS

    def mark_served(self, interaction: ActiveInteraction | None) -> None:
        """Until the human rests, start no movement that began before this interaction's end.

        None and an ordered interaction, which served no movement, lift that restriction.
        """
        if interaction is None or interaction.ordered:
            self._served_ns = None
        else:
            self._served_ns = interaction.prediction.end_ns

    def startable(self, now_ns: int) -> PredictedInteraction | None:
        """The ordered prediction while no task is active, else a new one not yet served."""
        if self.ordered is not None and not self.decision.active:
            return None if self.silent(now_ns) else self.ordered._replace(onset_ns=now_ns)
        return self.needed() if self.unused and not self.silent(now_ns) else None

    def needed(self) -> PredictedInteraction | None:
        """The prediction of the active task, if its movement is not yet served."""
        return self._unserved(self.prediction)

    def wanted(self) -> PredictedInteraction | None:
        """As `needed`, even if another task was more probable last but did not become active."""
        return self.needed() or self._unserved(self._of_active)

    def _unserved(self, prediction: PredictedInteraction | None) -> PredictedInteraction | None:
        active = self.decision.active
        if prediction is None or not active or prediction.label != active:
            return None
        served = self._served_ns is not None and prediction.onset_ns < self._served_ns
        return None if served else prediction

    @property
    def certainty(self) -> float:
        """The largest probability of the last observation."""
        return 0.0 if self._estimate is None else float(np.max(self._estimate.probabilities))

    def take_tasks(self, now_ns: int, stamp_ns: int, estimate: TaskEstimate) -> bool:
        """Take the probabilities of one observation; False if their stamp is rejected.

        Several bodies measured at one time give several estimates with one stamp, which differ
        during a movement and agree at rest. A repeated estimate during a movement means that the
        sender is stuck. Only a later stamp ends a silence.
        """
        if stamp_ns <= 0:
            self._reject("zero_stamp", "intent/tasks without a stamp")
        elif self.is_ahead(now_ns, stamp_ns, "intent/tasks"):
            pass
        elif self._stamp_ns is not None and stamp_ns < self._stamp_ns:
            self._reject("stamp_not_increasing", f"intent/tasks at {stamp_ns} ns came late")
        elif stamp_ns == self._stamp_ns and estimate.repeats(self._estimate):
            if not self.decision.idle:
                self._reject("stamp_not_increasing", f"intent/tasks at {stamp_ns} ns came twice")
        else:
            self._decide(now_ns, stamp_ns, estimate)
            return True
        return False

    def _decide(self, now_ns: int, stamp_ns: int, estimate: TaskEstimate) -> None:
        labels, probabilities, log_evidence = estimate
        end_std = None
        if self.prediction is not None and 0 < len(labels) == len(probabilities):
            best = labels[int(np.argmax(probabilities))]
            end_std = self.prediction.end_std if best == self.prediction.label else None
        settings = self._common.settings.decision
        state, _ = decide(settings, self.decision, labels, probabilities, end_std, log_evidence)
        if state.idle and not self.decision.idle:
            self.idle_since_ns = stamp_ns
        if stamp_ns != self._stamp_ns:
            self._received_ns = now_ns
        self._stamp_ns, self._estimate = stamp_ns, estimate
        self.decision = state
        self.question = _question(settings, state, labels, probabilities)
        self._note_held_back(uncertain_end(settings, state, end_std))
        if state.idle:
            self.prediction = self._of_active = self._served_ns = None
            self.refused = self.refused and self.ordered is not None

    def _note_held_back(self, reason: str) -> None:
        """Keep why a task is not executed, and report it if the movement ends without execution."""
        if reason:
            self.held_back = reason
        elif self.decision.active:
            self.held_back = ""
        elif self.decision.idle and self.held_back:
            self._reject("uncertain_end", self.held_back)
            self.held_back = ""

    def order(self, prediction: PredictedInteraction | None) -> None:
        """Order a task to begin without recognition once no task is active; None cancels the order.

        Its onset is the moment at which it begins, and a recognised task ends it like any other. A
        prediction whose end is too uncertain is rejected.
        """
        if prediction is not None:
            label, end_std = prediction.label, prediction.end_std
            if not is_certain(self._common.settings.decision, end_std, label):
                self._reject("uncertain_end", f"{label} does not begin unrecognised: {end_std}")
                prediction = None
        self.ordered = prediction

    def take_prediction(self, now_ns: int, prediction: PredictedInteraction) -> None:
        """Take the newest prediction, unless its stamp is rejected."""
        if prediction.onset_ns <= 0:
            self._reject("zero_stamp", "intent/robot_trajectory without a stamp")
        elif self.is_ahead(now_ns, prediction.onset_ns, "intent/robot_trajectory"):
            pass
        elif now_ns - prediction.end_ns > self._common.settings.max_lateness_s * 1e9:
            late_s = (now_ns - prediction.end_ns) * 1e-9
            text = f"intent/robot_trajectory was over {late_s:.1f} s ago. {RESTAMP}"
            self._reject("outdated", text)
        else:
            self._of_active = self.needed() or self._of_active
            self.prediction = prediction
            self.unused = True
