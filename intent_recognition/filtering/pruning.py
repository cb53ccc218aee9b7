# SPDX-License-Identifier: Apache-2.0
"""Tasks of negligible posterior are not filtered, and the posterior stays what it is.

A task of negligible posterior is pruned: it keeps its state, and the measurements since are kept
for it. The task `none` is never pruned, and tasks are compared with each other only, because the
evidence of none counts beyond a margin only. A kept measurement cannot be more
probable under any task than at the peak of its own noise, because an innovation covariance
H S H^T + R is never smaller than R. So

    log p(all so far | task)  <=  log p(until pruned | task) + sum of -1/2 log det(2 pi R),

and while this bound is negligible, so is the task. When it is not any more, the exact joint density
of some kept measurements lowers the bound. If that is not enough, all of them are replayed: the
task is restored to the state it would have had. With phase deviations, which are filtered
approximately, or Student evidence that lowered bound is approximate too: measured, a few nats off
at most, while `NEGLIGIBLE_BELOW` is 40.
"""

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.deviation_history import DeviationHistory
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.running_bank import Block, RunningBank
from intent_recognition.gaussian import cholesky, student_log_density

PRUNE_BELOW = 60.0
"""A task is pruned when its log posterior is this far below the most probable task's.

Convention: above `NEGLIGIBLE_BELOW` by enough that few tasks are restored soon after.
"""
NEGLIGIBLE_BELOW = 40.0
"""The bound on a pruned task's log posterior stays this far below the most probable task's.

Convention: e^-40 = 4e-18 is less than the rounding of a probability.
"""
RESTORE_MARGIN = 2.0
"""Pruned tasks this close to `NEGLIGIBLE_BELOW` are examined with those that reached it.

Convention: tasks restored together are replayed in one batch.
"""
PRUNE_EVERY = 8
"""Observations between two searches for tasks to prune. Convention."""
N_EXACT = 3
"""Kept measurements whose exact joint density lowers the bound of a pruned task. Convention."""
MAX_KEPT = 4096
"""Kept measurements after which all pruned tasks are restored: it bounds the memory. Convention."""


