# SPDX-License-Identifier: Apache-2.0
"""Rates of turns, new reaches, detours and delays, and the shares that newborn hypotheses receive.

Also the part of its duration in which a new reach moves.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary

SWITCH_RATE = 0.04
"""Rate of turns to another task, per usual duration of the tasks, as all rates here
(docs/decisions/change_of_mind.md)."""
REACH_RATE = 0.0025
"""Rate of new reaches for the goal of another task."""
REACH_UNTIL = 0.6
"""Time after onset, in usual durations, after which no new reach is assumed: of later ones too
little is seen to recognise the goal (docs/decisions/change_of_mind.md)."""
DETOUR_RATE = 0.03
"""Rate of detours: the same task goes on by another way."""
DELAY_RATE = 0.3
"""Rate of delays: the same movement goes on later."""
NONE_RATE = 0.3
"""Rate at which a known movement becomes an unknown one; the evidence of this counts beyond the
library's margin only."""

STOP_LEAD = 0.06
"""Time from the onset of a reach to a momentary stop, in usual durations: the reach first has to
halt the hand (docs/decisions/change_of_mind.md). Samples before the stop belong to the last
movement and are not used."""

TURN, DELAY, AFRESH = range(3)
"""Kinds of birth. A turn joins the course of a task, a delay copies a hypothesis; their offsets
fade as a spring. A reach begins afresh at its birth, and its offset ends at rest."""


def switch_threshold(share: float) -> float:
    """Probability from which another task may replace one that was active.

    While a mind does not change, the odds that it did only grow by what births add: on average r a
    usual duration, at the rate r of turns and new reaches. By Doob's maximal inequality, such odds
    ever exceed r / share in at most that share of movements of the usual duration.

    Args:
        share: largest accepted share of movements with such a switch, in (0, 1].
    """
    rate = SWITCH_RATE + REACH_RATE * REACH_UNTIL
    return rate / (rate + share)


def log_stay(passed: float, switch_margin: float) -> float:
    """Log of the share of a task's probability left to its hypotheses of the onset.

    `passed` is the time since onset in usual durations; `switch_margin` is that of `birth_shares`.
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
    """Log of the shares that newborn hypotheses of each task and of none receive, (3, K + 1).

    Rows are the kinds of birth: `TURN` (a detour for the same task), `DELAY` and `AFRESH`.

    Args:
        total: log joint of each task and of none over all hypotheses, (K + 1,).
        log_prior: log prior of the tasks, (K,).
        passed: time since the last birth, in usual durations.
        none_margin: nats subtracted from the share of none.
        switch_margin: nats subtracted from the shares of turns and reaches to another task.
    """
    known, n_tasks = total[:-1], len(total) - 1
    everything = np.logaddexp.reduce(known)
    with np.errstate(divide="ignore"):
        others = everything + np.log(-np.expm1(known - everything))
        turning = others + log_prior + np.log(SWITCH_RATE * n_tasks / max(n_tasks - 1, 1))
        own = np.logaddexp(known + np.log(DETOUR_RATE), turning - switch_margin)
        afresh = turning - switch_margin + np.log(REACH_RATE / SWITCH_RATE)
        shares = np.full((3, n_tasks + 1), -np.inf)
        shares[:, :-1] = own, known + np.log(DELAY_RATE), afresh
        shares[TURN, -1] = everything + np.log(NONE_RATE) - none_margin
        return shares + np.log(passed)


def moving_parts(library: TaskLibrary, scale: Floats) -> Floats:
    """Part of each task's duration in which its mean course moves, as a reach of least jerk, (K,).

    `scale` makes the observed DOFs comparable, (P,): distances are in units of it.
    """
    phase = np.linspace(0.0, 1.0, 201)
    mean = library.observed_mean.reshape(len(library.observed_mean), len(scale), -1)[:-1]
    course = np.einsum("tn,kpn->ktp", library.basis.design_matrix(phase), mean) / scale
    way = np.linalg.norm(np.diff(course, axis=1), axis=2).cumsum(axis=1)
    done = np.argmax(way >= 0.99 * way[:, -1:], axis=1)
    return np.asarray(np.minimum(phase[1:][done] / 0.894, 1.0))  # least jerk is 99 % done there
