# SPDX-License-Identifier: Apache-2.0
"""State of the cell: the newest of every topic, and a bounded past. No ROS, no page.

Times are seconds of a monotonic clock at arrival, so that silence is noticed whatever the clock
of the graph does.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from intent_recognition.composing import ViaPoint
from intent_recognition.model import ARRIVED, TO_UNDO

PLOTTED_S = 20.0
"""Past of the task posterior that is plotted [s]. Convention."""
PLOTTED_STEP_S = 0.05
"""Shortest time between two plotted posteriors [s]. Convention."""
WRIST_S = 3.0
"""Past of the wrist that is drawn [s]. Convention."""
MOST_JOINTS = 500
"""Joints of all messages together. Convention."""
SILENT_AFTER_S = 3.0
"""A node is silent after so long without a report [s]: three of its periods. Convention."""


@dataclass(frozen=True)
class Posterior:
    """The newest of `intent/tasks`: names (`none` last), probabilities and phases."""

    labels: tuple[str, ...]
    probabilities: NDArray[np.float64]
    phase: NDArray[np.float64]

    @property
    def best(self) -> str:
        """The most probable task."""
        return self.labels[int(np.argmax(self.probabilities))]


@dataclass(frozen=True)
class PredictedMotion:
    """PredictedMotion joint motion of the robot: task, joint names, positions (T, d) [rad]."""

    task: str
    joints: tuple[str, ...]
    positions: NDArray[np.float64]


@dataclass(frozen=True)
class PathMarkers:
    """The newest of `intent/markers`, as arrays.

    Attributes:
        observed: path so far (A, 3) [m].
        predicted: rest of the path (B, 3) [m].
        tube: corners of the +-2 sigma tube's triangles (C, 3) [m].
    """

    observed: NDArray[np.float64]
    predicted: NDArray[np.float64]
    tube: NDArray[np.float64]


ASKED_AFTER_S = 0.5
"""Time for which the same tasks must be in question before somebody is asked [s]. Convention: most
movements are recognised before."""


@dataclass(frozen=True)
class NodeHealth:
    """The newest report of one node: level 0 to 3, message, values, when; whether the last."""

    level: int
    message: str
    values: Mapping[str, str]
    at_s: float
    ended: bool = False

    def silent_s(self, now_s: float) -> float:
        """For how long it has been silent; zero while reports are due."""
        waited = now_s - self.at_s
        return waited if waited > SILENT_AFTER_S else 0.0


@dataclass(frozen=True)
class SkillRow:
    """A change of a task in words, and the numbers of its executions since, by name."""

    what: str
    values: Mapping[str, str]


@dataclass
class CellState:
    """The newest of everything received. One thread writes and reads.

    Attributes:
        joints: position by joint name [rad].
        wrist: newest wrist position (3,) [m], None before the first.
        posterior, predicted, drawn: newest, None before the first.
        active: task being executed.
        unfinished: task that was executed last, and what ended it before its end; empty if nothing
            did.
        truth: what the simulated coworker really does; None if it is not published.
        nodes: health by node name.
        teaching: last sentence of `teach/status`.
        skills: changes of each task, the oldest first.
        via_points: in force.
        plan: steps of the assembly, and whether each is `done`, `forgotten`, `may come` or `later`.
    """

    joints: dict[str, float] = field(default_factory=dict)
    wrist: NDArray[np.float64] | None = None
    wrist_at_s: float = -np.inf
    posterior: Posterior | None = None
    tasks_at_s: float = -np.inf
    predicted: PredictedMotion | None = None
    predicted_at_s: float = -np.inf
    drawn: PathMarkers | None = None
    drawn_at_s: float = -np.inf
    active: str = ""
    unfinished: tuple[str, str] | None = None
    truth: str | None = None
    description: str = ""
    teaching: str = ""
    skills: dict[str, list[SkillRow]] = field(default_factory=dict)
    via_points: tuple[ViaPoint, ...] = ()
    plan: dict[str, str] = field(default_factory=dict)
    nodes: dict[str, NodeHealth] = field(default_factory=dict)
    _question: tuple[str, ...] = ()
    _question_at_s: float = -np.inf
    _joints_at_s: dict[str, float] = field(default_factory=dict)
    _wrist_past: deque = field(default_factory=lambda: deque(maxlen=int(WRIST_S * 100)))
    _past: deque = field(default_factory=lambda: deque(maxlen=int(PLOTTED_S / PLOTTED_STEP_S)))

    @property
    def begun(self) -> str:
        """The task that the person does: the truth where it is published, else what is active."""
        return self.active if self.truth is None else self.truth

    @property
    def can_undo(self) -> bool:
        """Whether the teacher has a change to take back."""
        return any(TO_UNDO in row.values for rows in self.skills.values() for row in rows)

    def take_active(self, task: str) -> None:
        """The task being executed, empty for none."""
        self.active = task
        if task:
            self.unfinished = None

    def take_outcome(self, task: str, what: str) -> None:
        """What became of the execution of a task."""
        self.unfinished = None if what == ARRIVED else (task, what)

    def take_question(self, tasks: tuple[str, ...], now_s: float) -> None:
        """The tasks that are in question, none where nothing is."""
        self._question, self._question_at_s = tasks, now_s

    def question(self, now_s: float) -> tuple[str, ...]:
        """The tasks to ask about: those that have been in question for `ASKED_AFTER_S`."""
        return self._question if now_s - self._question_at_s >= ASKED_AFTER_S else ()

    def take_joints(self, names: Sequence[str], positions: Sequence[float], now_s: float) -> None:
        """A joint state, of all joints or some; names that keep changing are forgotten."""
        self.joints.update(zip(names, positions, strict=False))
        self._joints_at_s |= dict.fromkeys(names, now_s)
        while len(self.joints) > MOST_JOINTS:
            oldest = next(iter(self.joints))
            del self.joints[oldest], self._joints_at_s[oldest]

    def joints_at_s(self, names: Sequence[str]) -> float:
        """When all of these joints, which are known, were there last."""
        return min(self._joints_at_s[name] for name in names)

    def take_wrist(self, position: NDArray[np.float64], now_s: float) -> None:
        """A position of the wrist (3,) [m]."""
        self.wrist, self.wrist_at_s = position, now_s
        self._wrist_past.append((now_s, position))

    def take_posterior(self, posterior: Posterior, now_s: float) -> None:
        """A task posterior; the past keeps one every `PLOTTED_STEP_S`."""
        self.posterior, self.tasks_at_s = posterior, now_s
        if not self._past or now_s - self._past[-1][0] >= PLOTTED_STEP_S:
            self._past.append((now_s, posterior.labels, posterior.probabilities))

    def wrist_path(self, now_s: float) -> NDArray[np.float64]:
        """The wrist's path of the last seconds (T, 3)."""
        recent = [position for at, position in self._wrist_past if now_s - at <= WRIST_S]
        return np.array(recent).reshape(-1, 3)

    def posterior_past(
        self, now_s: float
    ) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
        """The last seconds: times (T,) [s], zero is now, and probabilities (T,) of each task.

        Tasks that were unknown at a time have NaN there.
        """
        past = [row for row in self._past if now_s - row[0] <= PLOTTED_S]
        times = np.array([at - now_s for at, _, _ in past])
        labels = self.posterior.labels if self.posterior is not None else ()
        columns = {
            label: np.array(
                [p[names.index(label)] if label in names else np.nan for _, names, p in past]
            )
            for label in labels
        }
        return times, columns

    def fresh(self, at_s: float, now_s: float, within_s: float = 1.0) -> bool:
        """Whether something of this time is recent."""
        return now_s - at_s <= within_s
