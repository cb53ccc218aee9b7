# SPDX-License-Identifier: Apache-2.0
"""Is a change of mind followed? One reach before the online estimator and the node's decision."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from experiments.toolbox.session import predicted_hand, watch
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator
from sim_bridge.coworker import JoinedMovement, SessionTiming, WristMovement, sample_wrist
from sim_bridge.scenarios.toolbox import DECIDED_WITHIN_S, handover_point

REST_S = 1.0
"""Rest before the reach [s]."""


class FollowedReach(NamedTuple):
    """What became of one reach.

    Attributes:
        tasks: of the reach, in order: the one it began as, and what it was changed to ("" for a
            movement to no task).
        duration_s: of the reach.
        change_s: when the mind changed for the last time, after the onset; 0 if it did not.
        final: the task active at the end, "" if none. The end is `DECIDED_WITHIN_S` after the
            movement, or when the estimator calls it over, at most as long before its end.
        first_active_s: when the last of `tasks` became active for the first time after the
            change, after the onset; NaN if it did not.
        old_until_s: when another of `tasks` was active for the last time, after the onset;
            infinity if it was to the end, NaN if none ever was.
        others: tasks that were active but are not in `tasks`.
        withdrawals: how often the active task was withdrawn without another in its place.
        switches: how often one active task replaced another.
        hand_error_m: distance from where the predicted motion brings the hand, at the movement's
            end, to where the demonstrator's rule puts it for the last of `tasks`; NaN without a
            prediction of that task.
    """

    tasks: tuple[str, ...]
    duration_s: float
    change_s: float
    final: str
    first_active_s: float
    old_until_s: float
    others: tuple[str, ...]
    withdrawals: int
    switches: int
    hand_error_m: float

    @property
    def new_active(self) -> bool:
        """Whether the last task was active at the end."""
        return bool(self.tasks[-1]) and self.final == self.tasks[-1]

    @property
    def old_kept(self) -> bool:
        """Whether an earlier task was active at the end."""
        return self.final in set(self.tasks[:-1]) - {self.tasks[-1]}

    @property
    def delay_s(self) -> float:
        """Time from the change to when the new task was active; NaN if it was not to the end."""
        return self.first_active_s - self.change_s if self.new_active else np.nan

    @property
    def release_s(self) -> float:
        """Time from the change to the old task's release; 0 if before, NaN if never active."""
        return np.maximum(self.old_until_s - self.change_s, 0.0)


def follow_reach(
    library: TaskLibrary, movement: WristMovement, rng: np.random.Generator
) -> FollowedReach:
    """Show one reach at 100 Hz to a new estimator."""
    end_s = REST_S + movement.duration_s
    until_s = end_s + DECIDED_WITHIN_S
    samples = sample_wrist(
        rng, [(REST_S, movement)], until_s, gaps_per_s=SessionTiming().gaps_per_s
    )
    estimator = IntentEstimator(library)
    times, active, events, hand, final = [0.0], [""], [""], None, ""
    for seen in watch(estimator, samples):
        if seen.time_s >= end_s and hand is None and seen.estimate.task == movement.task:
            hand = predicted_hand(estimator)
        if seen.decision.event == "over" and seen.time_s >= end_s - DECIDED_WITHIN_S:
            break
        final = seen.decision.active
        times.append(seen.time_s - REST_S)
        active.append(final)
        events.append(seen.decision.event)
    tasks, change_s = tasks_of(movement)
    error = np.nan
    if hand is not None and movement.task:
        goal = handover_point(movement.task, movement.goal_m)
        error = float(np.linalg.norm(hand - goal))
    return FollowedReach(
        tasks,
        movement.duration_s,
        change_s,
        final,
        _first(times, active, tasks[-1], change_s),
        _last(times, active, set(tasks[:-1]) - {tasks[-1]}),
        tuple(sorted({task for task in active if task and task not in tasks})),
        events.count("withdrawn"),
        events.count("switched"),
        error,
    )


def tasks_of(movement: WristMovement) -> tuple[tuple[str, ...], float]:
    """The tasks of a reach in order, and when the mind changed for the last time."""
    if not isinstance(movement, JoinedMovement):
        return (movement.task,), 0.0
    return (*tasks_of(movement.first)[0], movement.task), movement.change_s


def _first(times: Sequence[float], active: Sequence[str], task: str, since_s: float) -> float:
    found = [t for t, a in zip(times, active, strict=True) if task and a == task and t >= since_s]
    return min(found, default=np.nan)


def _last(times: Sequence[float], active: Sequence[str], old: set[str]) -> float:
    found = [t for t, a in zip(times, active, strict=True) if a in old]
    if active[-1] in old:
        return np.inf
    return max(found, default=np.nan)
