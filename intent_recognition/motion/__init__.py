# SPDX-License-Identifier: Apache-2.0
"""From a predicted path to commands: retiming, plans, blending, feedback."""

from intent_recognition.motion.blending import Offset
from intent_recognition.motion.feedback_controller import (
    FeedbackPolicy,
    FeedbackSettings,
    feedback_policy,
    initial_state,
    propagate,
    resting_gains,
)
from intent_recognition.motion.hand_path import HAND_FIELDS, is_hand, joints_along
from intent_recognition.motion.path import JointPath, make_path
from intent_recognition.motion.plan import JointPlan, JointReference
from intent_recognition.motion.planning import plan_interaction, stop_plan
from intent_recognition.motion.point_to_point import brake_plan, home_plan
from intent_recognition.motion.retiming import NominalTiming
from intent_recognition.motion.settings import PlanSettings, scaled_limits

__all__ = [
    "HAND_FIELDS",
    "FeedbackPolicy",
    "FeedbackSettings",
    "JointPath",
    "JointPlan",
    "JointReference",
    "NominalTiming",
    "Offset",
    "PlanSettings",
    "brake_plan",
    "feedback_policy",
    "home_plan",
    "initial_state",
    "is_hand",
    "joints_along",
    "make_path",
    "plan_interaction",
    "propagate",
    "resting_gains",
    "scaled_limits",
    "stop_plan",
]
