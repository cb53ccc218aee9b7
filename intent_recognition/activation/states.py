# SPDX-License-Identifier: Apache-2.0
"""Commands and states of the activation, as values; each state carries only what it needs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.motion import (
    JointPath,
    JointPlan,
    JointReference,
    PhaseState,
    PredictedPerson,
    Via,
)


class Mode(Enum):
    """The states by name, for people and diagnostics."""

    IDLE = "idle"
    EXECUTING = "executing"
    STOPPED = "stopped"
    HOMING = "homing"
    PRETRIGGERED = "pretriggered"
    YIELDING = "yielding"


class MotionPoints(NamedTuple):
    """Points of a motion: whole nanoseconds (T,), positions and velocities (T, n) [rad, rad/s]."""

    times_ns: Integers
    positions: Floats
    velocities: Floats


class PlannedWay(NamedTuple):
    """A motion along a path, which can be planned again at another speed."""

    kind: str  # kind of the plan that is sent
    plan: JointPlan  # its phases are those of the path
    path: JointPath  # the same at any speed
    onset_ns: int | None = None  # when the motion is to begin; None: as soon as it may
    slowed: bool = False  # whether it is slower than it would be without people
    blocked: bool = False  # whether it brakes because of things
    people: tuple[PredictedPerson, ...] = ()  # people that it was planned for


class Command(NamedTuple):
    """A plan that takes over at start_ns.

    `before` is the motion from the sending to the start; None for an arm at rest or a near start.
    `way` is what the plan follows at a pace that may change; None if it does not go on by itself.
    """

    start_ns: int
    plan: JointPlan
    before: MotionPoints | None = None
    way: PlannedWay | None = None

    def to_send(self) -> MotionPoints:
        """The points of a message; those before the start come first.

        A controller that replaces its trajectory at once follows those until the start, and one
        that has lost the last commands returns to them.
        """
        plan = self.plan
        times_ns = self.start_ns + np.rint(plan.times_s * 1e9).astype(np.int64)
        own = MotionPoints(times_ns, plan.positions, plan.velocities)
        if self.before is None:
            return own
        return MotionPoints(*(np.concatenate(pair) for pair in zip(self.before, own, strict=True)))

    @property
    def end_ns(self) -> int:
        """When the plan comes to rest."""
        return self.start_ns + round(self.plan.duration_s * 1e9)

    def at(self, time_ns: int) -> JointReference:
        """The reference at a time."""
        return self.plan.at((time_ns - self.start_ns) * 1e-9)

    def phase_at(self, time_ns: int) -> PhaseState:
        """Phase of the interaction at a time."""
        return self.plan.phase_at((time_ns - self.start_ns) * 1e-9)


class PredictedInteraction(NamedTuple):
    """An interaction as the estimator predicts it.

    Attributes:
        end_std: largest standard deviation at the end over the controlled DOFs of each unit,
            {"rad": ...}; None if unknown.
    """

    label: str
    onset_ns: int
    path: JointPath
    end_std: Mapping[str, float] | None

    @property
    def end_ns(self) -> int:
        """When the interaction is expected to end."""
        return self.onset_ns + round(self.path.duration_s * 1e9)


@dataclass(frozen=True, eq=False)
class ActiveInteraction:
    """The interaction the arm takes part in."""

    prediction: PredictedInteraction  # the newest one for which a plan was made
    began_ns: int  # when the arm began to take part; identifies the interaction
    over: bool = False  # whether the human has finished
    vias: tuple[Via, ...] = ()  # where the arm was left when somebody moved it
    ordered: bool = False  # whether it was begun without being recognised (`Activation.order`)

    def recognised(self, prediction: PredictedInteraction) -> "ActiveInteraction":
        """The interaction with a prediction of its task, now active; it is no longer ordered.

        It then stops if the person breaks off, and its movement does not start another one.
        """
        return replace(self, prediction=prediction, ordered=False)


@dataclass(frozen=True, eq=False)
class Idle:
    """At rest, without a task."""

    mode = Mode.IDLE


@dataclass(frozen=True, eq=False)
class Executing:
    """On the way along a predicted path."""

    interaction: ActiveInteraction
    mode = Mode.EXECUTING


@dataclass(frozen=True, eq=False)
class Arrived:
    """At the end of the predicted path since `since_ns`, still following new predictions."""

    interaction: ActiveInteraction
    since_ns: int
    mode = Mode.EXECUTING


@dataclass(frozen=True, eq=False)
class Stopped:
    """Stopped on the way, at rest from `rest_ns` on; without an interaction if pretriggered."""

    interaction: ActiveInteraction | None
    reason: str
    rest_ns: int
    mode = Mode.STOPPED


@dataclass(frozen=True, eq=False)
class Homing:
    """On the way home, after an interaction or (None) after having gone ahead in vain."""

    interaction: ActiveInteraction | None
    mode = Mode.HOMING


@dataclass(frozen=True, eq=False)
class Pretriggered:
    """At, or on the way to, the start of the expected task; `Pretrigger` knows which."""

    mode = Mode.PRETRIGGERED


@dataclass(frozen=True, eq=False)
class Yielding:
    """Moved by a person since `since_ns`; `phase` is how much of the interaction was done then."""

    interaction: ActiveInteraction
    since_ns: int
    phase: float
    mode = Mode.YIELDING


State = Idle | Executing | Arrived | Stopped | Homing | Pretriggered | Yielding


UNDER_WAY = (Executing, Arrived, Stopped, Yielding)
"""States in which the arm has not finished its interaction."""


class Transition(NamedTuple):
    """The next state, and the command to send on the way there."""

    state: State
    command: Command | None = None


class Outcome(NamedTuple):
    """How an interaction ended."""

    label: str
    what: str  # "arrived", "broken off" or "stopped: REASON"
    n_corrections: int  # places to which a person moved the arm


def outcome_of(before: State, after: State) -> Outcome | None:
    """The outcome of the interaction that ends between two states; None where none does."""
    if not isinstance(before, UNDER_WAY):
        return None
    interaction = before.interaction
    follows = interaction_of(after) if isinstance(after, UNDER_WAY) else None
    if interaction is None or (follows is not None and follows.began_ns == interaction.began_ns):
        return None
    what = "arrived" if isinstance(before, Arrived) else "broken off"
    if isinstance(before, Stopped):
        what = f"stopped: {before.reason}"
    return Outcome(interaction.prediction.label, what, len(interaction.vias))


def interaction_of(state: State) -> ActiveInteraction | None:
    """The interaction of a state; None if it has none."""
    return None if isinstance(state, (Idle, Pretriggered)) else state.interaction
