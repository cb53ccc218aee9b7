# SPDX-License-Identifier: Apache-2.0
"""How often people turn, begin anew, make detours and are delayed: what passes to the newborn.

And what reaches that begin anew take from tasks: how long they move, and their ends.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary

SWITCH_RATE = 0.04
"""Rate at which a person turns to another task, per usual duration of the tasks
(docs/decisions/change_of_mind.md)."""
REACH_RATE = 0.0025
"""Rate at which a person begins anew with another task, likewise, half of them straight."""
REACH_UNTIL = 0.6
"""Part of a usual duration after which nobody does: of who turns later too little is seen to tell
the goal (docs/decisions/change_of_mind.md)."""
DETOUR_RATE = 0.03
"""Rate at which a person goes on with the same task in another way, likewise."""
DELAY_RATE = 0.3
"""Rate at which a person is delayed, and goes on with the same movement later, likewise."""
NONE_RATE = 0.3
"""Rate at which a known movement becomes one of no task, likewise; its evidence counts beyond the
library's margin only."""

TURN, DELAY, AFRESH, STRAIGHT = range(4)
"""Kinds of birth: into the course so far of a task, a delayed copy, both with an offset that fades
as a spring; into a course that begins now, or straight to its end, with one that ends at rest."""


def may_begin_anew(passed: float) -> bool:
    """Whether somebody begins anew so long after the onset, in usual durations."""
    return passed <= REACH_UNTIL


def log_stay(passed: float, switch_margin: float) -> float:
    """Log probability with which a task of the onset has passed nothing on to tasks.

    Time has passed since then, in usual durations; margin as of `birth_shares`.
    """
    turned = SWITCH_RATE * passed + REACH_RATE * min(passed, REACH_UNTIL)
    turned *= float(np.exp(-switch_margin))
    return -turned - (DETOUR_RATE + DELAY_RATE) * passed


def birth_shares(
    total: Floats,
    log_prior: Floats,
    passed: float,
    *,
    none_margin: float = 0.0,
    switch_margin: float = 0.0,
) -> Floats:
    """Log of what passes in a time to the newborn hypotheses of each task and of none, (4, K + 1).

    By kind: `TURN` (for the old task a detour), `DELAY`, `AFRESH`, and `STRAIGHT`.

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
        turning = others + log_prior + np.log(SWITCH_RATE * n_tasks / max(n_tasks - 1, 1))
        own = np.logaddexp(known + np.log(DETOUR_RATE), turning - switch_margin)
        afresh = turning - switch_margin + np.log(0.5 * REACH_RATE / SWITCH_RATE)
        shares = np.full((4, n_tasks + 1), -np.inf)
        shares[:, :-1] = own, known + np.log(DELAY_RATE), afresh, afresh
        shares[TURN, -1] = everything + np.log(NONE_RATE) - none_margin
        return shares + np.log(passed)


def moving_parts(library: TaskLibrary, scale: Floats) -> Floats:
    """Part of each task's duration in which its mean course moves, as by least jerk, (K,).

    The observed DOFs are measured in a scale, (P,).
    """
    phase = np.linspace(0.0, 1.0, 201)
    mean = library.observed_mean.reshape(len(library.observed_mean), len(scale), -1)[:-1]
    course = np.einsum("tn,kpn->ktp", library.basis.design_matrix(phase), mean) / scale
    way = np.linalg.norm(np.diff(course, axis=1), axis=2).cumsum(axis=1)
    done = np.argmax(way >= 0.99 * way[:, -1:], axis=1)
    return np.asarray(np.minimum(phase[1:][done] / 0.894, 1.0))  # least jerk has done so much there


def end_tells(library: TaskLibrary) -> Floats:
    """How far each task's end tells it from every other: 1 less the largest overlap, (K,).

    The overlap of two ends is the Bhattacharyya coefficient of their distributions. A hand that
    goes straight to an end that tasks share says nothing of which it is.
    """
    n_tasks, row = library.n_tasks, library.basis.design_matrix(np.ones(1))[0]
    to_end = np.kron(np.eye(library.n_observed), row)  # (P, P N)
    mean = library.observed_mean[:n_tasks] @ to_end.T
    covariance = to_end @ library.observed_covariance[:n_tasks] @ to_end.T
    apart = mean[:, None] - mean
    common = 0.5 * (covariance[:, None] + covariance)
    half = 0.5 * np.linalg.slogdet(covariance)[1]
    distance = np.einsum("ijp,ijp->ij", apart, np.linalg.solve(common, apart[..., None])[..., 0])
    log_overlap = 0.5 * (half[:, None] + half - np.linalg.slogdet(common)[1]) - 0.125 * distance
    np.fill_diagonal(log_overlap, -np.inf)
    return np.asarray(-np.expm1(np.minimum(log_overlap.max(axis=1), 0.0)))
