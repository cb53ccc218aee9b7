# SPDX-License-Identifier: Apache-2.0
"""Going to where the expected next task begins, before the human moves, and leaving again.

At most once after each interaction, and only while the human rests: when the most probable next
task is probable enough, the arm goes to the mean posture in which that task begins. The interaction
with whichever task is activated then starts from there.
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
    """When to go ahead."""

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
    """Which task to go ahead for, and when to give up; its label is empty when there is none."""

    def __init__(self, settings: PretriggerSettings, decision: DecisionSettings):
        self.settings, self.decision = settings, decision
        self.forget()

    def forget(self) -> None:
        """Back to the beginning."""
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
        """Take p(s) of the next movement, as it was known at a stamp."""
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
        """A task was activated: what comes after it may be gone ahead for, once."""
        self._allowed, self.label = True, ""

    def wanted(self, idle_since_ns: int) -> str:
        """Task to go ahead for now, or empty; expectations from before the human's rest are old."""
        expected, settings = self._expected, self.settings
        if settings.threshold <= 0.0 or not self._allowed or expected is None:
            return ""
        if expected.stamp_ns < idle_since_ns or expected.probability < settings.threshold:
            return ""
        return expected.label if expected.label in settings.starts else ""

    def start(self, label: str) -> Floats:
        """Where a task begins, (n,) [rad]."""
        return np.asarray(self.settings.starts[label], dtype=np.float64)

    def is_near(self, position: Floats, label: str) -> bool:
        """Whether a posture is as good as a task's start."""
        return bool(np.abs(position - self.start(label)).max() <= 0.02)  # [rad] in every joint

    def begin(self, label: str, arrival_ns: int) -> None:
        """The arm goes ahead for a task, and is there at a time."""
        self.label, self._arrival_ns = label, arrival_ns
        self._allowed = self._moved = False
        self._n_against, self._against = 0, ""

    def end(self) -> None:
        """The arm is not there any more."""
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
        """Why to give up now, or empty.

        The movement under way has been less probable than `release_below` for `n_observations`
        ("another_task", or "none" where that leads), has ended without an activation, or none came.
        """
        if self._n_against >= self.decision.n_observations:
            return self._against
        if decision.idle and self._moved:
            return "not_recognised"
        waited_ns = now_ns - self._arrival_ns
        return "timeout" if decision.idle and waited_ns > self.settings.timeout_s * 1e9 else ""
