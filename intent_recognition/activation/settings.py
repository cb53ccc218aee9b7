# SPDX-License-Identifier: Apache-2.0
"""What goes into and comes out of the activation's state machine."""

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import JointPath, JointPlan, PlanSettings, Reference
from intent_recognition.recognition import DecisionSettings


class Mode(Enum):
    """What the arm is being told to do."""

    IDLE = "idle"
    EXECUTING = "executing"
    STOPPED = "stopped"
    HOMING = "homing"
    PRETRIGGERED = "pretriggered"


@dataclass(frozen=True, eq=False)
class ActivationSettings:
    """How to act; see `PlanSettings`, `DecisionSettings` and `PretriggerSettings` for the others.

    Attributes:
        limits: joint limits plans are held to, already scaled.
        decision: when a task activates.
        plan: how plans are made.
        pretrigger: when to go ahead to where the next task begins.
        home: posture to return to, (n,) [rad]; None for the one the arm had at first.
        return_home: whether to return at all.
        timeout_s: silence of the task stream after which a motion is stopped.
        hold_s: how long to stay at the end of an interaction, or at a stop, before going home.
        command_period_s: least time between two updates of a running plan.
        lead_s: how far ahead a command takes over.
        max_joint_state_age_s: an older joint state is stale.
        max_tracking_error_rad: largest difference between the arm and its reference.
        rest_speed_rad_s: an arm slower than this stands.
        max_lateness_s: a prediction whose end is longer ago than this is outdated.
    """

    limits: JointLimits
    decision: DecisionSettings = field(default_factory=DecisionSettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    pretrigger: PretriggerSettings = field(default_factory=PretriggerSettings)
    home: np.ndarray | None = None
    return_home: bool = True
    timeout_s: float = 0.5
    hold_s: float = 1.0
    command_period_s: float = 0.04
    lead_s: float = 0.05
    max_joint_state_age_s: float = 0.25
    max_tracking_error_rad: float = 0.4
    rest_speed_rad_s: float = 0.2
    max_lateness_s: float = 3.0


class Prediction(NamedTuple):
    """A predicted interaction: its task, when it began, its path, and how sure its end is."""

    label: str
    onset_ns: int
    path: JointPath
    end_std: float | None

    @property
    def end_ns(self) -> int:
        """When it is expected to be over."""
        return self.onset_ns + round(self.path.duration_s * 1e9)


class Command(NamedTuple):
    """A plan that takes over at start_ns."""

    start_ns: int
    plan: JointPlan

    @property
    def end_ns(self) -> int:
        """When it comes to rest."""
        return self.start_ns + round(self.plan.duration_s * 1e9)

    def at(self, time_ns: int) -> Reference:
        """What it asks of the arm at a time."""
        return self.plan.at((time_ns - self.start_ns) * 1e-9)

    def phase_at(self, time_ns: int) -> tuple[float, float, float]:
        """Phase, phase rate [1/s] and its derivative [1/s^2] at a time."""
        return self.plan.phase_at((time_ns - self.start_ns) * 1e-9)
