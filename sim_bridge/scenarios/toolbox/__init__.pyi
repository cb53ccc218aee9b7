# SPDX-License-Identifier: Apache-2.0
from .gripper import ToolboxGripper
from .objects import ObjectHolder, ToolboxObjects
from .other_arms import ToolboxArm
from .scene import (
    HOME,
    HOME_HAND_M,
    LIFT_M,
    STANDS_M,
    arm_posture,
    hand_rotation,
    handover_point,
    handover_rotation,
    home_pose,
    pose,
    stand_pose,
)
from .session_scoring import (
    DECIDED_WITHIN_S,
    EARLIEST_DECISION_S,
    Scoring,
    first_sample_ns,
    score_people,
    toolbox_places,
)
from .transfers import ToolboxTransfers

__all__ = [
    "DECIDED_WITHIN_S",
    "EARLIEST_DECISION_S",
    "HOME",
    "HOME_HAND_M",
    "LIFT_M",
    "STANDS_M",
    "ObjectHolder",
    "Scoring",
    "ToolboxArm",
    "ToolboxGripper",
    "ToolboxObjects",
    "ToolboxTransfers",
    "arm_posture",
    "first_sample_ns",
    "hand_rotation",
    "handover_point",
    "handover_rotation",
    "home_pose",
    "pose",
    "score_people",
    "stand_pose",
    "toolbox_places",
]
