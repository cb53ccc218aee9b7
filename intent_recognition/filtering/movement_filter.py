# SPDX-License-Identifier: Apache-2.0
"""The filter of one movement: one posterior over task, duration, phase deviation and weights.

An observation passes through the observation model into the bank of hypotheses. Task, progress and
both agents' trajectories are read off the same bank.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.filtered_weights import FilterBank
from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.pruning import PrunedBank
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.filtering.switching import SwitchedBelief, SwitchedHypotheses
from intent_recognition.filtering.task_prediction import TaskPrediction
from intent_recognition.promp import (
    ControlGrid,
    StartPosture,
    TaskLibrary,
    Trajectory,
    deviation_prior,
    largest_by_unit,
)
from intent_recognition.signals import Observation

UNLIKELY = 1e-3
"""Tasks so much less probable than the most probable one are left out of a mixture. Convention."""
PRUNE_FROM = 128
"""Fewer hypotheses are never pruned.

Measured: fewer are filtered in less time than it takes to choose among them (docs/speed.md).
"""


def make_memory(library: TaskLibrary, hypotheses: Hypotheses) -> RunningBank:
    """Memory for the filters of one movement after the other."""
    return RunningBank(*_shape(library, hypotheses))


def _shape(library: TaskLibrary, hypotheses: Hypotheses) -> tuple[int, int, int, int, int]:
    n_tasks = len(hypotheses.duration_s) // hypotheses.n_scales
    n_deviations = len(library.phase_deviation.grid)
    return n_tasks, hypotheses.n_scales, library.n_observed, library.basis.n_basis, n_deviations


class MovementFilter:
    """Filters every hypothesis over one movement, one observation after the other.

    Args:
        library: the learned tasks.
        hypotheses: the grid of tasks and durations.
        onset_ns: stamp from which phases count.
        memory: that of a filter which is not used any more; None for new memory.
        grids: the `ControlGrid` of tasks that had one; others are added.
        prune: do not filter tasks whose posterior is negligible (`pruning`), when there are many.
        task_weight: what the posterior of the known tasks may be multiplied by, (K,); see there.
        switched: memory of the hypotheses that are born on the way, when a person may turn to
            another task; None when the task is one from beginning to end.

    Attributes:
        observation_model: what observations are to the filter.
        memory: the filtered hypotheses.
        n_used: how many observations every hypothesis was conditioned on.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: Hypotheses,
        onset_ns: int,
        *,
        memory: RunningBank | None = None,
        grids: dict[int, ControlGrid] | None = None,
        prune: bool = False,
        task_weight: NDArray[np.float64] | None = None,
        switched: SwitchedHypotheses | None = None,
    ):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        if memory is None or memory.shape != _shape(library, hypotheses):
            memory = make_memory(library, hypotheses)
        self.memory = memory
        self.memory.start(
            library.observed_mean,
            library.observed_covariance,
            deviation_prior(library.phase_deviation),
        )
        self.observation_model = ObservationModel(library, hypotheses, onset_ns)
        prune = prune and len(hypotheses.duration_s) >= PRUNE_FROM
        self._bank = PrunedBank(memory, self.observation_model, task_weight, prune=prune)
        self._switched = switched
        if switched is not None:
            switched.start(hypotheses)
        self._grids = {} if grids is None else grids
        self.n_used, self._elapsed_s = 0, 0.0
        self._seen: list[Measurement] = []
        self._predictions: dict[int, TaskPrediction] = {}
        self._last: tuple[tuple[int, int, int], StartPosture | None, Trajectory] | None = None

    def observe(self, observation: Observation) -> None:
        """Condition every hypothesis on an observation, unless it follows too closely on the last.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        measurement = self.observation_model.measurement(observation)
        if measurement is None:
            return
        self._bank.condition(measurement)
        if self._switched is not None:
            self._switched.observe(measurement, self._bank.log_evidence, self.memory)
        self.n_used += 1
        self._elapsed_s = max(self._elapsed_s, measurement.elapsed_s)
        if not measurement.derivative:
            self._seen.append(measurement)
        self._predictions.clear()

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

    def prediction(self, task: int) -> TaskPrediction:
        """What the observations so far say about the movement, if it is of a task (or none)."""
        found = self._predictions.get(task)
        if found is None:
            found = self._predictions[task] = self._predict(task)
        return found

    def switched(self) -> SwitchedBelief | None:
        """What hypotheses that were born on the way make of task and timing; None without any."""
        if self._switched is None or not self.n_used:
            return None
        return self._switched.belief()

    def controlled(self, task: int, n_points: int, start: StartPosture | None = None) -> Trajectory:
        """The controlled agent's whole interaction under a task, as `TaskPrediction.controlled`."""
        asked = (task, n_points, self.n_used)
        if self._last is not None and self._last[0] == asked and self._last[1] is start:
            return self._last[2]
        if task not in self._grids:
            self._grids[task] = ControlGrid(self.library, task)
        trajectory = self.prediction(task).controlled(n_points, start, self._grids[task])
        self._last = asked, start, trajectory
        return trajectory

    def mixture_at(
        self,
        times_s: NDArray[np.float64],
        task_weights: NDArray[np.float64],
        start: StartPosture | list[StartPosture | None] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and standard deviation of the controlled agent over all tasks, (T, Q) each.

        Args:
            times_s: after onset, (T,).
            task_weights: probabilities of the K tasks, not all zero, (K,).
            start: measured posture of the controlled agent at onset, one for each task or one for
                all.
        """
        likely = np.flatnonzero(task_weights > UNLIKELY * task_weights.max())
        starts = start if isinstance(start, list) else [start] * len(task_weights)
        share = task_weights[likely] / task_weights[likely].sum()
        moments = [self.prediction(int(k)).mixture_at(times_s, starts[k]) for k in likely]
        mean, square = (
            np.tensordot(share, np.array(part), axes=1) for part in zip(*moments, strict=True)
        )
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def end_std(self, task: int, start: StartPosture | None = None) -> dict[str, float]:
        """Largest standard deviation of the end predicted for a task over the DOFs of each unit."""
        std = self.controlled(task, 1, start).std[-1]
        return largest_by_unit(std, self.library.controlled_units)

    def _predict(self, task: int) -> TaskPrediction:
        """From the hypotheses of the onset, or from those born since if they are more probable."""
        born = self._switched
        if born is not None and born.log_joint[task] > born.left(self._bank.log_evidence)[task]:
            courses, durations_s, weights = born.of_task(task)
            unseen = self._bank.history.until_now(0, 0)
            return TaskPrediction(
                self.library, task, courses, durations_s, weights, unseen, self._elapsed_s
            )
        bank, first = self.task(task), task * self.hypotheses.n_scales
        return TaskPrediction(
            self.library,
            task,
            bank,
            *self.hypotheses.durations(task, bank.log_evidence),
            self._bank.history.until_now(first, first + self.hypotheses.n_scales),
            self._elapsed_s,
            self._seen[:],
        )

    def _copy(self, index: NDArray[np.int64]) -> FilterBank:
        tasks = np.unique(index // self.hypotheses.n_scales)
        self._bank.restore(np.intersect1d(tasks, self._bank.pruned_tasks))
        mean, covariance = self.memory.distributions(index)
        return FilterBank(mean, covariance, self.log_evidence[index])
