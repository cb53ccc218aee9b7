# SPDX-License-Identifier: Apache-2.0
"""The filter of one movement: one posterior over task, duration, phase deviation and weights.

An observation passes through the observation model into the table of hypotheses. Task, progress and
both agents' trajectories are read off the same table.

Pruning is lag: tasks of negligible posterior are not conditioned, and catch up once they matter. A
measurement has its highest possible density, under any task, at the peak of its own noise, because
an innovation covariance H S H^T + R is never smaller than R. So

    log p(all so far | task)  <=  log p(until it lagged | task) + sum of -1/2 log det(2 pi R),

and while this bound is negligible, so is the task. `none` never lags. Tasks are compared with each
other only, not with none, whose evidence counts beyond a margin only.
"""

from collections.abc import Iterable

import numpy as np

from intent_recognition.array_types import Floats, Integers, read_only
from intent_recognition.filtering.births import MAX_TASKS, Births
from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.posterior import TaskPosterior, task_posterior
from intent_recognition.filtering.prediction import TaskPrediction
from intent_recognition.filtering.table import HypothesisTable
from intent_recognition.gaussian import (
    GaussianBatch,
    cholesky,
    half_log_det,
    log_sum,
    student_log_density,
)
from intent_recognition.promp import StartPosture, TaskLibrary, largest_by_unit
from intent_recognition.signals import Observation, every_second

PRUNE_FROM = 512
"""Least number of hypotheses for pruning. Measured: filtering fewer than this takes less time than
choosing among them (docs/speed.md)."""
PRUNE_BELOW = 160.0
"""Nats below the most probable task at which a task begins to lag.

Measured over whole movements with 900 to 4,500 hypotheses: the time is within a tenth of the least
among values from 60 to 240. With lower values, tasks have to catch up too often.
"""


