# SPDX-License-Identifier: Apache-2.0
"""The filter of one movement: one posterior over task, duration, phase deviation and weights.

An observation passes through the observation model into the table of hypotheses. Task, progress and
both agents' trajectories are read off the same table.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.births import Births, BornBelief
from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.prediction import TaskPrediction
from intent_recognition.filtering.pruning import Pruning
from intent_recognition.filtering.table import HypothesisTable, Snapshot
from intent_recognition.gaussian import GaussianBatch
from intent_recognition.promp import (
    ControlGrid,
    StartPosture,
    TaskLibrary,
    Trajectory,
    largest_by_unit,
)
from intent_recognition.signals import Observation

UNLIKELY = 1e-3
"""Tasks so much less probable than the most probable one are left out of a mixture. Convention."""


class MovementFilter:
    """Filters every hypothesis over one movement, one observation after the other.

    Args:
        library: the learned tasks.
        grid: of tasks and durations.
        onset_ns: stamp from which phases count.
        prune: do not filter tasks whose posterior is negligible (`pruning`), when there are many.
        task_weight: what the posterior of the known tasks may be multiplied by, (K,); see there.
        switching: follow a person who turns to another task on the way (`births`).
        control_grids: the `ControlGrid` of tasks that had one; others are added.

    Attributes:
        table: the hypotheses of the onset.
        births: those that were born on the way; None without `switching`.
        n_used: how many observations every hypothesis was conditioned on.
    """

    def __init__(
        self,
        library: TaskLibrary,
        grid: PriorGrid,
        onset_ns: int,
        *,
        prune: bool = False,
        task_weight: NDArray[np.float64] | None = None,
        switching: bool = False,
        control_grids: dict[int, ControlGrid] | None = None,
    ):
        self.library, self.grid, self._prune = library, grid, prune
        basis, n = library.basis, len(grid.duration_s)
        deviation = library.phase_deviation
        self.table = HypothesisTable(n, library.n_observed, basis.n_basis, deviation)
        self.births = Births(library, grid) if switching else None
        prior = library.observed_mean, library.observed_covariance
        self._prior = GaussianBatch.of(*prior, basis.n_basis).state
        self._control_grids = {} if control_grids is None else control_grids
        self.restart(onset_ns, task_weight)

    def restart(self, onset_ns: int, task_weight: NDArray[np.float64] | None = None) -> None:
        """Begin with another movement, in the memory of the one before.

        Args:
            onset_ns: stamp from which phases count.
            task_weight: as of the class.
        """
        self.onset_ns, grid, table = onset_ns, self.grid, self.table
        task = np.repeat(np.arange(len(self._prior)), grid.n_scales)
        table.clear()
        columns = {"task": task, "duration_s": grid.duration_s, "log_prior": grid.log_prior}
        table.add(self._prior[task], **columns)
        self._model = ObservationModel(self.library, onset_ns)
        self._pruning = Pruning(table, self._model, grid, task_weight, prune=self._prune)
        if self.births is not None:
            self.births.clear()
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
        measurement = self._model.measurement(observation)
        if measurement is None:
            return
        self._pruning.condition(measurement)
        if self.births is not None:
            self.births.observe(measurement, self._model, self.table, self.log_evidence)
        self.n_used += 1
        self._elapsed_s = max(self._elapsed_s, measurement.elapsed_s)
        if not measurement.derivative:
            self._seen.append(measurement)
        self._predictions.clear()

    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Log density of all observations under each hypothesis, (B,); a bound where pruned."""
        return self._pruning.log_evidence

    @property
    def pruned_tasks(self) -> NDArray[np.int64]:
        """Numbers of the tasks that are pruned for now."""
        return np.flatnonzero(self._pruning.lagging)

    @property
    def snapshot(self) -> Snapshot:
        """A copy of all hypotheses of the onset, none of them pruned any more."""
        self._pruning.catch_up()
        return self.table.snapshot(np.arange(self.table.n))

    def task(self, task: int) -> Snapshot:
        """A copy of a task's hypotheses of the onset, not pruned any more: (S, ...)."""
        self._pruning.catch_up(np.arange(len(self._prior)) == task)
        first = task * self.grid.n_scales
        return self.table.snapshot(np.arange(first, first + self.grid.n_scales))

    def born(self) -> BornBelief | None:
        """What hypotheses that were born on the way make of task and timing; None without any."""
        return None if self.births is None or not self.n_used else self.births.belief()

    def prediction(self, task: int) -> TaskPrediction:
        """What the observations so far say about the movement, if it is of a task (or none)."""
        if task not in self._predictions:
            self._predictions[task] = self._predict(task)
        return self._predictions[task]

    def controlled(self, task: int, n_points: int, start: StartPosture | None = None) -> Trajectory:
        """The controlled agent's whole interaction under a task, as `TaskPrediction.controlled`."""
        asked = (task, n_points, self.n_used)
        if self._last is not None and self._last[0] == asked and self._last[1] is start:
            return self._last[2]
        if task not in self._control_grids:
            self._control_grids[task] = ControlGrid(self.library, task)
        grid = self._control_grids[task]
        trajectory = self.prediction(task).controlled(n_points, start, grid)
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
        births, evidence = self.births, self.log_evidence
        if births is not None and births.log_joint[task] > births.left(evidence)[task]:
            found = births.of_task(task)
            return TaskPrediction(
                self.library, task, *found, self.table.deviations(0, 0), self._elapsed_s
            )
        snapshot, n_scales = self.task(task), self.grid.n_scales
        some = slice(task * n_scales, (task + 1) * n_scales)
        weights = self.grid.duration_weights(self.table.rows["log_evidence"])[task]
        return TaskPrediction(
            self.library,
            task,
            snapshot,
            self.grid.duration_s[some],
            weights,
            self.table.deviations(some.start, some.stop),
            self._elapsed_s,
            self._seen[:],
        )
