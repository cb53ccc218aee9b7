# SPDX-License-Identifier: Apache-2.0
"""What the arm follows, as values: the path of a task, and a motion that can be planned again."""

from typing import NamedTuple

from intent_recognition.activation.states import Command
from intent_recognition.motion import ClearPath, JointPath, JointPlan


class TaskPath(NamedTuple):
    """The path of a task that the arm follows."""

    label: str
    clear: ClearPath


class PlannedWay(NamedTuple):
    """A motion along a path, which can be planned again at another speed.

    Attributes:
        kind: of its plan as it is sent.
        plan: with the phases on the path.
        path: that it keeps to at any speed; None where it has but one.
        onset_ns: when the motion is to begin; None: as soon as it may.
        slowed: whether it is slower than it would be without people.
        command: that was sent: the plan, or a brake along the path.
        blocked: whether it brakes because of things.
    """

    kind: str
    plan: JointPlan
    path: JointPath | None = None
    onset_ns: int | None = None
    slowed: bool = False
    command: Command | None = None
    blocked: bool = False
