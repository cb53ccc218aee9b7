# SPDX-License-Identifier: Apache-2.0
"""Sessions of two coworkers with tracked wrists, and of one coworker who works with an arm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from sim_bridge.arm import find_robot
from sim_bridge.coworker import (
    Interaction,
    Reach,
    SessionPlan,
    SessionTiming,
    WristSamples,
    sample_wrist,
)
from sim_bridge.scenarios.assembly.interaction import AssemblyInteraction, Timed, plan_interaction
from sim_bridge.scenarios.assembly.styles import ASSISTANT, RESTS, TASKS, WORKER, Place
from sim_bridge.scenarios.toolbox import ToolboxArm

SESSIONS, PER_SESSION, PER_TASK = 3, 40, 40

MARGIN_S = 0.4
"""Margin of a marked demonstration before the worker's onset and after both people rest [s]."""


@dataclass(frozen=True)
class AssemblySession:
    """A planned session, with the tracker's samples of both wrists at the same times, 100 Hz."""

    interactions: tuple[AssemblyInteraction, ...]
    worker: WristSamples
    assistant: WristSamples


def session_tasks(seed: int, index: int) -> tuple[str, ...]:
    """Tasks of a session in order, from 40 of each task shuffled over the three sessions."""
    if not 0 <= index < SESSIONS:
        expected = f"0 to {SESSIONS - 1}"
        raise ArgumentError.about("index", expected, index, "There are no more sessions.")
    dealt = np.repeat(TASKS, PER_TASK)[
        np.random.default_rng([seed, 40]).permutation(PER_TASK * len(TASKS))
    ]
    part = dealt[index * PER_SESSION : (index + 1) * PER_SESSION]
    return tuple(str(task) for task in part)


def plan_session(
    seed: int,
    index: int,
    tasks: Sequence[str] | None = None,
    *,
    idle_s: tuple[float, float] = (0.45, 0.6),
    hold_s: float = 0.45,
) -> AssemblySession:
    """Plan session number `index` of a seed: a pure function of its arguments.

    `tasks` are those of `session_tasks` by default; `idle_s` is the shortest and the longest rest
    between interactions.

    Raises:
        ArgumentError: a task or the session is unknown.
    """
    tasks = session_tasks(seed, index) if tasks is None else tasks
    rng = np.random.default_rng([seed, 41, index])
    wrists = {body: rest.draw(rng) for body, rest in RESTS.items()}
    movements: dict[str, list[Timed]] = {body: [] for body in RESTS}
    interactions, now = [], MARGIN_S + idle_s[0]
    for task in tasks:
        shown = plan_interaction(rng, task, wrists[WORKER], wrists[ASSISTANT], now)
        interactions.append(shown)
        back, over = shown.end_s + hold_s, 0.0
        for body, moved in ((WORKER, shown.worker), (ASSISTANT, shown.assistant)):
            retract = _retract(rng, moved[-1][1].goal_m, RESTS[body])
            movements[body] += [*moved, (back, retract)]
            wrists[body], over = retract.goal_m, max(over, back + retract.duration_s)
        now = over + rng.uniform(*idle_s)
    length, gaps_per_s = over + 0.6, 0.08
    worker = sample_wrist(rng, movements[WORKER], length, gaps_per_s=gaps_per_s)
    facing_worker = np.array([0.0, 0.0, 0.0, 1.0])  # its x axis toward the worker, its z axis up
    assistant = sample_wrist(
        rng, movements[ASSISTANT], length, gaps_per_s=gaps_per_s, rest=facing_worker
    )
    return AssemblySession(tuple(interactions), worker, assistant)


def of_worker(session: AssemblySession) -> SessionPlan:
    """The session without the assistant, for a worker who works with an arm."""
    interactions = [
        Interaction(shown.task, shown.onset_s, shown.end_s, shown.goal_m, shown.worker[-1][1])
        for shown in session.interactions
    ]
    return SessionPlan(session.worker, tuple(interactions))


def _retract(rng: np.random.Generator, start_m: Floats, rest: Place) -> Reach:
    bow = np.array([0.0, 0.0, 0.02]) + 0.012 * rng.standard_normal(3)
    turn = 0.1 * rng.standard_normal(3)
    return Reach("", start_m, rest.draw(rng), rng.uniform(0.8, 1.0), bow, 1.0, turn)


REST_M = RESTS[ASSISTANT].centre_m
"""Position where assistants rest (3,), world."""
SHUFFLED = ("random", "habit")
"""Task lists that mean the order of a recorded session, since the assembly has no habit."""


def plan_live(seed: int, task_list: str, count: int, timing: SessionTiming) -> AssemblySession:
    """Plan a session that was not recorded, with time for the arm to go home.

    The task list is labels separated by commas, or one of `SHUFFLED`; a count of 0 takes all.

    Raises:
        ArgumentError: a task is unknown.
    """
    listed = session_tasks(seed, 0)
    if task_list not in SHUFFLED:
        listed = tuple(label.strip() for label in task_list.split(","))
    tasks = listed[: count or None]
    held = timing.hold_s[1]
    return plan_session(seed, SESSIONS, tasks, idle_s=timing.idle_s, hold_s=held)


def in_assistants_place(arm: str, tip: str = "") -> dict[str, dict[str, object]]:
    """Parameters by node for an arm that takes the assistant's place (see `find_robot`).

    Raises:
        IntentError: there is no such arm, or its hand cannot reach the assistant's resting place.
    """
    placed = ToolboxArm(find_robot(arm, tip=tip), REST_M)
    hand, home = {"hand_link": placed.robot.tip}, placed.home.tolist()
    return {
        "intent_estimator": hand,
        "dashboard": hand,
        "primitive_activation": hand | {"home": home, "hold_time": 2.5},
        "arm_sim": {"initial_position": home, "tip": tip},
    }
