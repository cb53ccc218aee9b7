# SPDX-License-Identifier: Apache-2.0
from .gripper import ToolboxGripper, make_gripper
from .objects import ToolboxObjects
from .other_arms import ToolboxArm
from .scene import (
    ARM_BRANCH,
    ARM_SWIVEL_RAD,
    HOME,
    HOME_HAND_M,
    LIFT_M,
    STANDS_M,
    arm_posture,
    hand_rotation,
    handover_point,
    pose,
)
from .session_scoring import (
    DECIDED_WITHIN_S,
    EARLIEST_DECISION_S,
    Scoring,
    first_sample_ns,
    score_session,
    toolbox_places,
)
from .teaching import HOME_STD_RAD, SENSOR_NOISE
from .teaching_path import REACTION_SHARE, TEACHING_STD_M, TEACHING_STD_RAD, teaching_times

__all__ = [
    "ARM_BRANCH",
    "ARM_SWIVEL_RAD",
    "DECIDED_WITHIN_S",
    "EARLIEST_DECISION_S",
    "HOME",
    "HOME_HAND_M",
    "HOME_STD_RAD",
    "LIFT_M",
    "REACTION_SHARE",
    "SENSOR_NOISE",
    "STANDS_M",
    "TEACHING_STD_M",
    "TEACHING_STD_RAD",
    "Scoring",
    "ToolboxArm",
    "ToolboxGripper",
    "ToolboxObjects",
    "arm_posture",
    "first_sample_ns",
    "hand_rotation",
    "handover_point",
    "make_gripper",
    "pose",
    "score_session",
    "teaching_times",
    "toolbox_places",
]
