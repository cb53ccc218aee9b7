# SPDX-License-Identifier: Apache-2.0
"""The simulated coworker: wrist movements as pure functions of a random generator."""

from sim_bridge.coworker.noise import RATE_HZ
from sim_bridge.coworker.reach import (
    USUAL_BLEND,
    JoinedMovement,
    Reach,
    WristMovement,
    blend,
    bow_profile,
    draw_hesitations,
    draw_reach,
    draw_rest,
    joined,
    last_reach,
)
from sim_bridge.coworker.session import (
    WITHOUT_PAUSE,
    Interaction,
    SessionPlan,
    SessionTiming,
    plan_people,
    plan_session,
)
from sim_bridge.coworker.styles import HOLD, PLATE, SCREW, STYLES, TASKS
from sim_bridge.coworker.task_list import change_some, parse_task_list, work_shares
from sim_bridge.coworker.timeline import WristSamples, sample_wrist