class PrunedBank:
    """A bank whose negligible tasks are pruned.

    Args:
        bank: the filtered hypotheses, all active.
        model: makes the rows of measurements.
        task_weight: factors that the posterior of the known tasks may be multiplied by (another
            p(s)), (T - 1,): what is negligible is so with and without them.
        prune: False filters all tasks always.

    Attributes:
        history: the phase deviations of all hypotheses after each measurement.
    """

    def __init__(
        self,
        bank: RunningBank,
        model: ObservationModel,
        task_weight: NDArray[np.float64] | None = None,
        *,
        prune: bool = True,
    ):
        self._bank, self._model, self._prunes = bank, model, prune
        self._log_prior = log_prior = model.hypotheses.log_prior
        n_tasks, n_scales = bank.shape[:2]
        self._log_weight = np.zeros(n_tasks)
        if task_weight is not None:
            with np.errstate(divide="ignore"):
                self._log_weight[:-1] = np.log(task_weight)
        self._weighed_prior = log_prior + np.repeat(self._log_weight, n_scales)
        self._is_known = np.arange(len(log_prior)) < (n_tasks - 1) * n_scales
        self._is_pruned = np.zeros(n_tasks, dtype=bool)
        self._since = np.zeros(n_tasks, dtype=int)
        self._kept: list[Measurement] = []
        self._peaks: list[float] = []  # highest log density of each kept measurement
        self._bound = np.full(n_tasks, -np.inf)  # on the log joint, less the peaks so far
        self._peak = 0.0
        self._until_check = PRUNE_EVERY
        self.history = DeviationHistory()

    @property
    def pruned_tasks(self) -> NDArray[np.int64]:
        """Numbers of the tasks that are pruned."""
        return np.flatnonzero(self._is_pruned)

    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Of all hypotheses, (B,); of those pruned, an upper bound."""
        evidence = self._bank.log_evidence
        if self._kept:
            n_scales = self._bank.shape[1]
            joint = self._log_joint(evidence)
            pruned = self._is_pruned & np.isfinite(joint)
            lift = self._bound[pruned] + self._peak - joint[pruned]
            evidence.reshape(-1, n_scales)[pruned] += lift[:, None]
        return evidence

    def condition(self, measurement: Measurement) -> None:
        """Condition the active tasks on a measurement; restore and prune tasks as needed."""
        step = self._model.linear(measurement, self._bank.active)
        deviation, likelihood = self._bank.condition(step)
        if deviation.shape[1] > 1:
            active = self._bank.active_hypotheses.copy()
            self.history.add(measurement.elapsed_s, active, deviation.copy(), likelihood)
        if not self._prunes:
            return
        if self._is_pruned.any():
            peak = _peak(measurement.noise_covariance, step.degrees_of_freedom)
            self._kept.append(measurement)
            self._peaks.append(peak)
            self._peak += peak
            self._restore_what_may_matter()
        self._until_check -= 1
        if self._until_check <= 0:
            self._until_check = PRUNE_EVERY
            self._prune_what_is_negligible()

    def restore(self, tasks: NDArray[np.int64] | None = None) -> None:
        """Bring tasks (all of them when None) to where they would be had they been filtered."""
        tasks = self.pruned_tasks if tasks is None else tasks
        for since in np.unique(self._since[tasks]):
            group = tasks[self._since[tasks] == since]
            block = self._bank.gather(group)
            density = self._log_density(block, group, self._kept[since:], self.history)
            self._bank.activate(group, density)
        self._is_pruned[tasks] = False
        self._bound[tasks] = -np.inf
        if not self._is_pruned.any():
            self._kept, self._peaks, self._peak = [], [], 0.0

    def _log_density(
        self,
        block: Block,
        tasks: NDArray[np.int64],
        measurements: Sequence[Measurement],
        history: DeviationHistory | None = None,
    ) -> NDArray[np.float64]:
        """Condition some tasks on measurements: joint log density, (n S,)."""
        n_scales = self._bank.shape[1]
        index = (tasks[:, None] * n_scales + np.arange(n_scales)).ravel()
        density, (weights, deviation) = np.zeros(len(index)), block
        for one in measurements:
            added, likelihood = weights.condition(self._model.linear(one, index), deviation)
            density += added
            if history is not None and deviation.shape[1] > 1:
                history.add(one.elapsed_s, index, deviation.copy(), likelihood)
        return density

    def _limits(self) -> NDArray[np.float64]:
        """Log joint of the most probable active task, which each task is compared with, (T,).

        The lower of two: under the posterior as it is, and multiplied by the task weights.
        """
        active, evidence = self._bank.active, self._bank.active_evidence
        plain, weighed = (
            np.max(prior[active] + evidence, where=self._is_known[active], initial=-np.inf)
            for prior in (self._log_prior, self._weighed_prior)
        )
        return np.minimum(plain, weighed - self._log_weight)

    def _restore_what_may_matter(self) -> None:
        if len(self._kept) >= MAX_KEPT:
            self.restore()
            return
        excess = self._bound + self._peak - self._limits()
        if np.max(excess, where=self._is_pruned, initial=-np.inf) > -NEGLIGIBLE_BELOW:
            self._lower_bounds(
                np.flatnonzero(self._is_pruned & (excess > -NEGLIGIBLE_BELOW - RESTORE_MARGIN))
            )
            excess = self._bound + self._peak - self._limits()
            self.restore(
                np.flatnonzero(self._is_pruned & (excess > -NEGLIGIBLE_BELOW - RESTORE_MARGIN))
            )

    def _lower_bounds(self, tasks: NDArray[np.int64]) -> None:
        """Replace the peaks of a few kept measurements by their exact joint density."""
        n_scales = self._bank.shape[1]
        first, last = int(np.max(self._since[tasks])), len(self._kept) - 1
        chosen = np.unique(np.linspace(first, last, N_EXACT).round().astype(int))
        exact, last_s = [], None
        for one in (self._kept[k] for k in chosen):
            interval_s = inf if last_s is None else max(one.elapsed_s - last_s, 0.0)
            exact.append(one._replace(interval_s=interval_s))
            last_s = one.elapsed_s
        density = self._log_density(self._bank.copies(tasks), tasks, exact)
        evidence = self._bank.log_evidence.reshape(-1, n_scales)[tasks]
        joint = self._log_prior.reshape(-1, n_scales)[tasks] + evidence
        joint += density.reshape(-1, n_scales)
        peaks = np.append(np.cumsum(self._peaks[::-1])[::-1], 0.0)  # from each measurement on
        others = peaks[self._since[tasks]] - sum(self._peaks[k] for k in chosen)
        bound = np.logaddexp.reduce(joint, axis=1) + others - self._peak
        self._bound[tasks] = np.minimum(self._bound[tasks], bound)

    def _prune_what_is_negligible(self) -> None:
        joint = self._log_joint(self._bank.log_evidence)
        negligible = ~self._is_pruned & (joint < self._limits() - PRUNE_BELOW)
        tasks = np.flatnonzero(negligible[:-1])
        if len(tasks):
            self._bank.prune(tasks)
            self._is_pruned[tasks] = True
            self._since[tasks] = len(self._kept)
            self._bound[tasks] = joint[tasks] - self._peak

    def _log_joint(self, log_evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log prior and evidence of each task, durations summed out, (T,)."""
        joint = (self._log_prior + log_evidence).reshape(-1, self._bank.shape[1])
        return np.logaddexp.reduce(joint, axis=1)


def _peak(noise_covariance: NDArray[np.float64], degrees_of_freedom: float) -> float:
    """Highest log density that a measurement can have under any hypothesis."""
    factor = cholesky(noise_covariance, name="noise covariance")
    log_scale = np.log(np.diagonal(factor)).sum()
    m = len(noise_covariance)
    return float(student_log_density(np.zeros(()), log_scale, m, degrees_of_freedom))
