# SPDX-License-Identifier: Apache-2.0
from .live import LivePouring, balls_above_m, start_posture
from .novel import (
    HALF_FULL,
    PourLevel,
    Seen,
    annotated_source,
    learn_pouring_skill,
    plan,
    read_demonstrated,
    read_pour,
    seen_as,
)
from .pairs import N_BALLS, PAIRS, TASK, container_named, half_full_radius_m
from .practice import SHORT_STD_RADII, PouringPractice, short_skill
from .table import PouringTable
from .task_space import OPENING_M, PourPath, SideGrasp, plan_joints, seen_path

__all__ = [
    "HALF_FULL",
    "N_BALLS",
    "OPENING_M",
    "PAIRS",
    "SHORT_STD_RADII",
    "TASK",
    "LivePouring",
    "PourLevel",
    "PourPath",
    "PouringPractice",
    "PouringTable",
    "Seen",
    "SideGrasp",
    "annotated_source",
    "balls_above_m",
    "container_named",
    "half_full_radius_m",
    "learn_pouring_skill",
    "plan",
    "plan_joints",
    "read_demonstrated",
    "read_pour",
    "seen_as",
    "seen_path",
    "short_skill",
    "start_posture",
]
