# SPDX-License-Identifier: Apache-2.0
"""Tasks that cannot matter any more are not filtered, and the posterior stays what it is.

A task whose posterior is negligible is set aside; the observations since are kept. The last task,
`none`, never is, and tasks are measured by each other, because the evidence of none is not taken
as it is (`recognition.calibrated_none`). None of the kept observations can have been likelier
under a task than at the peak of its own noise, because an innovation covariance H S H^T + R is
never smaller than R. So

    log p(all so far | task)  <=  log p(until set aside | task) + sum of -1/2 log det(2 pi R),

and while even this bound is negligible, nothing is lost. When it is not negligible any more, some
of the kept observations are tried: with their exact joint density the bound is lower. If that is
not enough, all of them are replayed, and the task is where it would be had it never been set aside.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.gaussian import GaussianBatch, cholesky, log_normalizer

PRUNE_BELOW = 60.0
"""A task is set aside when its log posterior is so far below the likeliest task's."""
NEGLIGIBLE = 40.0
"""The bound on a task set aside stays so far below; e^-40 is 4e-18."""
SOON = 2.0
"""Bounds so close to that limit are looked at together with those that have reached it."""
CHECK_EVERY = 8
"""Observations between two looks for tasks to set aside."""
N_TRIED = 3
MAX_KEPT = 4096
"""So many kept observations are replayed at the latest: memory is bounded."""


class Step(NamedTuple):
    """One observation as the filter takes it.

    Attributes:
        elapsed_s: time since onset.
        dofs: (m,).
        derivative: whether velocities were observed.
        values: (m,).
        noise_covariance: (m, m), or one per hypothesis, (B, m, m).
    """

    elapsed_s: float
    dofs: np.ndarray
    derivative: bool
    values: np.ndarray
    noise_covariance: np.ndarray


Rows = Callable[[Step, np.ndarray | slice], np.ndarray]
"""Rows of the observation matrix, (n, m, N) or (n, 1, N), of a step under some hypotheses."""


