# SPDX-License-Identifier: Apache-2.0
"""The prior grid of tasks and durations: the hypotheses at the onset of a movement."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, check_whole
from intent_recognition.gaussian import log_sum
from intent_recognition.promp import STUDENT_FREEDOM, TaskLibrary

N_SCALES = 15
"""Number of durations per task (docs/prediction.md)."""


class PriorGrid(NamedTuple):
    """B = (K + 1) S hypotheses: K + 1 tasks (none last) by S durations, flattened task by task."""

    n_scales: int  # number of durations per task, S
    duration_s: Floats  # duration of the whole interaction under each hypothesis, (B,)
    log_prior: Floats  # log prior probabilities of the hypotheses, which sum to one, (B,)
    duration_evidence: float = 1.0  # exponent of the evidence in the posterior of the duration
    task_evidence: float = 1.0  # exponent of the evidence of the tasks against each other
    # evidence [nats] of the known tasks against none, either way, that does not count
    none_margin: float = 0.0

    @property
    def log_task_prior(self) -> Floats:
        """Log prior probability of each task and none, (K + 1,)."""
        return self.log_task_joint(0.0)

    def log_task_joint(self, log_evidence: Floats | float) -> Floats:
        """Log joint of the tasks and none, (K + 1,), from the hypotheses' log evidence (B,)."""
        joint = (self.log_prior + log_evidence).reshape(-1, self.n_scales)
        return log_sum(joint)

    def duration_weights(self, log_evidence: Floats) -> Floats:
        """Posterior probabilities of the durations given the task, (K + 1, S), from evidence (B,).

        A task of prior zero has them too, since a caller may ask for its prediction.
        """
        log_prior = self.log_prior.reshape(-1, self.n_scales)
        possible = np.isfinite(log_prior).any(axis=1, keepdims=True)
        tempered = np.where(possible, log_prior, 0.0)
        tempered = tempered + self.duration_evidence * log_evidence.reshape(log_prior.shape)
        best = tempered.max(axis=1, keepdims=True)
        weight = np.exp(np.where(np.isfinite(best), tempered - np.nan_to_num(best), 0.0))
        return weight / weight.sum(axis=1, keepdims=True)


def make_prior_grid(
    library: TaskLibrary, task_prior: Floats | None = None, n_scales: int = N_SCALES
) -> PriorGrid:
    """Cover each task's timing prior by durations evenly spaced in their logarithm.

    Args:
        library: the learned tasks.
        task_prior: probabilities p(s) of the K tasks; None takes the library's.
        n_scales: number of durations per task, at least 1.

    Raises:
        ArgumentError: the prior is not K probabilities that sum to one, or `n_scales` is below 1.
    """
    prior = library.task_prior if task_prior is None else np.asarray(task_prior)
    n_tasks = library.n_tasks
    if prior.shape != (n_tasks,) or not (np.all(prior >= 0) and abs(prior.sum() - 1.0) < 1e-6):
        expected, cure = f"{n_tasks} probabilities that sum to one", "Divide them by their sum."
        raise ArgumentError.about("task_prior", expected, prior, cure)
    check_whole("n_scales", n_scales, 1, f"Try {N_SCALES}.")
    offsets, log_weight = duration_offsets(n_scales)
    mean, std = log_durations(library)
    with np.errstate(divide="ignore"):
        log_task = np.log(np.r_[prior * (1.0 - library.none_prior), library.none_prior])
    return PriorGrid(
        n_scales,
        np.exp(mean[:, None] + std[:, None] * offsets).ravel(),
        (log_task[:, None] + log_weight).ravel(),
        library.duration_evidence,
        library.task_evidence,
        library.none_margin,
    )


def fixed_prior_grid(library: TaskLibrary, duration_s: float) -> PriorGrid:
    """Grid of one hypothesis per task, all with the same known duration, so the phase is known."""
    duration = np.full(library.n_tasks + 1, float(duration_s))
    return make_prior_grid(library, n_scales=1)._replace(duration_s=duration)


def log_durations(library: TaskLibrary) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the tasks' and none's log duration, (K + 1,) each."""
    none_mean, none_std = library.none_log_duration
    return np.r_[library.log_duration_mean, none_mean], np.r_[library.log_duration_std, none_std]


def duration_offsets(n_scales: int) -> tuple[Floats, Floats]:
    """Durations of a task, as standard deviations of log duration from the median (at most 2.5),
    and their log probabilities, (S,) each.
    """
    offsets = np.linspace(-2.5, 2.5, n_scales) if n_scales > 1 else np.zeros(1)
    log_weight = -0.5 * (STUDENT_FREEDOM + 1.0) * np.log1p(offsets**2 / STUDENT_FREEDOM)
    return offsets, log_weight - np.logaddexp.reduce(log_weight)
