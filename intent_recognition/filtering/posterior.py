# SPDX-License-Identifier: Apache-2.0
"""Bayes over tasks in log space, with the phase marginalised (Maeda et al. 2014, Eq. 9-11).

Eq. 11 as printed forgets the past; here the posterior after one observation is the prior of the
next, which in log space is a running sum.

People's progress is not linear in time. Under every constant duration the innovations are therefore
correlated, and the product of their densities is overconfident about the duration. The posterior of
the duration raises the evidence to a power (`duration_evidence`; 1 is plain Bayes' rule).

For the same reason, the evidence of the tasks against each other is raised to a power
(`task_evidence`). The evidence of all known tasks against `none` counts only beyond a margin, which
is learned from held-out tasks (`learning.unknown_task`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats, Integers, brief
from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.filtering.table import COLUMNS
from intent_recognition.gaussian import log_sum

NONE_BORN = np.zeros(0, dtype=COLUMNS)
"""Empty array of rows: no hypothesis was born."""


class CourseTimes(NamedTuple):
    """Begin and duration of the course under each of n hypotheses."""

    task: Integers  # index of the task of each hypothesis, (n,)
    weight: Floats  # probabilities of the hypotheses given their task, (n,)
    begin_s: Floats  # when the course began, after onset, (n,)
    course_s: Floats  # duration of the course, (n,)

    def expected(self, values: Floats) -> Floats:
        """Expectation given each task, (K + 1,), of values under the hypotheses, (n,)."""
        return np.bincount(self.task, self.weight * values).astype(np.float64)

    def phase(self, elapsed_s: float) -> Floats:
        """Expected phase given each task at a time after onset, (K + 1,)."""
        into = (elapsed_s - self.begin_s) / self.course_s
        return self.expected(np.minimum(np.maximum(into, 0.0), 1.0))


@brief
class TaskPosterior(NamedTuple):
    """Posterior of task and phase after some observations.

    Attributes:
        probabilities: probabilities of the K tasks and none, (K + 1,), which sum to one.
        log_evidence: log p(observations | task), phase marginalised, (K + 1,), with `task_evidence`
            and `none_margin` applied.
        phase: expected phase given each task, (K + 1,).
        duration_s: expected duration given each task, (K + 1,).
        scale_weights: p(duration | task, observations), (K + 1, S); rows sum to one.
        timing: timing of all hypotheses, which gives the phase at other times.
        log_odds: log p(observations, some task) - log p(observations, none), without the margin.
    """

    probabilities: Floats
    log_evidence: Floats
    phase: Floats
    duration_s: Floats
    scale_weights: Floats
    timing: CourseTimes | None = None
    log_odds: float = 0.0

    def at(self, elapsed_s: float) -> TaskPosterior:
        """The posterior at another time after onset, without new observations."""
        return self if self.timing is None else self._replace(phase=self.timing.phase(elapsed_s))


def task_posterior(
    log_evidence: Floats,
    grid: PriorGrid,
    elapsed_s: float,
    born: NDArray[np.void] = NONE_BORN,
    log_stay: float = 0.0,
) -> TaskPosterior:
    """Posterior of the tasks, marginal over the durations (Maeda et al. 2014, Eq. 9-11).

    Args:
        log_evidence: log density of the observations under each hypothesis of the onset, (B,).
        grid: prior grid of tasks and durations.
        elapsed_s: time since onset.
        born: rows of the hypotheses born since, (n,).
        log_stay: log of the share of a task's probability left to its hypotheses of the onset.
    """
    log_prior, onset = grid.log_task_prior, grid.log_task_joint(log_evidence)
    onset[:-1] += log_stay
    possible, none = np.isfinite(onset), len(onset) - 1
    scale_weights = grid.duration_weights(log_evidence)
    born = born[np.isfinite(born["log_prior"])]
    joint, of_born, total = born["log_prior"] + born["log_evidence"], born["task"], onset.copy()
    np.logaddexp.at(total, of_born, joint)
    kept = np.where(possible, np.exp(onset - np.where(possible, total, 0.0)), 1.0)
    timing = CourseTimes(
        np.append(np.repeat(np.arange(none + 1), grid.n_scales), of_born),
        np.append(scale_weights * kept[:, None], np.exp(joint - total[of_born])),
        np.append(np.zeros(len(grid.duration_s)), born["onset_s"]),
        np.append(grid.duration_s, born["duration_s"]),
    )
    log_known, power, log_task = float(log_sum(total[:-1])), grid.task_evidence, onset.copy()
    log_task[:-1] = counted_joint(onset[:-1], log_prior[:-1] + log_stay, log_known, power)
    counted = counted_joint(joint, born["log_birth"], log_known, power)
    np.logaddexp.at(log_task, of_born, np.where(of_born < none, counted, joint))
    with np.errstate(invalid="ignore"):
        log_task[:-1] += np.nan_to_num(log_known - log_sum(log_task[:-1]))
        counted = np.where(possible, log_task - log_prior, -np.inf)
        counted[-1] = counted_none(counted, log_prior, grid.none_margin)
        log_task = log_prior + counted
    probabilities = np.exp(log_task - np.max(log_task))
    probabilities /= probabilities.sum()
    expected_s = timing.expected(timing.begin_s + timing.course_s)
    phase = timing.phase(elapsed_s)
    log_odds = log_known - float(total[-1])
    return TaskPosterior(probabilities, counted, phase, expected_s, scale_weights, timing, log_odds)


def answered(posterior: TaskPosterior, task: int) -> TaskPosterior:
    """Posterior after a person has said which task it is.

    An answer is right with a probability of 0.99; wrong answers are all equally probable.
    """
    n, right = len(posterior.probabilities), 0.99
    log_likelihood = np.full(n, np.log((1.0 - right) / (n - 1)))
    log_likelihood[task] = np.log(right)
    p = posterior.probabilities * np.exp(log_likelihood)
    return posterior._replace(
        probabilities=p / p.sum(), log_evidence=posterior.log_evidence + log_likelihood
    )


def counted_none(log_evidence: Floats, log_prior: Floats, margin: float) -> float:
    """Log evidence of none such that the known tasks' Bayes factor counts beyond a margin only.

    Takes log evidence and log prior of the K tasks and none, (K + 1,) each; margin >= 0 [nats].
    """
    known = log_prior[:-1] - np.logaddexp.reduce(log_prior[:-1]) + log_evidence[:-1]
    total = np.logaddexp.reduce(known)
    if not np.isfinite(total - log_evidence[-1]):
        return float(log_evidence[-1])
    return float(total - beyond_margin(total - log_evidence[-1], margin))


def counted_joint(log_joint: Floats, log_prior: Floats, log_total: float, power: float) -> Floats:
    """Log joint of hypotheses with their evidence against all others raised to a power.

    Their prior, such as that of a change of mind, is not raised to it.

    Args:
        log_joint: log of prior times density of the observations, (n,).
        log_prior: log of the prior relative to all hypotheses, (n,).
        log_total: log joint of all hypotheses together.
        power: exponent of the evidence, in (0, 1].
    """
    if power == 1.0:
        return log_joint
    return power * log_joint + (1.0 - power) * (log_prior + log_total)


def beyond_margin(log_factor: Floats, margin: float) -> Floats:
    """Part of a log Bayes factor L of known tasks over none beyond a margin b, (...) [nats].

    log(1 + exp(L - b)) - log(1 + exp(-L - b)): L - b far above the margin b, L + b far below -b,
    nearly zero between them; L itself for a margin of zero.
    """
    above = np.logaddexp(0.0, np.asarray(log_factor) - margin)
    return above - np.logaddexp(0.0, -np.asarray(log_factor) - margin)
