# SPDX-License-Identifier: Apache-2.0
from .executed import (
    MEAN,
    PAIRS,
    SAMPLE,
    UNWARPED,
    Planned,
    PourOrder,
    Skill,
    execute,
    learn_pouring_skill,
    learn_skill,
    planned,
    seen_as,
)
from .live import LivePouring, balls_above_m, start_posture
from .novel import annotated_source, learn_pouring, read_demonstrated, read_pour
from .pour import Poured
from .practice import SHORT_STD_RADII, PouringPractice, short_skill
from .task_space import PourPath

__all__ = [
    "MEAN",
    "PAIRS",
    "SAMPLE",
    "SHORT_STD_RADII",
    "UNWARPED",
    "LivePouring",
    "Planned",
    "PourOrder",
    "PourPath",
    "Poured",
    "PouringPractice",
    "Skill",
    "annotated_source",
    "balls_above_m",
    "execute",
    "learn_pouring",
    "learn_pouring_skill",
    "learn_skill",
    "planned",
    "read_demonstrated",
    "read_pour",
    "seen_as",
    "short_skill",
    "start_posture",
]
