# SPDX-License-Identifier: Apache-2.0
"""Settings of the activation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import Clearance, Correction, Separation, SlowPlaces
from intent_recognition.recognition import DecisionSettings


@dataclass(frozen=True, eq=False)
class ActivationSettings:
    """How to act; see `DecisionSettings` and `PretriggerSettings` for the others.

    Attributes:
        limits: joint limits plans are held to, already scaled.
        decision: when a task activates.
        pretrigger: when to go ahead to where the next task begins.
        home: posture to return to, (n,) [rad]; None for the one the arm had at first.
        return_home: whether to return at all.
        timeout_s: silence of the task stream after which a motion is stopped [s]. Convention: many
            observations of a 100 Hz stream, and shorter than a reach.
        hold_s: how long to stay at the end of an interaction, or at a stop, before going home [s].
            Convention.
        command_period_s: least time between two updates of a running plan [s]. Convention: 25 Hz,
            the rate of predictions.
        lead_s: how far ahead a command takes over [s]. Convention: more than planning and delivery
            take (see the page on speed).
        max_joint_state_age_s: an older joint state is stale [s]. Convention.
        max_tracking_error_rad: largest difference between the arm and its reference [rad].
            Convention: several times what a torque-controlled arm lags behind in fast motions.
        max_lateness_s: a prediction whose end is longer ago than this is outdated [s]. Convention.
        clearance: keeps plans clear of things; None: joint limits alone count.
        separation: slows what is no brake near the predicted person; None: nothing does.
        slow_places: slow what is no brake there; None: nothing does.
        correction: yields to a person who moves the arm, and goes on by it; None: a push is an
            error of tracking and nothing more.
    """

    limits: JointLimits
    decision: DecisionSettings = field(default_factory=DecisionSettings)
    pretrigger: PretriggerSettings = field(default_factory=PretriggerSettings)
    home: Floats | None = None
    return_home: bool = True
    timeout_s: float = 0.5
    hold_s: float = 1.0
    command_period_s: float = 0.04
    lead_s: float = 0.05
    max_joint_state_age_s: float = 0.25
    max_tracking_error_rad: float = 0.4
    max_lateness_s: float = 3.0
    clearance: Clearance | None = None
    separation: Separation | None = None
    slow_places: SlowPlaces | None = None
    correction: Correction | None = None


@dataclass(eq=False)
class Common:
    """What all parts of an activation share, see `Activation`; the settings may change."""

    settings: ActivationSettings
    reject: Callable[[str, str], None]
    counts: Counter[str] = field(default_factory=Counter)
