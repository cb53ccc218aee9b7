# SPDX-License-Identifier: Apache-2.0
"""What the estimator has told the activation: probabilities, decided upon, and predictions."""

from collections.abc import Callable, Sequence

import numpy as np

from intent_recognition.activation.settings import ActivationSettings, Prediction
from intent_recognition.recognition import DecisionState, decide, uncertain_end

_LARGEST_AHEAD_NS = 1_000_000_000


class EstimatorInbox:
    """Takes what comes in time, decides, and keeps the newest prediction.

    Args:
        settings: how to act.
        reject: called with (reason, text) for everything not acted on.

    Attributes:
        decision: the state of the decision.
        held_back: why a recognised task is not executed (its end is uncertain), or empty.
        prediction: the newest, None at rest.
        unused: whether it has not been planned with yet.
        idle_since_ns: stamp of the first observation that found the human at rest again.
    """

    def __init__(self, settings: ActivationSettings, reject: Callable[[str, str], None]):
        self.settings, self._reject = settings, reject
        self.forget()

    def forget(self) -> None:
        """Back to the beginning."""
        self.forget_interaction()
        self.unused = False
        self.idle_since_ns = 0
        self._stamp_ns: int | None = None
        self._said: tuple = ()
        self._heard_ns = 0

    def forget_interaction(self) -> None:
        """Nothing is recognised or predicted; what was heard is not heard again."""
        self.decision, self.held_back = DecisionState(), ""
        self.prediction: Prediction | None = None

    def silent(self, now_ns: int) -> bool:
        """Whether no observation has come for too long."""
        return now_ns - self._heard_ns > self.settings.timeout_s * 1e9

    def take_tasks(
        self,
        now_ns: int,
        stamp_ns: int,
        labels: Sequence[str],
        probabilities: np.ndarray,
        log_evidence: np.ndarray | None = None,
    ) -> bool:
        """Take the probabilities of one observation; False where they are out of time.

        Several bodies measured at one time give several estimates with one stamp: each differs
        from the one before, but at rest, where they say the same and nothing. The same once more
        during a movement is a sender that is stuck. Only a later stamp ends a silence.

        Raises:
            IntentError: they are no probabilities; nothing has changed.
        """
        if stamp_ns <= 0:
            self._reject("zero_stamp", "intent/tasks without a stamp")
        elif stamp_ns > now_ns + _LARGEST_AHEAD_NS:
            ahead_s = (stamp_ns - now_ns) * 1e-9
            self._reject("stamp_in_future", f"intent/tasks {ahead_s:.1f} s ahead")
        elif self._stamp_ns is not None and stamp_ns < self._stamp_ns:
            self._reject("stamp_not_increasing", f"intent/tasks at {stamp_ns} ns came late")
        elif stamp_ns == self._stamp_ns and self._repeats(labels, probabilities, log_evidence):
            if not self.decision.idle:
                self._reject("stamp_not_increasing", f"intent/tasks at {stamp_ns} ns came twice")
        else:
            self._decide(now_ns, stamp_ns, labels, probabilities, log_evidence)
            return True
        return False

    def _repeats(self, *said: Sequence | np.ndarray | None) -> bool:
        """Whether labels, probabilities and evidence are those taken last."""
        return all(np.array_equal(a, b) for a, b in zip(said, self._said, strict=True))

    def _decide(self, now_ns, stamp_ns, labels, probabilities, log_evidence) -> None:
        end_std = None
        if self.prediction is not None and 0 < len(labels) == len(probabilities):
            best = labels[int(np.argmax(probabilities))]
            end_std = self.prediction.end_std if best == self.prediction.label else None
        settings = self.settings.decision
        state, _ = decide(settings, self.decision, labels, probabilities, end_std, log_evidence)
        if state.idle and not self.decision.idle:
            self.idle_since_ns = stamp_ns
        if stamp_ns != self._stamp_ns:
            self._heard_ns = now_ns
        self._stamp_ns, self._said = stamp_ns, (labels, probabilities, log_evidence)
        self.decision = state
        self._note_held_back(uncertain_end(settings, state, end_std))
        if state.idle:
            self.prediction = None

    def _note_held_back(self, reason: str) -> None:
        """Keep why nothing is executed; rejected once, if the movement ends without."""
        if reason:
            self.held_back = reason
        elif self.decision.active:
            self.held_back = ""
        elif self.decision.idle and self.held_back:
            self._reject("uncertain_end", self.held_back)
            self.held_back = ""

    def take_prediction(self, now_ns: int, prediction: Prediction) -> None:
        """Take the newest prediction, unless it is of another time."""
        if prediction.onset_ns <= 0:
            self._reject("zero_stamp", "intent/robot_trajectory without a stamp")
        elif prediction.onset_ns > now_ns + _LARGEST_AHEAD_NS:
            ahead_s = (prediction.onset_ns - now_ns) * 1e-9
            self._reject("stamp_in_future", f"intent/robot_trajectory {ahead_s:.1f} s ahead")
        elif now_ns - prediction.end_ns > self.settings.max_lateness_s * 1e9:
            late_s = (now_ns - prediction.end_ns) * 1e-9
            self._reject("outdated", f"intent/robot_trajectory was over {late_s:.1f} s ago")
        else:
            self.prediction = prediction
            self.unused = True
