# SPDX-License-Identifier: Apache-2.0
"""What the arm is doing, as values: each state of the activation carries only what it needs."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from intent_recognition.motion import JointPath


class Mode(Enum):
    """The states by name, for people and diagnostics."""

    IDLE = "idle"
    EXECUTING = "executing"
    STOPPED = "stopped"
    HOMING = "homing"
    PRETRIGGERED = "pretriggered"


class PredictedInteraction(NamedTuple):
    """What the estimator predicts of an interaction.

    Attributes:
        label: its task.
        onset_ns: when it began.
        path: the arm's path.
        end_std: largest standard deviation at the end over the controlled DOFs of each unit,
            {"rad": ...}; None if unknown.
    """

    label: str
    onset_ns: int
    path: JointPath
    end_std: Mapping[str, float] | None

    @property
    def end_ns(self) -> int:
        """When it is expected to be over."""
        return self.onset_ns + round(self.path.duration_s * 1e9)


@dataclass(frozen=True, eq=False)
class ActiveInteraction:
    """The interaction the arm takes part in.

    Attributes:
        prediction: the newest one that was planned with.
        over: whether the human has finished.
    """

    prediction: PredictedInteraction
    over: bool = False


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


State = Idle | Executing | Arrived | Stopped | Homing | Pretriggered


def interaction_of(state: State) -> ActiveInteraction | None:
    """The interaction of a state, None where it has none."""
    return None if isinstance(state, (Idle, Pretriggered)) else state.interaction
