# SPDX-License-Identifier: Apache-2.0
"""The filter of one movement: from observations to evidence and predicted trajectories.

An observation passes through the observation model into the bank of hypotheses, which gives the
evidence of every task and duration, and is kept for the task filters, which predict trajectories
when asked.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.bank import FilterBank
from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.filtering.pruning import PrunedBank
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.filtering.task_filter import TaskFilters
from intent_recognition.gaussian import Gaussian
from intent_recognition.promp import ControlGrid, TaskLibrary
from intent_recognition.signals import Observation

PRUNE_FROM = 128
"""Fewer hypotheses are never pruned.

Measured: fewer are filtered in less time than it takes to choose among them (docs/speed.md).
"""


def make_memory(library: TaskLibrary, hypotheses: Hypotheses) -> RunningBank:
    """Memory for the filters of one movement after the other."""
    return RunningBank(*_shape(library, hypotheses))


def _shape(library: TaskLibrary, hypotheses: Hypotheses) -> tuple[int, int, int, int]:
    n_tasks = len(hypotheses.duration_s) // hypotheses.n_scales
    return n_tasks, hypotheses.n_scales, library.n_observed, library.basis.n_basis


class MovementFilter:
    """Filters every hypothesis over one movement, one observation after the other.

    Args:
        library: the learned tasks.
        hypotheses: the grid of tasks and durations.
        onset_ns: stamp from which phases count.
        initial: the bank at onset; None for the library's priors.
        memory: that of a filter which is not used any more; None for new memory.
        grids: those of `TaskFilters`, kept from movement to movement.
        prune: do not filter tasks whose posterior is negligible (`pruning`), when there are many.
        task_weight: what the posterior of the known tasks may be multiplied by, (K,); see there.

    Attributes:
        observation_model: what observations are to the filters.
        memory: the filtered hypotheses.
        task_filters: each task's filter for prediction.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: Hypotheses,
        onset_ns: int,
        *,
        initial: FilterBank | None = None,
        memory: RunningBank | None = None,
        grids: dict[int, ControlGrid] | None = None,
        prune: bool = False,
        task_weight: NDArray[np.float64] | None = None,
    ):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        if memory is None or memory.shape != _shape(library, hypotheses):
            memory = make_memory(library, hypotheses)
        self.memory = memory
        if initial is None:
            self.memory.start(library.observed_mean, library.observed_covariance)
        else:
            self.memory.start(*initial)
        self.observation_model = ObservationModel(library, hypotheses, onset_ns)
        prune = prune and len(hypotheses.duration_s) >= PRUNE_FROM
        self._bank = PrunedBank(memory, self.observation_model, task_weight, prune=prune)
        self.task_filters = TaskFilters(self.observation_model, grids)

    def observe(self, observation: Observation) -> None:
        """Condition every hypothesis on an observation.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        self._bank.condition(self.observation_model.for_recognition(observation))
        self.task_filters.observe(observation)

    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Log density of all observations under each hypothesis, (B,); a bound where pruned."""
        return self._bank.log_evidence

    @property
    def pruned_tasks(self) -> NDArray[np.int64]:
        """Numbers of the tasks that are pruned for now."""
        return self._bank.pruned_tasks

    @property
    def bank(self) -> FilterBank:
        """A copy of all hypotheses, pruned tasks restored."""
        return self._copy(np.arange(len(self.hypotheses.duration_s)))

    def task(self, task: int) -> FilterBank:
        """A copy of the hypotheses of one task, restored if it was pruned: (S, ...)."""
        n_scales = self.hypotheses.n_scales
        return self._copy(np.arange(task * n_scales, (task + 1) * n_scales))

    def moments(self, task: int, scale_weights: NDArray[np.float64]) -> Gaussian:
        """Observed weights given a task, durations marginalised by matching moments.

        Args:
            task: number of the task.
            scale_weights: p(duration | task), (S,).
        """
        self._restore(np.array([task]))
        return Gaussian(*self.memory.moments(task, scale_weights))

    def _copy(self, index: NDArray[np.int64]) -> FilterBank:
        self._restore(np.unique(index // self.hypotheses.n_scales))
        mean, covariance = self.memory.distributions(index)
        return FilterBank(mean, covariance, self.log_evidence[index])

    def _restore(self, tasks: NDArray[np.int64]) -> None:
        self._bank.restore(np.intersect1d(tasks, self._bank.pruned_tasks))


def run_bank(
    library: TaskLibrary,
    hypotheses: Hypotheses,
    bank: FilterBank,
    observations: Iterable[Observation],
    onset_ns: int,
) -> FilterBank:
    """Condition a bank on a stretch of observations that begins at onset."""
    run = MovementFilter(library, hypotheses, onset_ns, initial=bank)
    for observation in observations:
        run.observe(observation)
    return run.bank
