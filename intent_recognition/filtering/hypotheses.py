# SPDX-License-Identifier: Apache-2.0
"""The grid of hypotheses: tasks by durations."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError
from intent_recognition.promp import TaskLibrary

N_SCALES = 15
"""Durations per task. Convention."""
SCALE_SPAN = 2.5
"""Reach of the durations to either side of the median, in standard deviations of the log duration.

Convention.
"""
DURATION_FREEDOM = 4.0
"""Degrees of freedom of the log duration's Student prior: new people are often slower or faster
than any demonstration (docs/decisions/one_filter.md)."""


class Hypotheses(NamedTuple):
    """The bank's grid: K + 1 tasks (none last) by S durations, flattened task by task; B of them.

    Attributes:
        n_scales: S.
        duration_s: duration of the whole interaction under each hypothesis, (B,).
        log_prior: log prior probability of each, (B,); sums to one as probabilities.
        duration_evidence: exponent of the evidence in the posterior of the duration.
        none_margin: evidence that a known task must have over none before it counts, in nats.
    """

    n_scales: int
    duration_s: NDArray[np.float64]
    log_prior: NDArray[np.float64]
    duration_evidence: float = 1.0
    none_margin: float = 0.0

    @property
    def log_task_prior(self) -> NDArray[np.float64]:
        """Log prior probability of each task and none, (K + 1,)."""
        return np.logaddexp.reduce(self.log_prior.reshape(-1, self.n_scales), axis=1)

    def durations(
        self, task: int, log_evidence: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Durations of a task, or none, and their posterior probabilities, (S,) each.

        Args:
            task: its number.
            log_evidence: of the task's hypotheses, (S,).
        """
        grid = slice(task * self.n_scales, (task + 1) * self.n_scales)
        log_prior = self.log_prior[grid]
        if not np.any(np.isfinite(log_prior)):  # an impossible task can still be asked for
            log_prior = np.zeros_like(log_prior)
        log_weight = log_prior + self.duration_evidence * log_evidence
        weight = np.exp(log_weight - log_weight.max())
        return self.duration_s[grid], weight / weight.sum()

    def phase(self, elapsed_s: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase of each hypothesis so long after onset, in [0, 1]: (..., B)."""
        phase = np.asarray(elapsed_s)[..., None] / self.duration_s
        return np.minimum(np.maximum(phase, 0.0), 1.0)

    def phase_rate(self, elapsed_s: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Phase per second so long after onset, zero before it and after the end: (..., B)."""
        phase = np.asarray(elapsed_s)[..., None] / self.duration_s
        return np.where((phase >= 0.0) & (phase <= 1.0), 1.0 / self.duration_s, 0.0)


def make_hypotheses(
    library: TaskLibrary, task_prior: NDArray[np.float64] | None = None, n_scales: int = N_SCALES
) -> Hypotheses:
    """Cover each task's timing prior by durations evenly spaced in their logarithm.

    Args:
        library: the learned tasks.
        task_prior: p(s) of the K tasks, summing to one; the library's own when None.
        n_scales: durations per task, at least 1.

    Raises:
        ArgumentError: the prior is not one over K tasks, or there is no duration.
    """
    prior = library.task_prior if task_prior is None else np.asarray(task_prior)
    n_tasks = library.n_tasks
    if prior.shape != (n_tasks,) or not (np.all(prior >= 0) and abs(prior.sum() - 1.0) < 1e-6):
        expected, cure = f"{n_tasks} probabilities that sum to one", "Divide them by their sum."
        raise ArgumentError.about("task_prior", expected, prior, cure)
    if n_scales < 1:
        raise ArgumentError.about("n_scales", "1 or more", n_scales, f"Try {N_SCALES}.")
    offsets, log_weight = duration_offsets(n_scales)
    mean = np.r_[library.log_duration_mean, library.none_log_duration[0]]
    std = np.r_[library.log_duration_std, library.none_log_duration[1]]
    duration = np.exp(mean[:, None] + std[:, None] * offsets)
    with np.errstate(divide="ignore"):
        log_task = np.log(np.r_[prior * (1.0 - library.none_prior), library.none_prior])
    log_prior = (log_task[:, None] + log_weight).ravel()
    return Hypotheses(
        n_scales,
        duration.ravel(),
        log_prior,
        library.duration_evidence,
        library.none_margin,
    )


def duration_offsets(n_scales: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Durations of a task, in standard deviations of their logarithm, and log probabilities, (S,).

    Args:
        n_scales: S.
    """
    offsets = np.linspace(-SCALE_SPAN, SCALE_SPAN, n_scales) if n_scales > 1 else np.zeros(1)
    log_weight = -0.5 * (DURATION_FREEDOM + 1.0) * np.log1p(offsets**2 / DURATION_FREEDOM)
    return offsets, log_weight - np.logaddexp.reduce(log_weight)


def fixed_hypotheses(library: TaskLibrary, duration_s: float) -> Hypotheses:
    """One hypothesis per task, all of a known duration: the phase is known."""
    duration = np.full(library.n_tasks + 1, float(duration_s))
    return make_hypotheses(library, n_scales=1)._replace(duration_s=duration)