class MovementFilter:
    """Filters every hypothesis over one movement, one observation after the other.

    Args:
        library: the learned tasks.
        grid: prior grid of tasks and durations.
        onset_ns: stamp at which the movement began; phases count from it.
        prune: let tasks of negligible posterior lag if there are `PRUNE_FROM` hypotheses or more.
        switching: follow a person who turns to another task on the way (`births`).

    Attributes:
        table: the hypotheses of the onset.
        births: the hypotheses born since; None without `switching`.
        observations: the observations of the movement.
    """

    def __init__(
        self,
        library: TaskLibrary,
        grid: PriorGrid,
        onset_ns: int,
        *,
        prune: bool = False,
        switching: bool = False,
    ):
        self.library, self.grid, n = library, grid, len(grid.duration_s)
        self._prunes = prune and n >= PRUNE_FROM
        self._prune_below = PRUNE_BELOW / grid.task_evidence
        # margin by which a lagging task stays below: e^-40 is less than a probability's rounding
        self._negligible_below = 40.0 / grid.task_evidence
        self.table = HypothesisTable(n, library)
        prior = library.observed_mean, library.observed_covariance
        self._prior = GaussianBatch.of(*prior, library.basis.n_basis)
        self.births = Births(library, grid, self._prior) if switching else None
        self.restart(onset_ns)

    def restart(
        self, onset_ns: int, task_weight: Floats | None = None, past: Iterable[Observation] = ()
    ) -> None:
        """Begin another movement in the same memory.

        Args:
            onset_ns: stamp at which it began.
            task_weight: factors by which the posterior of the known tasks may be multiplied
                (another p(s)), (K,). A task lags only if it is negligible with and without them.
            past: its observations so far.
        """
        grid, n_tasks = self.grid, len(self._prior.state)
        self.onset_ns, self.task_weight = onset_ns, task_weight
        self.table.clear()
        self.table.add(
            self._prior.state,
            grid.n_scales,
            task=np.repeat(np.arange(n_tasks), grid.n_scales),
            duration_s=grid.duration_s,
            log_prior=grid.log_prior,
        )
        self.observations: list[Observation] = []
        self._model = ObservationModel(self.library, onset_ns)
        with np.errstate(divide="ignore"):
            self._log_weight = np.log(np.ones(n_tasks - 1) if task_weight is None else task_weight)
        if self.births is not None:
            self.births.clear(self._log_weight)
        self._measurements: list[Measurement] = []
        self._peaks = np.zeros(1)  # highest log density of the first 0, 1, ... measurements
        self._follows = np.ones(n_tasks, dtype=bool)
        self._posterior: TaskPosterior | None = None
        self._predictions: dict[int, TaskPrediction] = {}
        for observation in past:
            self.observe(observation)

    @property
    def n_used(self) -> int:
        """Number of observations that were used."""
        return len(self._measurements)

    @property
    def _seen(self) -> Integers:
        """Number of measurements on which each task was conditioned, (K + 1,)."""
        return np.asarray(self.table.rows["seen"][:: self.grid.n_scales])

    def observe(self, observation: Observation) -> None:
        """Condition every hypothesis on an observation, unless it follows too closely on the last.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        measurement = self._model.measurement(observation)
        if measurement is not None:
            self._condition(measurement)
            if self.births is not None:
                self.births.observe(measurement, self.table, self.log_evidence)
            self._posterior = None
            self._predictions.clear()
        self.observations.append(observation)
        if len(self.observations) > 2**14:  # 160 s at 100 Hz; needed when the library changes
            self.observations = every_second(self.observations)

    def posterior(self, stamp_ns: int) -> TaskPosterior:
        """Posterior of task and progress at a stamp, given the observations so far."""
        elapsed_s = (stamp_ns - self.onset_ns) * 1e-9
        if self._posterior is None:
            born = () if self.births is None else (self.births.table.rows, self.births.log_stay)
            posterior = task_posterior(self.log_evidence, self.grid, elapsed_s, *born)
            self._posterior = read_only(posterior)
        return self._posterior.at(elapsed_s)

    def _condition(self, measurement: Measurement) -> None:
        """Condition the tasks that do not lag, then choose again which tasks lag."""
        index = None if self._follows.all() else self._rows_of(np.flatnonzero(self._follows))
        self.table.condition(measurement, index)
        self._measurements.append(measurement)
        if self._prunes:
            self._peaks = np.append(self._peaks, self._peaks[-1] + _peak(measurement))
            limit = self._limit()
            self._catch_up(limit - self._negligible_below)
            self._follows = self._seen == self.n_used
            self._follows[:-1] &= self._bound()[:-1] > limit[:-1] - self._prune_below

    def _catch_up(self, limit: Floats) -> None:
        """Condition tasks on missed measurements until their bound is below a limit, (K + 1,)."""
        wanted = (self._seen < self.n_used) & (self._bound() >= limit)
        while wanted.any():
            k = int(self._seen[wanted].min())
            tasks = np.flatnonzero(wanted & (self._seen == k))
            self.table.condition(self._measurements[k], self._rows_of(tasks))
            wanted[tasks] = (k + 1 < self.n_used) & (self._bound(tasks) >= limit[tasks])

    def _rows_of(self, tasks: Integers) -> Integers:
        n_scales = self.grid.n_scales
        return (tasks[:, None] * n_scales + np.arange(n_scales)).ravel()

    def _bound(self, tasks: Integers | slice = slice(None)) -> Floats:
        """Log joint of k tasks, or an upper bound on it for tasks that lag, (k,)."""
        joint = self.table.log_joint.reshape(-1, self.grid.n_scales)[tasks]
        missed = self._peaks[-1] - self._peaks[self._seen[tasks]]
        return log_sum(joint) + missed

    def _limit(self) -> Floats:
        """Log joint with which that of each task is compared, (K + 1,); -inf for none.

        It is that of the most probable known task, with or without the task weights, whichever is
        lower. It is lower still if needed to keep the tasks of which hypotheses are born exact.
        """
        exact = np.where(self._seen == self.n_used, self._bound(), -np.inf)[:-1]
        weighed = (exact + self._log_weight).max() - self._log_weight
        limit = np.minimum(exact.max(), weighed)
        if self.births is not None and len(exact) > MAX_TASKS:
            least = np.partition(exact, -MAX_TASKS)[-MAX_TASKS]
            limit = np.minimum(limit, least + self._negligible_below)
        return np.r_[limit, -np.inf]

    @property
    def log_evidence(self) -> Floats:
        """Log density of all observations under each hypothesis, (B,); a bound if its task lags."""
        found: Floats = self.table.rows["log_evidence"].copy()
        if self._prunes:
            found += np.repeat(self._peaks[-1] - self._peaks[self._seen], self.grid.n_scales)
        return found

    @property
    def pruned_tasks(self) -> Integers:
        """Indices of the tasks that lag."""
        return np.flatnonzero(self._seen < self.n_used)

    def rows_of(self, task: int) -> Integers:
        """Rows of a task in the table, (S,), once it has caught up."""
        if self._prunes:
            self._catch_up(np.where(np.arange(len(self._seen)) == task, -np.inf, np.inf))
            self._follows[task] = True
        return self._rows_of(np.array([task]))

    def prediction(self, task: int) -> TaskPrediction:
        """Prediction under a task (or none, K), given the observations so far.

        Made from the hypotheses of the onset, or from those born since if they are more probable.
        """
        if task not in self._predictions:
            births, table = self.births, self.table
            if births is not None and births.outweighs(task, self.log_evidence):
                table, (index, share) = births.table, births.of_task(task)
            else:
                index = self.rows_of(task)
                share = self.grid.duration_weights(table.rows["log_evidence"])[task]
            found = TaskPrediction(self.library, task, table, index, share, self._measurements)
            self._predictions[task] = found
        return self._predictions[task]

    def mixture_at(
        self,
        times_s: Floats,
        task_weights: Floats,
        start: StartPosture | list[StartPosture | None] | None = None,
    ) -> tuple[Floats, Floats]:
        """Mean and standard deviation of the controlled agent over all tasks, (T, Q) each.

        Args:
            times_s: times after onset, (T,).
            task_weights: probabilities of the K tasks, not all zero, (K,).
            start: measured posture of the controlled agent at onset, one per task or one for all.
        """
        likely = np.flatnonzero(task_weights > 1e-3 * task_weights.max())  # others are negligible
        starts = start if isinstance(start, list) else [start] * len(task_weights)
        share = task_weights[likely] / task_weights[likely].sum()
        moments = [self.prediction(int(k)).mixture_at(times_s, starts[k]) for k in likely]
        mean, square = (
            np.tensordot(share, np.array(part), axes=1) for part in zip(*moments, strict=True)
        )
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def end_std(self, task: int) -> dict[str, float]:
        """Largest standard deviation of a task's predicted end among the DOFs of each unit."""
        std = self.prediction(task).controlled(1).std[-1]
        return largest_by_unit(std, self.library.controlled_units)


def _peak(measurement: Measurement) -> float:
    """Highest log density of a measurement under any hypothesis."""
    log_scale = half_log_det(cholesky(measurement.noise_covariance, name="noise covariance"))
    m, freedom = len(measurement.dofs), measurement.freedom
    return float(student_log_density(np.zeros(()), log_scale, m, freedom))
