# SPDX-License-Identifier: Apache-2.0
"""The simulated coworker: wrist movements as pure functions of a random generator."""

from sim_bridge.coworker.demonstration import WristDemonstration, plan_demonstration
from sim_bridge.coworker.reach import Reach, draw_reach, reach_positions
from sim_bridge.coworker.session import (
    Interaction,
    SessionPlan,
    SessionTiming,
    parse_task_list,
    plan_session,
)
from sim_bridge.coworker.styles import STYLES, TaskStyle
from sim_bridge.coworker.timeline import WristSamples

__all__ = [
    "STYLES",
    "Interaction",
    "Reach",
    "SessionPlan",
    "SessionTiming",
    "TaskStyle",
    "WristDemonstration",
    "WristSamples",
    "draw_reach",
    "parse_task_list",
    "plan_demonstration",
    "plan_session",
    "reach_positions",
]
