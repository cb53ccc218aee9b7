# SPDX-License-Identifier: Apache-2.0
"""State of the cell: the newest message of every topic and a bounded history. No ROS, no page.

Times are arrival times on a monotonic clock [s], so that silence is noticed even when the clock of
the graph stops or jumps.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.composing import ViaPoint
from intent_recognition.model import ARRIVED, WAITING
from intent_recognition.plans import WorkPlan

PLOTTED_S, PLOTTED_STEP_S = 20.0, 0.05
"""Length of the plotted history and shortest time between two of its values [s]: 400 points per
curve."""
WRIST_S = 3.0
"""Length of the wrist's path that is drawn [s]: about one reach."""
FORCES, SENSOR = ("load", "weight", "grip_force"), "sensor"
"""Forces on `intent/transfer`, and the name of the magnitude of `wrench` [N]."""
SHARE, SLIP = "load_share", "slip"
"""Other values of `intent/transfer` that are shown."""
ASKED = "asked for help"
"""Key in the diagnostics of `primitive_activation`: who asked when it chose whom to help."""
FRESH_S, STALE_S = 1.0, 1.5
"""Ages beyond which a value is drawn as old and a prediction is hidden [s]."""


@dataclass(frozen=True)
class Posterior:
    """The newest of `intent/tasks`: names (`none` last), probabilities and phases."""

    labels: tuple[str, ...]
    probabilities: Floats
    phase: Floats

    @property
    def best(self) -> str:
        """The most probable task."""
        return self.labels[int(np.argmax(self.probabilities))]


@dataclass(frozen=True)
class PredictedMotion:
    """Predicted joint motion of the robot: task, joint names, positions (T, d) [rad]."""

    task: str
    joints: tuple[str, ...]
    positions: Floats


@dataclass(frozen=True)
class PathMarkers:
    """The newest of `intent/markers`, as arrays."""

    predicted: Floats  # rest of the path (B, 3) [m]
    tube: Floats  # corners of the +-2 sigma tube's triangles (C, 3) [m]


@dataclass(frozen=True)
class NodeHealth:
    """The newest report of one node: level 0 to 3, message, values, arrival time, whether ended."""

    level: int
    message: str
    values: Mapping[str, str]
    at_s: float
    ended: bool = False

    def silent_s(self, now_s: float) -> float:
        """How long the node has been silent [s]; zero until a report is overdue."""
        waited = now_s - self.at_s
        return waited if waited > 3.0 else 0.0  # three periods of the reports


@dataclass(frozen=True)
class SkillRow:
    """One change of a task in words, and statistics of the executions since then, by name."""

    what: str
    values: Mapping[str, str]


class Past:
    """History of named numbers over the last seconds; older values are dropped."""

    def __init__(self) -> None:
        self._rows: deque = deque(maxlen=int(PLOTTED_S / PLOTTED_STEP_S))

    def __len__(self) -> int:
        return len(self._rows)

    def take(self, names: Sequence[str], values: ArrayLike, now_s: float) -> None:
        """Store values, unless others were stored less than `PLOTTED_STEP_S` ago."""
        silent_s = now_s - self._rows[-1][0] if self._rows else PLOTTED_STEP_S
        if silent_s > FRESH_S:
            self._rows.append((now_s, {}))  # no curve over a time in which nothing was received
        if silent_s >= PLOTTED_STEP_S:
            self._rows.append((now_s, dict(zip(names, np.asarray(values), strict=True))))

    def columns(self, names: Sequence[str], now_s: float) -> tuple[Floats, ...]:
        """Times (T,) [s] before now, and the values (T,) of each name, NaN where there is none."""
        rows = [row for row in self._rows if now_s - row[0] <= PLOTTED_S]
        times = np.array([at_s - now_s for at_s, _ in rows])
        return times, *(np.array([row.get(name, np.nan) for _, row in rows]) for name in names)


class PersonState:
    """What was last measured and estimated of one person.

    Attributes:
        wrist: newest position (3,) [m], None before the first.
        posterior, predicted, drawn: newest message of each, None before the first.
        past: history of the task probabilities.
    """

    def __init__(self) -> None:
        self.wrist: Floats | None = None
        self.posterior: Posterior | None = None
        self.predicted: PredictedMotion | None = None
        self.drawn: PathMarkers | None = None
        self.wrist_at_s = self.tasks_at_s = self.predicted_at_s = self.drawn_at_s = -np.inf
        self.past = Past()
        self._wrist_past: deque = deque(maxlen=int(WRIST_S * 100))

    def take_wrist(self, position: Floats, now_s: float) -> None:
        """Store a position of the wrist (3,) [m]."""
        self.wrist, self.wrist_at_s = position, now_s
        self._wrist_past.append((now_s, position))

    def take_posterior(self, posterior: Posterior, now_s: float) -> None:
        """Store a task posterior."""
        self.posterior, self.tasks_at_s = posterior, now_s
        self.past.take(posterior.labels, posterior.probabilities, now_s)

    def wrist_path(self, now_s: float) -> Floats:
        """Path of the wrist over the last seconds (T, 3) [m]."""
        recent = [position for at, position in self._wrist_past if now_s - at <= WRIST_S]
        return np.array(recent).reshape(-1, 3)


