# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every (task, phase) hypothesis at once (Maeda et al. 2014, Eq. 6-11).

Only the observed block of the weights is filtered: observations do not touch the rest, which is
recovered by regression when asked for (`prediction.py`). No loop runs over hypotheses. These are
values; what filters a movement under way is `running_bank.py`.
"""

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.promp.filter_block import FilterBlock, make_state
from intent_recognition.promp.library import READ_AS_IT_IS, TaskLibrary

N_SCALES = 15
SCALE_SPAN = 2.5


class Hypotheses(NamedTuple):
    """The bank's grid: K + 1 tasks (none last) by S durations, flattened task by task; B of them.

    Attributes:
        n_scales: S.
        duration_s: duration of the whole interaction under each hypothesis, (B,).
        log_prior: log prior probability of each, (B,); sums to one as probabilities.
        duration_evidence: exponent of the evidence in the posterior of the duration.
        none_calibration: how the evidence against none is read; see `none_calibration`.
    """

    n_scales: int
    duration_s: np.ndarray
    log_prior: np.ndarray
    duration_evidence: float = 1.0
    none_calibration: Sequence[float] = READ_AS_IT_IS

    @property
    def log_task_prior(self) -> np.ndarray:
        """Log prior probability of each task and none, (K + 1,)."""
        return np.logaddexp.reduce(self.log_prior.reshape(-1, self.n_scales), axis=1)

    def phase(self, elapsed_s: float | np.ndarray) -> np.ndarray:
        """Phase of each hypothesis so long after onset, in [0, 1]: (..., B)."""
        phase = np.asarray(elapsed_s)[..., None] / self.duration_s
        return np.minimum(np.maximum(phase, 0.0), 1.0)

    def phase_rate(self, elapsed_s: float | np.ndarray) -> np.ndarray:
        """Phase per second so long after onset, zero before it and after the end: (..., B)."""
        phase = np.asarray(elapsed_s)[..., None] / self.duration_s
        return np.where((phase >= 0.0) & (phase <= 1.0), 1.0 / self.duration_s, 0.0)


class FilterBank(NamedTuple):
    """Filtered observed weights of B hypotheses.

    Attributes:
        mean: (B, P N).
        covariance: (B, P N, P N).
        log_evidence: log density of all observations so far under each hypothesis, (B,).
    """

    mean: np.ndarray
    covariance: np.ndarray
    log_evidence: np.ndarray


def make_hypotheses(
    library: TaskLibrary, task_prior: np.ndarray | None = None, n_scales: int = N_SCALES
) -> Hypotheses:
    """Cover each task's timing prior by durations evenly spaced in their logarithm.

    Args:
        library: the learned tasks.
        task_prior: p(s) of the K tasks, summing to one; the library's own when None.
        n_scales: durations per task.
    """
    prior = library.task_prior if task_prior is None else task_prior
    offsets = np.linspace(-SCALE_SPAN, SCALE_SPAN, n_scales) if n_scales > 1 else np.zeros(1)
    log_weight = -0.5 * offsets**2
    log_weight -= np.logaddexp.reduce(log_weight)
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
        library.none_calibration,
    )


def fixed_hypotheses(library: TaskLibrary, duration_s: float) -> Hypotheses:
    """One hypothesis per task, all of a known duration: the phase is known."""
    with np.errstate(divide="ignore"):
        log_prior = np.log(
            np.r_[library.task_prior * (1.0 - library.none_prior), library.none_prior]
        )
    duration = np.full(library.n_tasks + 1, float(duration_s))
    return Hypotheses(1, duration, log_prior, none_calibration=library.none_calibration)


def start_bank(library: TaskLibrary, hypotheses: Hypotheses) -> FilterBank:
    """The bank before any observation."""
    repeat = hypotheses.n_scales
    return FilterBank(
        np.repeat(library.observed_mean, repeat, axis=0),
        np.repeat(library.observed_covariance, repeat, axis=0),
        np.zeros(len(hypotheses.duration_s)),
    )


def condition_bank(
    bank: FilterBank,
    dofs: np.ndarray,
    rows: np.ndarray,
    values: np.ndarray,
    noise_covariance: np.ndarray,
) -> FilterBank:
    """Condition every hypothesis on one observation of some DOFs; the argument is not changed.

    Args:
        bank: B hypotheses over P DOFs.
        dofs: index of the DOF behind each observed value, (m,); a DOF may come twice (position
            and velocity), and what is not observed has no entry.
        rows: row of the observation matrix within that DOF's block, (B, m, N) or (B, 1, N) for
            positions, whose row is the same for all DOFs.
        values: observed values, (m,).
        noise_covariance: (m, m) or one per hypothesis, (B, m, m), positive definite.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: a value is not finite, or an innovation covariance not positive definite.
    """
    check_observation(dofs, values, noise_covariance)
    n, n_basis = len(bank.mean), rows.shape[-1]
    rows = np.broadcast_to(rows, (n, *rows.shape[1:]))
    block = FilterBlock(make_state(bank.mean, bank.covariance, n_basis), n_basis)
    log_density = block.condition(dofs, rows, values, noise_covariance)
    block.fold()
    return FilterBank(block.mean, block.covariance, bank.log_evidence + log_density)


def check_observation(dofs: np.ndarray, values: np.ndarray, noise_covariance: np.ndarray) -> None:
    """Whether values and noise go with the DOFs.

    Raises:
        ShapeError: they do not.
        ArgumentError: a value is not finite.
    """
    m = len(dofs)
    if np.shape(values) != (m,) or np.shape(noise_covariance)[-2:] != (m, m):
        raise ShapeError(
            describe(
                "values, noise_covariance",
                f"shapes ({m},) and ({m}, {m}) for {m} observed values",
                f"{np.shape(values)} and {np.shape(noise_covariance)}",
                "Pass one value and one row and column of noise per entry of dofs.",
            )
        )
    if not isfinite(np.add.reduce(values)):
        raise ArgumentError(
            describe("values", "finite numbers", f"{values}", "Leave out what was not measured.")
        )