class PrunedBank:
    """A bank whose negligible tasks are set aside.

    Args:
        bank: the filtered hypotheses, all active.
        log_prior: of each hypothesis, (B,).
        rows: makes the rows of a step.
        task_weight: factors that the posterior of the known tasks may be multiplied by (another
            p(s)), (T - 1,): what is negligible is so with and without them.
    """

    def __init__(
        self,
        bank: RunningBank,
        log_prior: np.ndarray,
        rows: Rows,
        task_weight: np.ndarray | None = None,
    ):
        self._bank, self._log_prior, self._rows = bank, log_prior, rows
        n_tasks, n_scales = bank.shape[:2]
        self._log_weight = np.zeros(n_tasks)
        if task_weight is not None:
            with np.errstate(divide="ignore"):
                self._log_weight[:-1] = np.log(task_weight)
        self._weighed_prior = log_prior + np.repeat(self._log_weight, n_scales)
        self._is_known = np.arange(len(log_prior)) < (n_tasks - 1) * bank.shape[1]
        self._aside = np.zeros(n_tasks, dtype=bool)
        self._since = np.zeros(n_tasks, dtype=int)
        self._kept: list[Step] = []
        self._peaks: list[float] = []  # log density of each kept step at most
        self._bound = np.full(n_tasks, -np.inf)  # on the log joint, less the peaks so far
        self._peak = 0.0
        self._until_check = CHECK_EVERY

    @property
    def pruned_tasks(self) -> np.ndarray:
        """Numbers of the tasks that are set aside."""
        return np.flatnonzero(self._aside)

    @property
    def log_evidence(self) -> np.ndarray:
        """Of all hypotheses, (B,); of those set aside, a bound it does not exceed."""
        evidence = self._bank.log_evidence
        if self._kept:
            n_scales = self._bank.shape[1]
            joint = self._log_joint(evidence)
            aside = self._aside & np.isfinite(joint)
            lift = self._bound[aside] + self._peak - joint[aside]
            evidence.reshape(-1, n_scales)[aside] += lift[:, None]
        return evidence

    def condition(self, step: Step) -> None:
        """Condition the active tasks on one observation, and see to the others."""
        _condition(self._bank, self._rows, step)
        if self._aside.any():
            peak = _peak(step.noise_covariance)
            self._kept.append(step)
            self._peaks.append(peak)
            self._peak += peak
            self._take_back_what_may_matter()
        self._until_check -= 1
        if self._until_check <= 0:
            self._until_check = CHECK_EVERY
            self._set_aside_what_is_negligible()

    def restore(self, tasks: np.ndarray | None = None) -> None:
        """Bring tasks (all of them when None) to where they would be had they been filtered."""
        tasks = self.pruned_tasks if tasks is None else tasks
        for since in np.unique(self._since[tasks]):
            group = tasks[self._since[tasks] == since]
            blocks = self._bank.gather(group)
            density = self._log_density(blocks, group, self._kept[since:])
            for block in blocks:
                block.apply_downdates()
            self._bank.activate(group, density)
        self._aside[tasks] = False
        self._bound[tasks] = -np.inf
        if not self._aside.any():
            self._kept, self._peaks, self._peak = [], [], 0.0

    def _log_density(
        self, blocks: list[GaussianBatch], tasks: np.ndarray, steps: list[Step]
    ) -> np.ndarray:
        """Condition the blocks of some tasks on steps: their joint log density, (n S,)."""
        n_scales = self._bank.shape[1]
        index = (tasks[:, None] * n_scales + np.arange(n_scales)).ravel()
        density, first = np.zeros(len(index)), 0
        for block in blocks:
            some = slice(first, first + len(block.mean))
            for step in steps:
                rows = self._rows(step, index[some])
                noise = _of(step.noise_covariance, index[some])
                density[some] += block.condition(step.dofs, rows, step.values, noise)
            first = some.stop
        return density

    def _limits(self) -> np.ndarray:
        """What a task's log joint is to be compared with: that of the likeliest active task, (T,).

        Under the weighed posterior, too: the lower of the two.
        """
        active, evidence = self._bank.active, self._bank.active_evidence
        plain, weighed = (
            np.max(prior[active] + evidence, where=self._is_known[active], initial=-np.inf)
            for prior in (self._log_prior, self._weighed_prior)
        )
        return np.minimum(plain, weighed - self._log_weight)

    def _take_back_what_may_matter(self) -> None:
        if len(self._kept) >= MAX_KEPT:
            self.restore()
            return
        excess = self._bound + self._peak - self._limits()
        if np.max(excess, where=self._aside, initial=-np.inf) > -NEGLIGIBLE:
            self._lower_bounds(np.flatnonzero(self._aside & (excess > -NEGLIGIBLE - SOON)))
            excess = self._bound + self._peak - self._limits()
            self.restore(np.flatnonzero(self._aside & (excess > -NEGLIGIBLE - SOON)))

    def _lower_bounds(self, tasks: np.ndarray) -> None:
        """Replace the peaks of a few kept steps by what these have in truth."""
        n_scales = self._bank.shape[1]
        first, last = int(np.max(self._since[tasks])), len(self._kept) - 1
        chosen = np.unique(np.linspace(first, last, N_TRIED).round().astype(int))
        density = self._log_density(
            self._bank.copies(tasks), tasks, [self._kept[k] for k in chosen]
        )
        evidence = self._bank.log_evidence.reshape(-1, n_scales)[tasks]
        tried = self._log_prior.reshape(-1, n_scales)[tasks] + evidence
        tried += density.reshape(-1, n_scales)
        peaks = np.append(np.cumsum(self._peaks[::-1])[::-1], 0.0)  # from each step on
        others = peaks[self._since[tasks]] - sum(self._peaks[k] for k in chosen)
        bound = np.logaddexp.reduce(tried, axis=1) + others - self._peak
        self._bound[tasks] = np.minimum(self._bound[tasks], bound)

    def _set_aside_what_is_negligible(self) -> None:
        joint = self._log_joint(self._bank.log_evidence)
        negligible = ~self._aside & (joint < self._limits() - PRUNE_BELOW)
        tasks = np.flatnonzero(negligible[:-1])
        if len(tasks):
            self._bank.prune(tasks)
            self._aside[tasks] = True
            self._since[tasks] = len(self._kept)
            self._bound[tasks] = joint[tasks] - self._peak

    def _log_joint(self, log_evidence: np.ndarray) -> np.ndarray:
        """Log prior and evidence of each task, durations summed out, (T,)."""
        joint = (self._log_prior + log_evidence).reshape(-1, self._bank.shape[1])
        return np.logaddexp.reduce(joint, axis=1)


def _condition(bank: RunningBank, rows: Rows, step: Step) -> None:
    active = bank.active
    noise = _of(step.noise_covariance, active)
    bank.condition(step.dofs, rows(step, active), step.values, noise)


def _of(noise_covariance: np.ndarray, hypotheses: np.ndarray | slice) -> np.ndarray:
    return noise_covariance if noise_covariance.ndim == 2 else noise_covariance[hypotheses]


def _peak(noise_covariance: np.ndarray) -> float:
    """Log density of an observation at most, whatever the hypothesis."""
    return float(np.max(-log_normalizer(cholesky(noise_covariance, name="noise covariance"))))
