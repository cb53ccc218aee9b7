# SPDX-License-Identifier: Apache-2.0
"""One task's trajectories, from a movement under way."""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.observation_model import Measurement, ObservationModel
from intent_recognition.filtering.phase_deviation_filter import PhaseDeviationFilter
from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.promp import (
    AlignedPrimitives,
    ControlGrid,
    StartPosture,
    TaskLibrary,
    Trajectory,
    controlled_weights,
    deviation_grid,
    dof_variance,
    largest_by_unit,
    reference_phase,
)
from intent_recognition.signals import Observation

N_PHASES = 201
"""Reference phases at which a mixture's trajectories are tabulated. Convention."""
N_TABULATED = 101
"""Reference phases between which the controlled agent's trajectory is interpolated. Convention."""
KEEP_DURATIONS = 1.5
"""Observations are kept until this many times the longest duration after onset. Convention."""
NEGLIGIBLE_DURATION = 1e-4
"""Posterior probability below which a duration is left out of a mixture. Convention."""


class TaskFilter:
    """Duration, phase deviation and weights of one task, filtered one measurement after the other.

    Args:
        library: the learned tasks.
        task: number of the task.
        hypotheses: the grid of durations.
    """

    def __init__(self, library: TaskLibrary, task: int, hypotheses: Hypotheses):
        primitives, size = library.primitives, library.primitives.n_observed_weights
        grid = slice(task * hypotheses.n_scales, (task + 1) * hypotheses.n_scales)
        log_prior = hypotheses.log_prior[grid]
        self.library, self.task = library, task
        if not np.any(np.isfinite(log_prior)):  # an impossible task can still be asked for
            log_prior = np.zeros_like(log_prior)
        self._log_prior = log_prior - np.logaddexp.reduce(log_prior)
        self._power = hypotheses.duration_evidence
        self.filter = PhaseDeviationFilter(
            primitives,
            primitives.weight_mean[task, :size],
            primitives.weight_covariance[task, :size, :size],
            hypotheses.duration_s[grid],
        )

    def observe(self, measurement: Measurement) -> None:
        """Condition on positions, as `ObservationModel.for_prediction` gives them."""
        self.filter.observe(
            measurement.elapsed_s,
            measurement.dofs,
            measurement.values,
            measurement.noise_covariance,
        )

    @property
    def duration_weights(self) -> NDArray[np.float64]:
        """p(duration | observations), (S,), the evidence to the power `duration_evidence`."""
        log_weight = self._log_prior + self._power * self.filter.log_evidence
        weight = np.exp(log_weight - log_weight.max())
        return weight / weight.sum()

    @property
    def duration_s(self) -> float:
        """Expected duration of the whole movement."""
        return float(self.duration_weights @ self.filter.duration_s)

    def observed_weights(self) -> Gaussian:
        """Observed weights, durations marginalised by matching moments."""
        weight, means = self.duration_weights, self.filter.mean
        mean = weight @ means
        deviation = (means - mean) * np.sqrt(weight)[:, None]
        covariance = np.tensordot(weight, self.filter.covariance, axes=1)
        return Gaussian(mean, symmetrize(covariance + deviation.T @ deviation))

    def phases_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability of each tabulated reference phase at times after onset, (S, T, G)."""
        phase_deviation, durations = self.filter.deviations_at(times_s), self.filter.duration_s
        phase = reference_phase(
            self.library.primitives.phase_deviation, times_s / durations[:, None]
        )
        place = phase * (N_PHASES - 1)
        cell = np.minimum(place.astype(np.int64), N_PHASES - 2)
        share = place - cell
        n_rows = len(durations) * len(times_s)
        index = cell.reshape(n_rows, -1) + N_PHASES * np.arange(n_rows)[:, None]
        table = np.bincount(
            np.concatenate([index.ravel(), index.ravel() + 1]),
            np.concatenate(
                [(phase_deviation * (1.0 - share)).ravel(), (phase_deviation * share).ravel()]
            ),
            n_rows * N_PHASES,
        )
        shape = len(durations), len(times_s), N_PHASES
        return np.asarray(table, dtype=np.float64).reshape(shape)

    def mixture_at(
        self, times_s: NDArray[np.float64], start: StartPosture | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and mean square of the controlled agent at true times after onset, (T, Q) each.

        The mean square includes the noise (Ewerton et al. 2015, Eq. 14, over durations and
        phase deviations).
        """
        primitives, weights = self.library.primitives, self.duration_weights
        design = primitives.basis.design_matrix(np.linspace(0.0, 1.0, N_PHASES))
        phases = self.phases_at(times_s)
        mean = np.zeros((len(times_s), primitives.n_controlled))
        square = np.zeros_like(mean)
        for index in np.flatnonzero(weights > NEGLIGIBLE_DURATION):
            observed = Gaussian(self.filter.mean[index], self.filter.covariance[index])
            controlled = controlled_weights(primitives, self.task, observed, start)
            position = design @ controlled.mean.reshape(primitives.n_controlled, -1).T
            variance = dof_variance(design, controlled.covariance)
            variance += primitives.control_noise_variance()
            mean += weights[index] * phases[index] @ position
            square += weights[index] * phases[index] @ (variance + position**2)
        total = weights[weights > NEGLIGIBLE_DURATION].sum()
        return mean / total, square / total

    def controlled(
        self, n_points: int, start: StartPosture | None = None, grid: ControlGrid | None = None
    ) -> Trajectory:
        """The controlled agent's whole interaction from onset, or its end alone for one point.

        Args:
            n_points: T.
            start: measured posture of the controlled agent at onset.
            grid: `control_grid` of this task, if there is one.
        """
        grid = grid or control_grid(self.library.primitives, self.task)
        duration_s = self.duration_s
        along = grid.predict(self.observed_weights(), 1.0, start)
        times_s = np.linspace(1.0, 0.0, n_points)[::-1] * duration_s
        phase, phase_variance, rate = self._path(times_s)
        positions, slope, std = _between(along, phase)
        variance = std**2 + slope**2 * phase_variance[:, None]
        return Trajectory(times_s, positions, slope * rate[:, None], np.sqrt(variance))

    def observed(self, n_points: int) -> Trajectory:
        """The rest of the observed agent's movement; its end alone when that is due, or for T = 1.

        Args:
            n_points: T.
        """
        primitives, duration_s = self.library.primitives, self.duration_s
        begin_s = min(self.filter.elapsed_s or 0.0, duration_s)
        times_s = np.linspace(duration_s, begin_s, n_points)[::-1]
        phase, phase_variance, rate = self._path(times_s)
        weights = self.observed_weights()
        per_dof = weights.mean.reshape(primitives.n_observed, -1).T
        slope = primitives.basis.derivative_matrix(phase) @ per_dof
        design = primitives.basis.design_matrix(phase)
        variance = dof_variance(design, weights.covariance)
        variance += primitives.noise_variance[: primitives.n_observed]
        variance += slope**2 * phase_variance[:, None]
        return Trajectory(times_s, design @ per_dof, slope * rate[:, None], np.sqrt(variance))

    def _path(
        self, times_s: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Expected progress: reference phase, its variance, and phase per second, each (T,).

        It never goes back, and is at the end at the last of the times.
        """
        if len(deviation_grid(self.library.primitives.phase_deviation)) == 1:
            mean = np.clip(times_s / self.duration_s, 0.0, 1.0)
            variance = np.zeros_like(mean)
        else:
            mean, variance = self._expected_phase(times_s)
        if times_s[-1] <= times_s[0]:
            return np.ones_like(mean), variance, np.zeros_like(mean)
        mean = np.maximum.accumulate(mean)
        mean += (1.0 - mean[-1]) * times_s / times_s[-1]
        return mean, variance, np.gradient(mean, times_s)

    def _expected_phase(
        self, times_s: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and variance of the reference phase, durations and deviations marginalised, (T,)."""
        phase_deviation, durations = self.library.primitives.phase_deviation, self.filter.duration_s
        weights = self.duration_weights
        likely = np.flatnonzero(weights > NEGLIGIBLE_DURATION)
        share = weights[likely, None, None] / weights[likely].sum()
        share = share * self.filter.deviations_at(times_s)[likely]
        phase = reference_phase(phase_deviation, times_s / durations[likely, None])
        mean = np.einsum("ste,ste->t", share, phase)
        return mean, np.maximum(np.einsum("ste,ste->t", share, phase**2) - mean**2, 0.0)


def control_grid(primitives: AlignedPrimitives, task: int) -> ControlGrid:
    """The controlled agent over reference phase, for `TaskFilter.controlled`."""
    return ControlGrid(primitives, task, N_TABULATED)


def _between(
    along: Trajectory, phase: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions, slopes and standard deviations at phases (T,), each (T, Q).

    Cubic Hermite polynomials between evenly spaced phases; the deviation is linear there.
    """
    last = len(along.times_s) - 1
    place = phase * last
    cell = np.clip(place.astype(np.int64), 0, last - 1)
    share = (place - cell)[:, None]
    start, end = along.positions[cell], along.positions[cell + 1]
    first, second = along.velocities[cell] / last, along.velocities[cell + 1] / last
    step = end - start
    square, cube = 3.0 * step - 2.0 * first - second, first + second - 2.0 * step
    positions = start + share * (first + share * (square + share * cube))
    slope = (first + share * (2.0 * square + 3.0 * share * cube)) * last
    low = along.std[cell]
    return positions, slope, low + share * (along.std[cell + 1] - low)


class TaskFilters:
    """The task filters of a movement under way; each is brought up to date when it is asked for.

    Observations closer together than the library's `correlation_time_s` say nothing new about what
    a primitive leaves unexplained; of them the first is used. Velocities are not used, nor is what
    is observed long after the movement must be over.

    Args:
        model: what observations are to the filters.
        grids: the library's `control_grid` of tasks that had one; others are added.
    """

    def __init__(self, model: ObservationModel, grids: dict[int, ControlGrid] | None = None):
        self._model, self._grids = model, {} if grids is None else grids
        self._spacing_ns = 0.999e9 * model.library.correlation_time_s
        self._longest_s = KEEP_DURATIONS * float(np.max(model.hypotheses.duration_s))
        self._kept: list[Measurement] = []
        self._filters: dict[int, tuple[TaskFilter, int]] = {}
        self._last_ns: dict[tuple[int, tuple[int, ...] | None], int] = {}
        self._last: tuple[tuple[int, int, int], StartPosture | None, Trajectory] | None = None

    def observe(self, observation: Observation) -> None:
        """Keep an observation if a filter would use it."""
        kind = (observation.group, observation.dofs)
        last_ns = self._last_ns.get(kind, -self._spacing_ns)
        early = observation.stamp_ns - last_ns < self._spacing_ns
        late = self._model.elapsed_s(observation) > self._longest_s
        if early or late or observation.derivative:
            return
        self._last_ns[kind] = observation.stamp_ns
        self._kept.append(self._model.for_prediction(observation))

    def __getitem__(self, task: int) -> TaskFilter:
        """The filter of a task, with all observations so far."""
        found, seen = self._filters.get(task, (None, 0))
        if found is None:
            found = TaskFilter(self._model.library, task, self._model.hypotheses)
        for measurement in self._kept[seen:]:
            found.observe(measurement)
        self._filters[task] = found, len(self._kept)
        return found

    def controlled(self, task: int, n_points: int, start: StartPosture | None = None) -> Trajectory:
        """The controlled agent's whole interaction under a task, as `TaskFilter.controlled`."""
        asked = (task, n_points, len(self._kept))
        if self._last is not None and self._last[0] == asked and self._last[1] is start:
            return self._last[2]
        if task not in self._grids:
            self._grids[task] = control_grid(self._model.library.primitives, task)
        trajectory = self[task].controlled(n_points, start, self._grids[task])
        self._last = asked, start, trajectory
        return trajectory

    def end_std(self, task: int, start: StartPosture | None = None) -> dict[str, float]:
        """Largest standard deviation of the end predicted for a task over the DOFs of each unit."""
        units = self._model.library.controlled_units
        return largest_by_unit(self.controlled(task, 1, start).std[-1], units)
