# SPDX-License-Identifier: Apache-2.0
"""Pruning is lag: tasks of negligible posterior stop being filtered, and catch up when they matter.

The measurements since are kept. The task `none` never lags, and tasks are compared with each other
only, because the evidence of none counts beyond a margin only. A kept measurement cannot be more
probable under any task than at the peak of its own noise, because an innovation covariance
H S H^T + R is never smaller than R. So

    log p(all so far | task)  <=  log p(until it lagged | task) + sum of -1/2 log det(2 pi R),

and while this bound is negligible, so is the task. When it is not any more, the exact joint density
of some kept measurements lowers the bound. If that is not enough, the task catches up to the state
it would have had. With phase deviations, which are filtered approximately, or Student evidence that
lowered bound is approximate too: measured, a few nats off at most, while `NEGLIGIBLE_BELOW` is 40.
"""

from math import inf

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.table import HypothesisTable
from intent_recognition.gaussian import cholesky, student_log_density

PRUNE_FROM = 128
"""Fewer hypotheses are never pruned.

Measured: fewer are filtered in less time than it takes to choose among them (docs/speed.md).
"""
PRUNE_BELOW = 60.0
"""A task is pruned when its log posterior is this far below the most probable task's.

Convention: above `NEGLIGIBLE_BELOW` by enough that few tasks catch up soon after.
"""
NEGLIGIBLE_BELOW = 40.0
"""The bound on a pruned task's log posterior stays this far below the most probable task's.

Convention: e^-40 = 4e-18 is less than the rounding of a probability.
"""
CATCH_UP_MARGIN = 2.0
"""Pruned tasks this close to `NEGLIGIBLE_BELOW` are examined with those that reached it.

Convention: tasks that catch up together do so in one batch.
"""
PRUNE_EVERY = 8
"""Observations between two searches for tasks to prune. Convention."""
N_EXACT = 3
"""Kept measurements whose exact joint density lowers the bound of a pruned task. Convention."""
MAX_KEPT = 4096
"""Kept measurements after which all pruned tasks catch up: it bounds the memory. Convention."""