class TransferState:
    """The newest of `intent/transfer` and `wrench`, and the history of the forces.

    Attributes:
        holding: state of the handover, such as `offering`; empty before the first message.
        felt: values of `intent/transfer` by name.
        forces: history of the forces `FORCES` and `SENSOR` [N].
    """

    def __init__(self) -> None:
        self.holding, self.felt = "", dict[str, float]()
        self.at_s = self.sensed_at_s = -np.inf
        self.forces = Past()
        self._sensor_n = np.nan

    def take(self, holding: str, felt: Mapping[str, float], now_s: float) -> None:
        """Store the content of `intent/transfer`."""
        self.holding, self.felt, self.at_s = holding, dict(felt), now_s
        sensed = self._sensor_n if now_s - self.sensed_at_s <= FRESH_S else np.nan
        self.forces.take((*FORCES, SENSOR), [*(felt[name] for name in FORCES), sensed], now_s)

    def take_sensor(self, force_n: float, now_s: float) -> None:
        """Store the magnitude of the force on `wrench` [N]."""
        self._sensor_n, self.sensed_at_s = force_n, now_s
        if now_s - self.at_s > FRESH_S:
            self.forces.take((SENSOR,), (force_n,), now_s)

    def names(self, now_s: float) -> tuple[str, ...]:
        """Names of the forces received within the plotted time."""
        felt = FORCES if now_s - self.at_s <= PLOTTED_S else ()
        return (*felt, SENSOR) if now_s - self.sensed_at_s <= PLOTTED_S else felt

    def newest(self, name: str) -> float | None:
        """Newest value of a force [N]; None if there is no recent one."""
        value = self._sensor_n if name == SENSOR else self.felt.get(name, np.nan)
        return None if np.isnan(value) else value


@dataclass
class CellState:
    """The newest of everything received. One thread reads and writes it."""

    joints: dict[str, float] = field(default_factory=dict)  # position by joint name [rad]
    # state of each person by name; the only person has an empty name
    people: dict[str, PersonState] = field(default_factory=lambda: {"": PersonState()})
    helped: str = ""  # name of the person whom the arm helps; empty for nobody
    active: str = ""  # task being executed
    unfinished: tuple[str, str] | None = None  # last task, if cut short, and the reason
    truth: str | None = None  # what the simulated coworker does; None if not published
    description: str = ""
    teaching: str = ""  # newest text of `teach/status`
    skills: dict[str, list[SkillRow]] = field(default_factory=dict)  # by task, oldest first
    via_points: tuple[ViaPoint, ...] = ()
    plan: WorkPlan | None = None  # work plan of the assembly; None without one
    # state of each step: `done`, `forgotten`, `may come` or `later`
    progress: dict[str, str] = field(default_factory=dict)
    transfer: TransferState = field(default_factory=TransferState)
    nodes: dict[str, NodeHealth] = field(default_factory=dict)  # health by node name
    _question: tuple[str, ...] = ()
    _question_at_s: float = -np.inf
    _joints_at_s: dict[str, float] = field(default_factory=dict)

    @property
    def person(self) -> PersonState:
        """The person whom the arm helps, or else the first one."""
        return self.people.get(self.helped) or next(iter(self.people.values()))

    def pose_topics(self, body: str) -> list[str]:
        """Pose topics of a tracked body: without a person's name, and with the first person's."""
        first = sorted(name for name in self.people if name)[:1]
        return [f"mocap/{body}/pose", *(f"mocap/{name}/{body}/pose" for name in first)]

    @property
    def believes(self) -> bool:
        """Whether there is a task posterior for any person."""
        return any(person.posterior is not None for person in self.people.values())

    @property
    def asked(self) -> str:
        """Who asked for help when the arm chose whom to help; empty if nothing reports it."""
        return next((n.values[ASKED] for n in self.nodes.values() if ASKED in n.values), "")

    @property
    def begun(self) -> str:
        """The task that the person is doing: the true one if published, else the active one."""
        return self.active if self.truth is None else self.truth

    @property
    def waiting(self) -> int:
        """How many recordings the teacher has not learned yet."""
        counts = [health.values.get(WAITING, "") for health in self.nodes.values()]
        return sum(int(n) for n in counts if n.isdecimal())

    def any_skill(self, key: str) -> bool:
        """Whether any change has a value of this name, such as `TO_UNDO`."""
        return any(key in row.values for rows in self.skills.values() for row in rows)

    def take_active(self, task: str) -> None:
        """Store the task being executed; empty for none."""
        self.active = task
        if task:
            self.unfinished = None

    def take_outcome(self, task: str, what: str) -> None:
        """Store the outcome of a task's execution."""
        self.unfinished = None if what == ARRIVED else (task, what)

    def take_question(self, tasks: tuple[str, ...], now_s: float) -> None:
        """Store the tasks among which the recogniser is undecided; empty if it is decided."""
        self._question, self._question_at_s = tasks, now_s

    def question(self, now_s: float) -> tuple[str, ...]:
        """Tasks to ask the person about, once undecided for 0.5 s: most doubts resolve sooner."""
        return self._question if now_s - self._question_at_s >= 0.5 else ()

    def take_joints(self, names: Sequence[str], positions: Sequence[float], now_s: float) -> None:
        """Store a joint state of all or some joints; names that keep changing are dropped."""
        self.joints.update(zip(names, positions, strict=False))
        self._joints_at_s |= dict.fromkeys(names, now_s)
        while len(self.joints) > 500:
            oldest = next(iter(self.joints))
            del self.joints[oldest], self._joints_at_s[oldest]

    def joints_at_s(self, names: Sequence[str]) -> float:
        """Time at which all of these known joints were last received [s]."""
        return min(self._joints_at_s[name] for name in names)

    def fresh(self, at_s: float, now_s: float, within_s: float = FRESH_S) -> bool:
        """Whether a time of arrival is at most `within_s` ago."""
        return now_s - at_s <= within_s
