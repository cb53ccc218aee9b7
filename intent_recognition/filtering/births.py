# SPDX-License-Identifier: Apache-2.0
"""What may happen on the way, and how often: rates relative to how long the tasks usually take.

A hypothesis that is born on the way takes its share of what all hypotheses are worth. A new task
takes it from all others, and the old task again, for a detour on its way; its pace, the duration in
standard deviations of the task's, is as probable as the pace of the movement so far. Who is held up
goes on with the same movement later. What is none of the tasks begins at its birth, wherever the
hand is. The hypotheses that were there from the onset pay for what they pass on.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.hypotheses import Hypotheses, duration_offsets
from intent_recognition.filtering.newborn import FADINGS
from intent_recognition.promp import TaskLibrary

SWITCHES = 0.04
"""Rate at which a person turns to another task, per usual duration of the tasks
(docs/decisions/change_of_mind.md)."""
DETOURS = 0.03
"""Rate at which a person goes on with the same task in another way, likewise."""
HOLD_UPS = 0.3
"""Rate at which a person is held up, and goes on with the same movement later, likewise."""
STRAYS = 0.3
"""Rate at which a known movement becomes one of no task, likewise; its evidence counts beyond the
library's margin only."""
DELAYS = (0.05, 0.12, 0.25)
"""How long a person is held up, in usual durations of the tasks, likewise."""
N_DURATIONS = 7
"""Durations per task at each birth. Convention: offsets make up for what lies between."""


class BirthGrid(NamedTuple):
    """What is born at a time: tasks by rates of fading by durations, n hypotheses.

    Attributes:
        prior: number of the task among those that are born of, times the rates, and of the rate.
        duration: number of the duration.
        rate: at which the offset of the hand fades, per usual duration.
        offsets: of the durations, in standard deviations of their logarithm, (S',).
    """

    prior: NDArray[np.int64]
    duration: NDArray[np.int64]
    rate: NDArray[np.float64]
    offsets: NDArray[np.float64]


def birth_grid(n_tasks: int, n_scales: int) -> BirthGrid:
    """What is born of so many tasks, none among them.

    Args:
        n_tasks: how many.
        n_scales: durations per task of the hypotheses of the onset; no more are born.
    """
    offsets, _ = duration_offsets(min(n_scales, N_DURATIONS))
    n_rates, n_durations = len(FADINGS), len(offsets)
    prior, duration = np.divmod(np.arange(n_tasks * n_rates * n_durations), n_durations)
    return BirthGrid(prior, duration, np.array(FADINGS)[prior % n_rates], offsets)


def log_pace(
    hypotheses: Hypotheses, log_evidence: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Log probability of the durations of newborn hypotheses of a task, and of none, (2, S').

    Args:
        hypotheses: of the onset.
        log_evidence: density of all observations under them, (B,).
        offsets: of the durations, in standard deviations of their logarithm, (S',).
    """
    at, log_prior = duration_offsets(hypotheses.n_scales)
    joint = (hypotheses.log_prior + log_evidence).reshape(-1, len(at))[:-1]
    own = np.logaddexp.reduce(joint, axis=1)
    tempered = log_prior + hypotheses.duration_evidence * log_evidence.reshape(-1, len(at))[:-1]
    tempered -= np.logaddexp.reduce(tempered, axis=1, keepdims=True)
    so_far = np.logaddexp.reduce(tempered + (own - np.logaddexp.reduce(own))[:, None], axis=0)
    table = np.array([np.interp(offsets, at, row) for row in (so_far, log_prior)])
    return np.asarray(table - np.logaddexp.reduce(table, axis=1, keepdims=True))


def log_staying(library: TaskLibrary, passed: float) -> float:
    """Log probability with which a task of the onset passed nothing on to tasks.

    Args:
        library: the learned tasks.
        passed: time since onset, in usual durations.
    """
    return -(SWITCHES * float(np.exp(-library.switch_margin)) + DETOURS + HOLD_UPS) * passed


def shares(
    total: NDArray[np.float64],
    log_prior: NDArray[np.float64],
    passed: float,
    *,
    none_margin: float = 0.0,
    switch_margin: float = 0.0,
) -> NDArray[np.float64]:
    """Log of what passes to newborn hypotheses in a time, (2 K + 1,).

    First what passes to each task and to none, then to each task whose movement is held up.

    Args:
        total: log joint of the tasks and none, everything together, (K + 1,).
        log_prior: of the tasks, (K,).
        passed: the time, in usual durations.
        none_margin: evidence that a known task must have over none before it counts, in nats.
        switch_margin: evidence that another task must have over the old one, likewise.
    """
    known, n_tasks = total[:-1], len(total) - 1
    everything = np.logaddexp.reduce(known)
    with np.errstate(divide="ignore"):
        others = everything + np.log(-np.expm1(np.minimum(known - everything, 0.0)))
        turning = others + log_prior + np.log(SWITCHES * n_tasks / max(n_tasks - 1, 1))
        own = np.logaddexp(known + np.log(DETOURS), turning - switch_margin)
        stray, held_up = everything + np.log(STRAYS) - none_margin, known + np.log(HOLD_UPS)
        return np.r_[own, stray, held_up] + np.log(passed)