class Pruning:
    """Conditions a table of the grid's hypotheses, negligible tasks later than others.

    Args:
        table: hypotheses of the onset, task by task.
        model: makes the rows of measurements.
        grid: what they were made from.
        task_weight: factors that the posterior of the known tasks may be multiplied by (another
            p(s)), (K,): what is negligible is so with and without them.
        prune: False filters all tasks always.

    Attributes:
        lagging: which tasks are pruned, (K + 1,).
    """

    def __init__(
        self,
        table: HypothesisTable,
        model: ObservationModel,
        grid: PriorGrid,
        task_weight: NDArray[np.float64] | None = None,
        *,
        prune: bool = True,
    ):
        self._table, self._model, self._n_scales = table, model, grid.n_scales
        self._prunes = prune and table.n >= PRUNE_FROM
        n_tasks = table.n // grid.n_scales
        self._log_weight = np.zeros(n_tasks)
        if task_weight is not None:
            with np.errstate(divide="ignore"):
                self._log_weight[:-1] = np.log(task_weight)
        self.lagging = np.zeros(n_tasks, dtype=bool)
        self._since = np.zeros(n_tasks, dtype=int)
        self._kept: list[Measurement] = []
        self._peaks: list[float] = []  # highest log density of each kept measurement
        self._bound = np.full(n_tasks, -np.inf)  # on the log joint, less the peaks so far
        self._peak = 0.0
        self._until_check = PRUNE_EVERY

    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Of all hypotheses, (B,); of those that lag, an upper bound."""
        evidence = self._table.rows["log_evidence"].copy()
        if self._kept:
            joint = self._log_joint()
            pruned = self.lagging & np.isfinite(joint)
            lift = self._bound[pruned] + self._peak - joint[pruned]
            evidence.reshape(-1, self._n_scales)[pruned] += lift[:, None]
        return evidence

    def condition(self, measurement: Measurement) -> None:
        """Condition the tasks that do not lag on a measurement; choose anew which do."""
        if not self._prunes:
            self._table.condition(measurement, self._model)
            return
        self._table.condition(measurement, self._model, self._rows_of(~self.lagging))
        if self.lagging.any():
            peak = _peak(measurement.noise_covariance, measurement.freedom)
            self._kept.append(measurement)
            self._peaks.append(peak)
            self._peak += peak
            self._catch_up_what_may_matter()
        self._until_check -= 1
        if self._until_check <= 0:
            self._until_check = PRUNE_EVERY
            self._prune_what_is_negligible()

    def catch_up(self, tasks: NDArray[np.bool_] | None = None) -> None:
        """Bring tasks (all when None) to where they would be had they never lagged."""
        tasks = self.lagging.copy() if tasks is None else tasks & self.lagging
        if not tasks.any():
            return
        for k in range(int(self._since[tasks].min()), len(self._kept)):
            index = self._rows_of(tasks & (self._since <= k))
            self._table.condition(self._kept[k], self._model, index)
        self.lagging[tasks] = False
        self._bound[tasks] = -np.inf
        if not self.lagging.any():
            self._kept, self._peaks, self._peak = [], [], 0.0

    def _rows_of(self, tasks: NDArray[np.bool_]) -> NDArray[np.int64]:
        return np.flatnonzero(np.repeat(tasks, self._n_scales))

    def _limits(self) -> NDArray[np.float64]:
        """Log joint of the most probable known hypothesis, which each task is compared with, (T,).

        The lower of two: under the posterior as it is, and multiplied by the task weights.
        """
        joint = np.max(self._table.log_joint.reshape(-1, self._n_scales), axis=1)[:-1]
        joint = np.where(self.lagging[:-1], -np.inf, joint)
        weighed = np.max(joint + self._log_weight[:-1])
        return np.minimum(np.max(joint), weighed - self._log_weight)

    def _catch_up_what_may_matter(self) -> None:
        if len(self._kept) >= MAX_KEPT:
            self.catch_up()
            return
        excess = self._bound + self._peak - self._limits()
        if np.max(excess, where=self.lagging, initial=-np.inf) > -NEGLIGIBLE_BELOW:
            near = self.lagging & (excess > -NEGLIGIBLE_BELOW - CATCH_UP_MARGIN)
            self._lower_bounds(near)
            excess = self._bound + self._peak - self._limits()
            self.catch_up(self.lagging & (excess > -NEGLIGIBLE_BELOW - CATCH_UP_MARGIN))

    def _lower_bounds(self, tasks: NDArray[np.bool_]) -> None:
        """Replace the peaks of a few kept measurements by their exact joint density."""
        first, last = int(np.max(self._since[tasks])), len(self._kept) - 1
        chosen = np.unique(np.linspace(first, last, N_EXACT).round().astype(int))
        part, last_s = self._table.part(self._rows_of(tasks)), -inf
        for one in (self._kept[k] for k in chosen):
            interval_s = max(one.elapsed_s - last_s, 0.0)
            part.condition(one._replace(interval_s=interval_s), self._model)
            last_s = one.elapsed_s
        joint = np.logaddexp.reduce(part.log_joint.reshape(-1, self._n_scales), axis=1)
        peaks = np.append(np.cumsum(self._peaks[::-1])[::-1], 0.0)  # from each measurement on
        others = peaks[self._since[tasks]] - sum(self._peaks[k] for k in chosen)
        self._bound[tasks] = np.minimum(self._bound[tasks], joint + others - self._peak)

    def _prune_what_is_negligible(self) -> None:
        joint = self._log_joint()
        negligible = ~self.lagging & (joint < self._limits() - PRUNE_BELOW)
        negligible[-1] = False
        self.lagging |= negligible
        self._since[negligible] = len(self._kept)
        self._bound[negligible] = joint[negligible] - self._peak

    def _log_joint(self) -> NDArray[np.float64]:
        """Log prior and evidence of each task, durations summed out, (T,)."""
        return np.logaddexp.reduce(self._table.log_joint.reshape(-1, self._n_scales), axis=1)


def _peak(noise_covariance: NDArray[np.float64], degrees_of_freedom: float) -> float:
    """Highest log density that a measurement can have under any hypothesis."""
    factor = cholesky(noise_covariance, name="noise covariance")
    log_scale = np.log(np.diagonal(factor)).sum()
    m = len(noise_covariance)
    return float(student_log_density(np.zeros(()), log_scale, m, degrees_of_freedom))
