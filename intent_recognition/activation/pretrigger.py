# SPDX-License-Identifier: Apache-2.0
"""Going ahead to where the expected next task begins, before the human moves, and withdrawing.

At most once after each interaction, and only while the human rests: when the most probable next
task is probable enough, the arm goes to the mean posture in which that task begins. Whichever task
is activated next, its interaction starts from there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.promp import NONE
from intent_recognition.recognition import DecisionSettings, DecisionState


@dataclass(frozen=True, eq=False)
class PretriggerSettings:
    """When to go ahead, where to, and how long to wait there."""

    threshold: float = 0.0  # probability the next task must have, in (0, 1]; 0 never goes ahead
    timeout_s: float = 10.0  # how long to wait there for the human
    # where each task begins, label to (n,) [rad]
    starts: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 <= self.threshold <= 1.0:
            cure = "0 switches it off."
            raise ArgumentError.about("threshold", "in [0, 1]", self.threshold, cure)


class _Expected(NamedTuple):
    stamp_ns: int
    label: str
    probability: float


class Pretrigger:
    """Decides for which task to go ahead, and when to withdraw; without a task `label` is empty."""

    def __init__(self, settings: PretriggerSettings, decision: DecisionSettings):
        self.settings, self.decision = settings, decision
        self.forget()

    def forget(self) -> None:
        """Return to the initial state."""
        self.label = self._against = ""
        self._expected: _Expected | None = None
        self._allowed = self._moved = False
        self._arrival_ns = self._n_against = 0

    @property
    def expected(self) -> str:
        """The most probable next task with its probability, for people; empty if unknown."""
        if self._expected is None:
            return ""
        return f"{self._expected.label} ({self._expected.probability:.2f})"

    def take_expectation(self, stamp_ns: int, labels: Sequence[str], probabilities: Floats) -> None:
        """Take the probability of each task to be the next one, as estimated at a stamp."""
        p = np.asarray(probabilities, dtype=np.float64)
        if p.shape != (len(labels),) or not len(labels):
            cure = "Give one probability per task."
            raise ShapeError.about("next task", f"shape ({len(labels)},)", p.shape, cure)
        if not np.all((p >= -1e-9) & (p <= 1.0 + 1e-9)) or abs(float(p.sum()) - 1.0) > 1e-6:
            cure = "Check the sender."
            raise ArgumentError.about("next task", "numbers in [0, 1] of sum 1", p, cure)
        best = int(np.argmax(p))
        self._expected = _Expected(stamp_ns, labels[best], float(p[best]))

    def interaction_began(self) -> None:
        """Note that a task was activated: the arm may go ahead once for the task after it."""
        self._allowed, self.label = True, ""

    def wanted(self, idle_since_ns: int) -> str:
        """The task to go ahead for, or empty; ignores expectations from before the human's rest."""
        expected, settings = self._expected, self.settings
        if settings.threshold <= 0.0 or not self._allowed or expected is None:
            return ""
        if expected.stamp_ns < idle_since_ns or expected.probability < settings.threshold:
            return ""
        return expected.label if expected.label in settings.starts else ""

    def start(self, label: str) -> Floats:
        """Posture in which a task begins, (n,) [rad]."""
        return np.asarray(self.settings.starts[label], dtype=np.float64)

    def is_near(self, position: Floats, label: str) -> bool:
        """Whether a posture is practically the start of a task."""
        return bool(np.abs(position - self.start(label)).max() <= 0.02)  # [rad] in every joint

    def begin(self, label: str, arrival_ns: int) -> None:
        """Note that the arm goes ahead for a task, and when it arrives."""
        self.label, self._arrival_ns = label, arrival_ns
        self._allowed = self._moved = False
        self._n_against, self._against = 0, ""

    def end(self) -> None:
        """Note that the arm leaves the start of the task."""
        self.label = ""

    def observe(
        self, decision: DecisionState, labels: Sequence[str], probabilities: Floats
    ) -> None:
        """Take one observation of the movement under way into account."""
        if not self.label or decision.idle:
            return
        self._moved = True
        own = labels.index(self.label) if self.label in labels else -1
        against = own < 0 or probabilities[own] < self.decision.release_below
        self._n_against = self._n_against + 1 if against else 0
        leads_none = labels[int(np.argmax(probabilities))] == NONE
        self._against = "none" if leads_none else "another_task"

    def reason_to_withdraw(self, now_ns: int, decision: DecisionState) -> str:
        """Why to withdraw now, or empty.

        The expected task has been less probable than `release_below` for `n_observations`
        ("another_task", or "none" if that leads), the movement has ended without an activation
        ("not_recognised"), or no movement came in time ("timeout").
        """
        if self._n_against >= self.decision.n_observations:
            return self._against
        if decision.idle and self._moved:
            return "not_recognised"
        waited_ns = now_ns - self._arrival_ns
        return "timeout" if decision.idle and waited_ns > self.settings.timeout_s * 1e9 else ""
