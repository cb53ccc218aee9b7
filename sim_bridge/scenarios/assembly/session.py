# SPDX-License-Identifier: Apache-2.0
"""A session of two coworkers: one interaction after the other, as the tracker sees both wrists."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from sim_bridge.coworker import Interaction, Reach, SessionPlan, WristSamples, sample_wrist
from sim_bridge.scenarios.assembly.interaction import AssemblyInteraction, Timed, plan_interaction
from sim_bridge.scenarios.assembly.styles import ASSISTANT, RESTS, TASKS, WORKER, Place

SESSIONS, PER_SESSION, PER_TASK = 3, 40, 40

MARGIN_S = 0.4
"""How long before the worker's onset and after the rest of both a demonstration is marked [s]."""


@dataclass(frozen=True)
class AssemblySession:
    """A planned session, and what the tracker sees of both wrists at the same times, 100 Hz."""

    interactions: tuple[AssemblyInteraction, ...]
    worker: WristSamples
    assistant: WristSamples


def session_tasks(seed: int, index: int) -> tuple[str, ...]:
    """The tasks of a session in their order: 40 of each over the three sessions, shuffled."""
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

    Without tasks they are those of `session_tasks`; `idle_s` is the shortest and the longest rest
    between two.

    Raises:
        ArgumentError: an unknown task or session.
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
    """The session without the assistant, for a worker whom an arm helps."""
    interactions = [
        Interaction(shown.task, shown.onset_s, shown.end_s, shown.goal_m, shown.worker[-1][1])
        for shown in session.interactions
    ]
    return SessionPlan(session.worker, tuple(interactions))


def _retract(rng: np.random.Generator, start_m: Floats, rest: Place) -> Reach:
    bow = np.array([0.0, 0.0, 0.02]) + 0.012 * rng.standard_normal(3)
    turn = 0.1 * rng.standard_normal(3)
    return Reach("", start_m, rest.draw(rng), rng.uniform(0.8, 1.0), bow, 1.0, turn)
