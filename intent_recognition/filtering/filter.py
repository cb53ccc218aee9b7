# SPDX-License-Identifier: Apache-2.0
"""The filter of one movement: one posterior over task, duration, phase deviation and weights.

An observation passes through the observation model into the table of hypotheses. Task, progress and
both agents' trajectories are read off the same table.

Pruning is lag: tasks of negligible posterior are not conditioned, and catch up when they matter, as
far as they do. A measurement cannot be more probable under any task than at the peak of its own
noise, because an innovation covariance H S H^T + R is never smaller than R. So

    log p(all so far | task)  <=  log p(until it lagged | task) + sum of -1/2 log det(2 pi R),

and while this bound is negligible, so is the task. `none` never lags, and tasks are compared with
each other only, because the evidence of none counts beyond a margin only.
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
"""Fewer hypotheses are never pruned. Measured: fewer are filtered in less time than it takes to
choose among them (docs/speed.md)."""
PRUNE_BELOW = 160.0
"""A task lags from where its log posterior is this far below the most probable task's.

Measured over whole movements with 900 to 4,500 hypotheses: of 60 to 240 it takes the least time, or
within a tenth of it; what lags sooner has to catch up too often.
"""


class MovementFilter:
    """Filters every hypothesis over one movement, one observation after the other.

    Args:
        library: the learned tasks.
        grid: of tasks and durations.
        onset_ns: stamp from which phases count.
        prune: let tasks lag whose posterior is negligible, when there are many.
        task_weight: factors that the posterior of the known tasks may be multiplied by (another
            p(s)), (K,): what is negligible is so with and without them.
        switching: follow a person who turns to another task on the way (`births`).

    Attributes:
        table: the hypotheses of the onset.
        births: those that were born on the way; None without `switching`.
        observations: of the movement.
    """

    def __init__(
        self,
        library: TaskLibrary,
        grid: PriorGrid,
        onset_ns: int,
        *,
        prune: bool = False,
        task_weight: Floats | None = None,
        switching: bool = False,
    ):
        self.library, self.grid, n = library, grid, len(grid.duration_s)
        self._prunes = prune and n >= PRUNE_FROM
        self._prune_below = PRUNE_BELOW / grid.task_evidence
        # by which a lagging task stays below: e^-40 is less than the rounding of a probability
        self._negligible_below = 40.0 / grid.task_evidence
        self.table = HypothesisTable(n, library)
        prior = library.observed_mean, library.observed_covariance
        self._prior = GaussianBatch.of(*prior, library.basis.n_basis)
        self.births = Births(library, grid, self._prior) if switching else None
        self.restart(onset_ns, task_weight)

    def restart(
        self, onset_ns: int, task_weight: Floats | None = None, past: Iterable[Observation] = ()
    ) -> None:
        """Begin with another movement, in the memory of the one before.

        `past` is what has been observed of it; the others are as of the class.
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
        self._peaks = np.zeros(1)  # highest log density of so many measurements
        self._follows = np.ones(n_tasks, dtype=bool)
        self._posterior: TaskPosterior | None = None
        self._predictions: dict[int, TaskPrediction] = {}
        for observation in past:
            self.observe(observation)

    @property
    def n_used(self) -> int:
        """How many observations were used."""
        return len(self._measurements)

    @property
    def _seen(self) -> Integers:
        """On how many of them each task was conditioned, (K + 1,)."""
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
        if len(self.observations) > 2**14:  # 160 s at 100 Hz, kept for a change of library
            self.observations = every_second(self.observations)

    def posterior(self, stamp_ns: int) -> TaskPosterior:
        """What the observations so far say of task and progress at a stamp."""
        elapsed_s = (stamp_ns - self.onset_ns) * 1e-9
        if self._posterior is None:
            born = () if self.births is None else (self.births.table.rows, self.births.log_stay)
            posterior = task_posterior(self.log_evidence, self.grid, elapsed_s, *born)
            self._posterior = read_only(posterior)
        return self._posterior.at(elapsed_s)

    def _condition(self, measurement: Measurement) -> None:
        """Condition the tasks that do not lag; choose anew which do."""
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
        """Condition tasks on what they missed, until their bound is not above a limit, (K + 1,)."""
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
        """Log joint of some tasks, or where they lag a bound on it, (k,)."""
        joint = self.table.log_joint.reshape(-1, self.grid.n_scales)[tasks]
        missed = self._peaks[-1] - self._peaks[self._seen[tasks]]
        return log_sum(joint) + missed

    def _limit(self) -> Floats:
        """What the log joint of each task is compared with, (K + 1,); that of none matters always.

        The most probable known task's, under the posterior as it is and multiplied by the task
        weights. The tasks that hypotheses are born of are to be known exactly, too.
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
        """Log density of all observations under each hypothesis, (B,); a bound where it lags."""
        found: Floats = self.table.rows["log_evidence"].copy()
        if self._prunes:
            found += np.repeat(self._peaks[-1] - self._peaks[self._seen], self.grid.n_scales)
        return found

    @property
    def pruned_tasks(self) -> Integers:
        """Numbers of the tasks that lag."""
        return np.flatnonzero(self._seen < self.n_used)

    def rows_of(self, task: int) -> Integers:
        """Where the table has a task, which does not lag any more, (S,)."""
        if self._prunes:
            self._catch_up(np.where(np.arange(len(self._seen)) == task, -np.inf, np.inf))
            self._follows[task] = True
        return self._rows_of(np.array([task]))

    def prediction(self, task: int) -> TaskPrediction:
        """What the observations so far say about the movement, if it is of a task (or none).

        By the hypotheses of the onset, or by those born since if they are more probable.
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
            times_s: after onset, (T,).
            task_weights: probabilities of the K tasks, not all zero, (K,).
            start: measured posture of the controlled agent at onset, one for each task or one for
                all.
        """
        likely = np.flatnonzero(task_weights > 1e-3 * task_weights.max())  # others hardly count
        starts = start if isinstance(start, list) else [start] * len(task_weights)
        share = task_weights[likely] / task_weights[likely].sum()
        moments = [self.prediction(int(k)).mixture_at(times_s, starts[k]) for k in likely]
        mean, square = (
            np.tensordot(share, np.array(part), axes=1) for part in zip(*moments, strict=True)
        )
        return mean, np.sqrt(np.maximum(square - mean**2, 0.0))

    def end_std(self, task: int) -> dict[str, float]:
        """Largest standard deviation of the end predicted for a task over the DOFs of each unit."""
        std = self.prediction(task).controlled(1).std[-1]
        return largest_by_unit(std, self.library.controlled_units)


def _peak(measurement: Measurement) -> float:
    """Highest log density that a measurement can have under any hypothesis."""
    factor = cholesky(measurement.noise_covariance, name="noise covariance")
    at_peak = student_log_density(
        np.zeros(()), half_log_det(factor), len(factor), measurement.freedom
    )
    return float(at_peak)
