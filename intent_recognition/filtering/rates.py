# SPDX-License-Identifier: Apache-2.0
"""How often people turn, begin anew, make detours and are delayed: what passes to the newborn.

And how long reaches that begin anew move.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary

SWITCH_RATE = 0.04
"""Rate at which a person turns to another task, per usual duration of the tasks
(docs/decisions/change_of_mind.md)."""
REACH_RATE = 0.0025
"""Rate at which a person begins anew with another task, likewise."""
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

TURN, DELAY, AFRESH = range(3)
"""Kinds of birth: into the course so far of a task, a delayed copy, both with an offset that fades
as a spring; into a course that begins now, with one that ends at rest."""


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
    """Log of what passes in a time to the newborn hypotheses of each task and of none, (3, K + 1).

    By kind: `TURN` (for the old task a detour), `DELAY`, and `AFRESH`.

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
        afresh = turning - switch_margin + np.log(REACH_RATE / SWITCH_RATE)
        shares = np.full((3, n_tasks + 1), -np.inf)
        shares[:, :-1] = own, known + np.log(DELAY_RATE), afresh
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
