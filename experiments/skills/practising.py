# SPDX-License-Identifier: Apache-2.0
"""Taught tasks are practised: to be where the person needs the hand, and to be there earlier.

Practice is that of `intent improve TASK`, with people as they were recorded. Its result is compared
with the start on other recorded people, and by the whole chain in physics: estimator, activation
and arm, on reaches that no model has seen.
"""

from typing import NamedTuple

import numpy as np

from experiments.execution import STEP_S, execute
from experiments.practice.study import METHODS, Practised, practise
from experiments.reaches import toolbox_recordings, watch_reach
from experiments.settings import Settings
from intent_recognition.demonstrations import load_dofs
from intent_recognition.improvement import TaskPractice, arrival_s
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.learning import Trained, change_rule, learn_with_report
from intent_recognition.motion import scaled_limits
from intent_recognition.promp import TaskLibrary
from sim_bridge.coworker import TASKS
from sim_bridge.scenarios.toolbox import handover_point

MOVED_M = 0.05
"""Distance of the wanted place from that of the demonstrations [m]."""
COSTS = DISTANCE, TIME = "distance", "time"
N_SEEDS, N_ROLLOUTS, N_REACHES = 5, 40, 3
"""Seeds, rollouts of a practice, and reaches on which the result is scored."""
N_QUICK = (1, 12, 1)
"""The same in a quick run."""


class TaskPractised(NamedTuple):
    """One practice: its task, its cost, and its result."""

    task: str
    cost: str
    done: Practised


class Waited(NamedTuple):
    """Executions in physics before and after practice, one for each reach.

    Attributes:
        task: label.
        late_s: how much later than the person the hand arrived, before and after.
        off_m: final distance of the hand from its goal, before and after.
    """

    task: str
    late_s: tuple[list[float], list[float]]
    off_m: tuple[list[float], list[float]]


class PractisingStudy(NamedTuple):
    """All practices, and the executions in physics of the first by time of each task."""

    practised: tuple[TaskPractised, ...]
    waited: tuple[Waited, ...]

    def of(self, cost: str, method: str) -> list[TaskPractised]:
        """The practices by a cost and a method."""
        return [one for one in self.practised if (one.cost, one.done.method) == (cost, method)]


def investigate(settings: Settings) -> PractisingStudy:
    """Practise every task by both costs and methods, and execute in physics."""
    n_seeds, n_rollouts, n_reaches = N_QUICK if settings.quick else (N_SEEDS, N_ROLLOUTS, N_REACHES)
    trained, dofs = learn_with_report(toolbox_recordings(settings)).trained, load_dofs()
    labels = trained.library.labels[:1] if settings.quick else trained.library.labels
    practised, waited = [], []
    for k, task in enumerate(labels):
        for n, seed in enumerate(range(settings.seed, settings.seed + n_seeds)):
            settings.progress((k + 0.8 * n / n_seeds) / len(labels), task)
            direction = np.random.default_rng([seed, 171, k]).normal(size=3)
            moved = MOVED_M * direction / np.linalg.norm(direction)
            for cost, off in ((DISTANCE, moved), (TIME, np.zeros(3))):
                practice = TaskPractice(trained, dofs, task, moved_m=off.tolist())
                for method in METHODS:
                    done = practise(practice, method, seed, n_rollouts, cost)
                    practised.append(TaskPractised(task, cost, done))
                    if (n, cost, method) == (0, TIME, METHODS[0]):
                        change = practice.change(done.weights)
                        after = change_rule(trained, task, change).library
        settings.progress((k + 0.8) / len(labels), f"{task} in physics")
        waited.append(_in_physics(trained, after, task, n_reaches, settings.seed))
    return PractisingStudy(tuple(practised), tuple(waited))


def _in_physics(
    trained: Trained, after: TaskLibrary, task: str, n_reaches: int, seed: int
) -> Waited:
    """The same reaches with both libraries."""
    found = [[_execute(one, task, k, seed) for k in range(n_reaches)]
             for one in (trained.library, after)]  # fmt: skip
    late, off = ([[pair[i] for pair in some] for some in found] for i in (0, 1))
    return Waited(task, (late[0], late[1]), (off[0], off[1]))


def _execute(library: TaskLibrary, task: str, k: int, seed: int) -> tuple[float, float]:
    """How late the hand is [s], and how far off in the end [m], in one reach."""
    number, limits = 3 * k + TASKS.index(task), scaled_limits(LWR_LIMITS)
    rngs = [np.random.default_rng([seed, stream, number]) for stream in (172, 173)]
    watched = watch_reach(library, number, rngs[0], limits)
    done = execute(watched, library, limits, None, rngs[1])
    place, n = handover_point(task, watched.goal_m), done.interacting or len(done.hand_m)
    times = np.arange(n, dtype=np.float64) * STEP_S
    samples = watched.samples
    there = arrival_s(times, done.hand_m[:n], place)
    waits = arrival_s(samples.times_s, samples.positions_m, watched.goal_m)
    return there - waits, float(np.linalg.norm(done.hand_m[n - 1] - place))
