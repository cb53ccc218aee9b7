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
    """When the arm acts, and within which bounds.

    Attributes:
        limits: joint limits of all plans, already scaled.
        decision: when a task activates.
        pretrigger: when to go ahead to where the next task begins.
        home: posture to return to, (n,) [rad]; None for the posture before the first motion.
        return_home: whether to return home at all.
        timeout_s: silence of the task stream after which a motion is stopped [s]: many observations
            of a 100 Hz stream, and shorter than a reach.
        hold_s: time at the end of an interaction, or at a stop, before the arm goes home [s].
        command_period_s: least time between two updates of a running plan [s]; by default that of
            predictions, 25 Hz.
        lead_s: time from planning a command to its start [s]; must exceed planning and delivery
            (see the page on speed).
        max_joint_state_age_s: age from which a joint state is stale [s].
        max_tracking_error_rad: largest difference between the arm and its reference [rad]: several
            times the lag of a torque-controlled arm in fast motions.
        max_lateness_s: time after its end from which a prediction is outdated [s].
        clearance: keeps plans clear of things; None to check the joint limits alone.
        separation: slows motions near the predicted person, but no brake; None to slow none.
        slow_places: bounds the tip's speed at these places; None to slow none.
        correction: lets the arm yield to a person who moves it, and follow the corrected path; None
            to treat a push as a tracking error.
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
    """Shared by all parts of an `Activation`, whose settings may be replaced."""

    settings: ActivationSettings
    reject: Callable[[str, str], None]
    counts: Counter[str] = field(default_factory=Counter)
