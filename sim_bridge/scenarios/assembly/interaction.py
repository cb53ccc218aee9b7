# SPDX-License-Identifier: Apache-2.0
"""One interaction of two coworkers who wait for each other: their movements and times."""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from sim_bridge.coworker import Reach, draw_hesitations
from sim_bridge.scenarios.assembly.styles import (
    EARLY_S,
    FASTENING,
    FLIP_BOW_M,
    FLIPPED_M,
    GIVE_M,
    GOALS,
    GRASP_S,
    HAND_OVER,
    HOLD_M,
    PERSONAL_LOG_STD,
    PERSONAL_STD_M,
    PLATE,
    PLATE_INSERTION,
    PRESS_M,
    PUSH_M,
    REACTION_S,
    READY_S,
    SCREWDRIVER,
    TAKE_BOX_M,
    TASKS,
    TEMPO_LOG_STD,
    TRAY,
)

Timed = tuple[float, Reach]
"""Onset on the session's clock [s] and movement."""


@dataclass(frozen=True)
class AssemblyInteraction:
    """Movements of both people; times in seconds on the session's clock."""

    task: str
    worker: tuple[Timed, ...]  # (onset, movement) of the observed wrist, in order
    assistant: tuple[Timed, ...]  # (onset, movement) of the predicted wrist, in order
    goal_m: Floats  # position where the worker's wrist waits for the assistant, (3,)
    arrival_s: float  # time at which the assistant's wrist stops at the end

    @property
    def onset_s(self) -> float:
        """Time at which the worker begins."""
        return self.worker[0][0]

    @property
    def end_s(self) -> float:
        """Time at which the last movement of either person ends."""
        return max(onset + reach.duration_s for onset, reach in (self.worker[-1], *self.assistant))


class _Person:
    """One wrist with its successive movements; `now_s` is the end of the last one."""

    def __init__(
        self, rng: np.random.Generator, task: str, wrist_m: Floats, now_s: float, tempo: float
    ):
        self._rng, self._task, self._tempo = rng, task, tempo
        self._turn = 0.15 * rng.standard_normal(3)
        self.wrist_m, self.now_s = wrist_m, now_s
        self.movements: list[Timed] = []

    def wait(self, until_s: float, extra_s: tuple[float, float]) -> None:
        """Rest until `extra_s` (drawn) after `until_s` and after the person's last movement."""
        self.now_s = max(until_s, self.now_s) + self._rng.uniform(*extra_s)

    def move(
        self,
        goal_m: Floats,
        nominal_s: float,
        bow_m: tuple[float, float, float] | Floats = (0.0, 0.0, 0.03),
        *,
        hesitant: bool = True,
        not_before_s: float = 0.0,
    ) -> None:
        """Reach for a goal at a tempo near the pair's, or slower to arrive no sooner than given."""
        rng = self._rng
        nominal_s *= self._tempo * float(np.exp(PERSONAL_LOG_STD * rng.standard_normal()))
        nominal_s = max(nominal_s, not_before_s - self.now_s)
        drawn = draw_hesitations(rng)
        hesitant = hesitant and rng.uniform() < 0.5
        share = min(1.0, np.linalg.norm(goal_m - self.wrist_m) / 0.25)
        bow = share * (np.asarray(bow_m) + 0.012 * rng.standard_normal(3))
        turn = self._turn + 0.05 * rng.standard_normal(3)
        way, skew = (self._task, self.wrist_m, goal_m, nominal_s, bow), rng.uniform(1.0, 1.6)
        reach = Reach(*way, skew, turn, drawn if hesitant else ())
        self.movements.append((self.now_s, reach))
        self.wrist_m, self.now_s = goal_m, self.now_s + reach.duration_s


def plan_interaction(
    rng: np.random.Generator, task: str, worker_m: Floats, assistant_m: Floats, onset_s: float
) -> AssemblyInteraction:
    """Draw an interaction from the resting wrists (3,); the worker begins at `onset_s`.

    Raises:
        ArgumentError: the task is unknown.
    """
    if task not in GOALS:
        raise ArgumentError.about("task", f"one of {TASKS}", repr(task), "Correct the label.")
    tempo = float(np.exp(TEMPO_LOG_STD * rng.standard_normal()))
    worker = _Person(rng, task, worker_m, onset_s, tempo)
    assistant = _Person(rng, task, assistant_m, onset_s, tempo)
    goal = GOALS[task].draw(rng)
    _ACTS[task](rng, worker, assistant, goal)
    arrival, last = assistant.movements[-1]
    return AssemblyInteraction(
        task, tuple(worker.movements), tuple(assistant.movements), goal, arrival + last.duration_s
    )


def _beside(rng: np.random.Generator, goal_m: Floats, offset_m: Floats) -> Floats:
    """Position of the assistant's wrist for a worker's goal: the offset plus personal variation."""
    return goal_m + offset_m + PERSONAL_STD_M * rng.standard_normal(3)


def _hand_over(
    rng: np.random.Generator, worker: _Person, assistant: _Person, goal_m: Floats
) -> None:
    begun_s = worker.now_s
    worker.move(goal_m, 1.3)
    assistant.wait(begun_s, REACTION_S)
    assistant.move(TRAY.draw(rng), 1.1)
    assistant.wait(0.0, GRASP_S)
    assistant.move(_beside(rng, goal_m, GIVE_M), 1.1)


def _fastening(
    rng: np.random.Generator, worker: _Person, assistant: _Person, goal_m: Floats
) -> None:
    worker.move(SCREWDRIVER.draw(rng), 1.0)
    taken_s = worker.now_s
    worker.wait(0.0, GRASP_S)
    worker.move(goal_m, 1.15)
    assistant.wait(taken_s, REACTION_S)
    assistant.move(_beside(rng, goal_m, HOLD_M), 1.1)
    worker.wait(assistant.now_s, READY_S)
    worker.move(goal_m + PRESS_M, 0.5, (0.0, 0.0, 0.0), hesitant=False)


def _plate_insertion(
    rng: np.random.Generator, worker: _Person, assistant: _Person, goal_m: Floats
) -> None:
    worker.move(PLATE.draw(rng), 1.0)
    taken_s = worker.now_s
    worker.wait(0.0, GRASP_S)
    assistant.wait(taken_s, REACTION_S)
    assistant.move(_beside(rng, goal_m, TAKE_BOX_M), 1.0)
    assistant.wait(0.0, GRASP_S)
    assistant.move(_beside(rng, goal_m, FLIPPED_M), 1.1, FLIP_BOW_M)
    worker.move(goal_m, 1.15, not_before_s=assistant.now_s - rng.uniform(*EARLY_S))
    worker.wait(assistant.now_s, READY_S)
    worker.move(goal_m + PUSH_M, 0.7, (0.0, 0.0, 0.0), hesitant=False)


_ACTS = {HAND_OVER: _hand_over, FASTENING: _fastening, PLATE_INSERTION: _plate_insertion}
