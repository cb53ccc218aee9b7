# SPDX-License-Identifier: Apache-2.0
"""The assembly live: a worker who acts for himself, and an arm in the assistant's place."""

from sim_bridge.arm import find_robot
from sim_bridge.coworker import SessionTiming
from sim_bridge.scenarios.assembly.session import (
    SESSIONS,
    AssemblySession,
    plan_session,
    session_tasks,
)
from sim_bridge.scenarios.assembly.styles import ASSISTANT, RESTS
from sim_bridge.scenarios.toolbox import ToolboxArm

REST_M = RESTS[ASSISTANT].centre_m
"""Where assistants rest (3,), world."""
SHUFFLED = ("random", "habit")
"""Task lists that mean the order of a recorded session: the assembly has no habit."""


def plan_live(seed: int, task_list: str, count: int, timing: SessionTiming) -> AssemblySession:
    """A session that was not recorded, with time for the arm to go home.

    The task list is labels separated by commas, or one of `SHUFFLED`; a count of 0 takes all.

    Raises:
        ArgumentError: an unknown task.
    """
    listed = session_tasks(seed, 0)
    if task_list not in SHUFFLED:
        listed = tuple(label.strip() for label in task_list.split(","))
    tasks = listed[: count or None]
    held = timing.hold_s[1]
    return plan_session(seed, SESSIONS, tasks, idle_s=timing.idle_s, hold_s=held)


def in_assistants_place(arm: str, tip: str = "") -> dict[str, dict[str, object]]:
    """What the nodes must know of the arm that takes the assistant's place, see `find_robot`.

    Raises:
        IntentError: there is no such arm, or its hand does not reach where assistants rest.
    """
    placed = ToolboxArm(find_robot(arm, tip=tip), REST_M)
    hand, home = {"hand_link": placed.robot.tip}, placed.home.tolist()
    return {
        "intent_estimator": hand,
        "dashboard": hand,
        "primitive_activation": hand | {"home": home, "hold_time": 2.5},
        "arm_sim": {"initial_position": home, "tip": tip},
    }
