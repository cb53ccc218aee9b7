# SPDX-License-Identifier: Apache-2.0
"""The simulated coworker: wrist movements as pure functions of a random generator."""

from sim_bridge.coworker.change import USUAL_BLEND, ChangedReach, change_of_mind
from sim_bridge.coworker.reach import (
    Reach,
    WristMovement,
    bow_profile,
    draw_hesitations,
    draw_reach,
    draw_rest,
    minimum_jerk,
)
from sim_bridge.coworker.session import (
    WITHOUT_PAUSE,
    Interaction,
    SessionPlan,
    SessionTiming,
    plan_session,
)
from sim_bridge.coworker.styles import HOLD, PLATE, SCREW, STYLES, TASKS
from sim_bridge.coworker.task_list import change_some, parse_task_list
from sim_bridge.coworker.timeline import RATE_HZ, WristSamples, sample_wrist

__all__ = [
    "HOLD",
    "PLATE",
    "RATE_HZ",
    "SCREW",
    "STYLES",
    "TASKS",
    "USUAL_BLEND",
    "WITHOUT_PAUSE",
    "ChangedReach",
    "Interaction",
    "Reach",
    "SessionPlan",
    "SessionTiming",
    "WristMovement",
    "WristSamples",
    "bow_profile",
    "change_of_mind",
    "change_some",
    "draw_hesitations",
    "draw_reach",
    "draw_rest",
    "minimum_jerk",
    "parse_task_list",
    "plan_session",
    "sample_wrist",
]
