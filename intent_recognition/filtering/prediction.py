# SPDX-License-Identifier: Apache-2.0
"""Trajectories of both agents under one task, from the hypotheses of a movement under way."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from intent_recognition.array_types import Floats, Integers, read_only
from intent_recognition.filtering.deviations import deviations_at
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.table import HypothesisTable
from intent_recognition.gaussian import Gaussian, symmetrize, whiten_innovation
from intent_recognition.promp import (
    STEP,
    PoseRegression,
    StartPosture,
    TaskLibrary,
    Trajectory,
    check_points,
    dof_variance,
    reference_phase,
    residual_weights,
    steady_phase,
)

N_PHASES = 201
"""Number of reference phases at which a mixture's trajectories are tabulated: every 0.5 %."""
NEGLIGIBLE_SHARE = 1e-4
"""Probability below which a hypothesis is left out of a prediction: the posterior of its duration
or, for born ones, the ratio to their task's most probable. A hundred of them are one percent."""


class TaskPrediction:
    """Duration, phase deviation and weights of one task, given the observations so far.

    Args:
        library: the learned tasks.
        task: index of the task; K is none, which has no controlled agent.
        table: table of hypotheses.
        index: rows of the task in the table, (S,).
        duration_weights: posterior probabilities of these rows, (S,).
        seen: the measurements so far. The residuals of positions couple the agents, unless the
            hypotheses have offsets, which explain the residuals.
    """

    def __init__(
        self,
        library: TaskLibrary,
        task: int,
        table: HypothesisTable,
        index: Integers,
        duration_weights: Floats,
        seen: Sequence[Measurement],
    ):
        self.library, self.task, self.duration_weights = library, task, duration_weights
        self._table, self._rows, self._whole = table, table.rows[index], table.weights(index)
        self.weights = self._whole.resized(slice(None), library.basis.n_basis)
        self._deviations = table.deviations(index)
        self.durations_s = self._rows["onset_s"] + self._rows["duration_s"]
        self.elapsed_s = max((one.elapsed_s for one in seen), default=0.0)
        self._places = [one for one in seen if not one.derivative]
        known = task < library.n_tasks and not table.has_offsets and bool(self._places)
        coupling, regression = library.coupling, library.pose_regression
        couples = known and coupling is not None and coupling.gain[task].any()
        regresses = known and regression is not None and regression.share[task].any()
        self._coupling = coupling if couples else None
        self._regression = regression if regresses else None
        self._relative = self.durations_s[:, None] / library.usual_s[task]
        self._likely = np.flatnonzero(duration_weights > NEGLIGIBLE_SHARE)
        self._share = duration_weights[self._likely] / duration_weights[self._likely].sum()

    @cached_property
    def _design(self) -> Floats:
        """Basis functions at the tabulated phases, (G, N)."""
        return self.library.basis.design_matrix(np.linspace(0.0, 1.0, N_PHASES))

    @property
    def duration_s(self) -> float:
        """Expected duration of the whole movement."""
        return float(self.duration_weights @ self.durations_s)

    def observed_weights(self) -> Gaussian:
        """Posterior of the observed weights, durations marginalised by moment matching."""
        return self.weights.mixture(self.duration_weights)

    def deviations_at(self, times_s: Floats) -> Floats:
        """Probability of each deviation at times after onset given all observations, (S, T, E)."""
        model, durations = self.library.phase_deviation, self.durations_s
        return deviations_at(model, durations, self._deviations, times_s)

    def phases_at(self, times_s: Floats, *, controlled: bool = True) -> Floats:
        """Probability of each tabulated reference phase of an agent, (S, T, G)."""
        return _tabulated(*self._phases(times_s, controlled))

    def _phases(self, times_s: Floats, controlled: bool) -> tuple[Floats, Floats]:
        """Reference phases of an agent at times (T,), and their probabilities, (S, T, E) each."""
        model, into = self.library.phase_deviation, times_s / self.durations_s[:, None]
        if controlled and not model.controlled_follows:
            phase = steady_phase(model, into, self._relative)[..., None]
            return phase, np.ones_like(phase)
        return reference_phase(model, into, self._relative), self.deviations_at(times_s)

    def mixture_at(
        self, times_s: Floats, start: StartPosture | None = None
    ) -> tuple[Floats, Floats]:
        """Mean and mean square of the controlled agent at times after onset, (T, Q) each.

        Both are over durations and phase deviations (Ewerton et al. 2015, Eq. 14) and include the
        coupling of the residuals (`promp.coupling`) and, with a known start, the regression on the
        present state (`promp.pose_regression`); the mean square includes the noise.
        """
        library, likely, share = self.library, self._likely, self._share
        mean, covariance = self._controlled_weights(start)
        design = self._design
        position = np.matmul(design, mean.swapaxes(1, 2))  # (S, G, Q)
        square = np.einsum("sqgk,gk->sgq", design @ covariance, design)
        square += library.control_noise_variance() + position**2
        (shift, unexplained), phases = self._coupled(times_s), self.phases_at(times_s)[likely]
        expected = np.matmul(phases, position)
        variance = unexplained * (np.matmul(phases, square) - expected**2)
        expected += shift[likely]
        mean = np.tensordot(share, expected, 1)
        variance = np.tensordot(share, variance + (expected - mean) ** 2, 1)
        if start is not None and self._regression is not None:
            mean = self._regressed(self._regression, times_s, mean)
        return mean, variance + mean**2

    @cached_property
    def _measured(self) -> tuple[Floats, Floats]:
        """Ascending times of measured positions, (n,), and their values, NaN if none, (n, P)."""
        times_s = np.unique([one.elapsed_s for one in self._places])
        values = np.full((len(times_s), self.library.n_observed), np.nan)
        for one in self._places:
            values[np.searchsorted(times_s, one.elapsed_s), one.dofs] = one.values
        return times_s, values

    def _regressed(self, regression: PoseRegression, times_s: Floats, mean: Floats) -> Floats:
        """Predicted poses (T, Q) moved towards those of the regression on the present state."""
        library, likely = self.library, self._likely
        seen_s, values = self._measured
        at_s = self.elapsed_s - np.array([0.0, STEP]) * self.duration_s
        known = ~np.isnan(values)
        if not np.all(known.any(axis=0)):
            return mean
        columns = zip(values.T, known.T, strict=True)
        last, before = np.array([np.interp(at_s, seen_s[k], v[k]) for v, k in columns]).T
        phases = self.phases_at(at_s[:1])[likely, 0] @ self._design
        scaling = library.in_durations(self.task, self.durations_s[likely])
        row = np.einsum("k,kn,knm->m", self._share, phases, scaling)
        usual = library.weight_mean[self.task, library.n_observed_weights :].reshape(-1, len(row))
        state = np.concatenate([last, last - before, usual @ row])
        leads = (times_s - self.elapsed_s) / self.duration_s
        poses, part = regression.at(self.task, state, leads)
        return mean + part * (poses - mean)

    def _controlled_weights(
        self, start: StartPosture | None, *, together: bool = False
    ) -> tuple[Floats, Floats]:
        """As `promp.controlled_weights` for k likely durations, with covariances within DOFs only.

        The displacement from the start is scaled to each duration. With `together`, all durations
        are merged into one by moment matching, k = 1.

        Returns:
            Means (k, Q, N) and covariances (k, Q, N, N).
        """
        library = self.library
        observed, spread = (
            (part[None] for part in self.observed_weights())
            if together
            else self.weights.moments(self._likely)
        )
        matrix, offset, rest = library.regressions[self.task]
        q, n = library.n_controlled, library.basis.n_basis
        by_dof, rest = matrix.reshape(q, n, -1), rest.reshape(q, n, q, n)
        cross = (matrix @ spread).reshape(-1, *by_dof.shape)  # (k, Q, N, P N)
        scale = library.regressions.uncertainty(self.task, observed, spread)[:, None, None, None]
        own = np.matmul(cross, by_dof.swapaxes(1, 2)) + scale * np.einsum("qnqm->qnm", rest)
        mean = (observed @ matrix.T + offset).reshape(-1, q, n)
        if start is None:
            return self._displaced(mean, own)
        row = library.basis.design_matrix(np.zeros(1))[0]
        at = np.einsum("n,qnp->qp", row, by_dof)
        cross = np.matmul(cross, at.T) + scale * np.einsum("qnrm,m->qnr", rest, row)  # (k, Q, N, Q)
        spread = np.einsum("n,kqnr->kqr", row, cross)
        spread = symmetrize(spread) + np.diag(start.variance + library.control_noise_variance())
        cross = cross.reshape(len(mean), q * n, q).swapaxes(1, 2)
        innovation = start.position - mean @ row
        cross, innovation, _ = whiten_innovation(spread, cross, innovation)
        cross = cross.reshape(-1, q, q, n)
        mean = mean + np.einsum("kr,krqn->kqn", innovation, cross)
        return self._displaced(mean, own - np.einsum("krqn,krqm->kqnm", cross, cross))

    def _displaced(self, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
        """Controlled weights (k, ...) with displacements from the start scaled to the durations."""
        library = self.library
        if not (library.displacement_exponent or library.delay_s):
            return mean, covariance
        likely_s = self.durations_s[self._likely]
        scaling = library.in_durations(self.task, likely_s)[:, None]  # (k, 1, N, N)
        mean = np.matmul(scaling, mean[..., None])[..., 0]
        return mean, scaling @ covariance @ scaling.swapaxes(2, 3)

    def _along(self, phase: Floats, start: StartPosture | None) -> tuple[Floats, Floats, Floats]:
        """Positions, their derivatives by phase, and variances of the controlled agent, (T, Q)."""
        library, basis = self.library, self.library.basis
        displaced = bool(library.displacement_exponent or library.delay_s)
        means, covariance = self._controlled_weights(start, together=not displaced)
        share = self._share if displaced else np.ones(1)
        mean = np.tensordot(share, means, axes=1)
        covariance = np.tensordot(share, covariance, axes=1)
        covariance += np.einsum("k,kqn,kqm->qnm", share, means - mean, means - mean)
        design = basis.design_matrix(phase)
        variance = np.einsum("qtn,tn->tq", design @ covariance, design)
        variance += library.control_noise_variance()
        return design @ mean.T, basis.derivative_matrix(phase) @ mean.T, variance

    def _coupled(self, times_s: Floats) -> tuple[Floats, Floats]:
        """Shift of the controlled agent by the observed residuals, and unexplained variance.

        The shift is per hypothesis, (S, T, Q); the second is a share of the variance, (T, Q).
        """
        shape = len(times_s), self.library.n_controlled
        coupling = self._coupling
        if coupling is None:
            return np.zeros((len(self.durations_s), *shape)), np.ones(shape)
        seen_s, values = self._measured
        of_dofs = self.weights.mean.reshape(len(self.durations_s), self.library.n_observed, -1)
        path = self._design @ np.swapaxes(of_dofs, 1, 2)
        residuals = values - self.phases_at(seen_s, controlled=False) @ path
        residuals[np.broadcast_to(np.isnan(values), residuals.shape)] = 0.0
        weights, known = residual_weights(seen_s, times_s, float(coupling.decay_s[self.task]))
        shift = weights @ residuals @ coupling.gain[self.task].T
        return shift, 1.0 - known[:, None] * coupling.explained[self.task]

    def controlled(self, n_points: int, start: StartPosture | None = None) -> Trajectory:
        """The controlled agent's whole interaction at n points in time; for one point, its end.

        It is conditioned on `start`, the agent's measured posture at onset.

        Raises:
            ArgumentError: `n_points` is below 1.
        """
        check_points(n_points)
        duration_s = self.duration_s
        times_s = np.linspace(1.0, 0.0, n_points)[::-1] * duration_s
        phase, phase_variance, rate = self._path(times_s, controlled=True)
        positions, slope, variance = self._along(phase, start)
        variance, velocities = variance + slope**2 * phase_variance[:, None], slope * rate[:, None]
        if self._coupling is not None:
            shift, unexplained = self._coupled(times_s)
            shift = np.tensordot(self.duration_weights, shift, axes=1)
            positions, variance = positions + shift, variance * unexplained
            if n_points > 1:
                velocities = velocities + np.gradient(shift, times_s, axis=0)
        return read_only(Trajectory(times_s, positions, velocities, np.sqrt(variance)))

    def observed(self, n_points: int) -> Trajectory:
        """The rest of the observed agent's movement; its end alone if overdue or for one point.

        Raises:
            ArgumentError: `n_points` is below 1.
        """
        check_points(n_points)
        library, duration_s = self.library, self.duration_s
        begin_s = min(self.elapsed_s, duration_s)
        times_s = np.linspace(duration_s, begin_s, n_points)[::-1]
        if self._table.has_offsets:
            return self._with_offsets(times_s)
        phase, phase_variance, rate = self._path(times_s)
        weights = self.observed_weights()
        per_dof = weights.mean.reshape(library.n_observed, -1).T
        slope = library.basis.derivative_matrix(phase) @ per_dof
        design = library.basis.design_matrix(phase)
        variance = dof_variance(design, weights.covariance)
        variance += library.noise_variance[: library.n_observed]
        variance += slope**2 * phase_variance[:, None]
        return Trajectory(times_s, design @ per_dof, slope * rate[:, None], np.sqrt(variance))

    def _with_offsets(self, times_s: Floats) -> Trajectory:
        """The observed agent under hypotheses born on the way: the mixture of their movements.

        Each has its own begin, course and offset. Past the expected end, all points are at the
        present place.
        """
        n_rows, n_dofs = len(self._rows), self.library.n_observed
        at_s = np.tile(np.maximum(times_s, self.elapsed_s), n_rows)
        design = self._table.design(at_s, np.repeat(self._rows, len(times_s)))
        design = design.reshape(n_rows, len(times_s), -1)
        mean, covariance = self._whole.moments()
        of_each = design @ mean.reshape(n_rows, n_dofs, -1).swapaxes(1, 2)  # (S, T, P)
        positions = np.tensordot(self.duration_weights, of_each, 1)
        square = dof_variance(design, covariance) + (of_each - positions) ** 2
        variance = np.tensordot(self.duration_weights, square, 1)
        velocities = np.zeros_like(positions)
        if times_s[-1] > times_s[0]:
            velocities = np.gradient(positions, times_s, axis=0)
        std = np.sqrt(variance + self.library.noise_variance[:n_dofs])
        return Trajectory(times_s, positions, velocities, std)

    def _path(self, times_s: Floats, *, controlled: bool = False) -> tuple[Floats, Floats, Floats]:
        """Expected reference phase, its variance, and its rate [1/s], each (T,).

        The phase never decreases, and is 1 at the last of the times.
        """
        model = self.library.phase_deviation
        steady = controlled and not model.controlled_follows
        if steady or len(model.grid) == 1:
            relative = self.duration_s / self.library.usual_s[self.task]
            mean = steady_phase(model, times_s / self.duration_s, relative)
            variance = np.zeros_like(mean)
        else:
            phase, share = (part[self._likely] for part in self._phases(times_s, controlled))
            share = self._share[:, None, None] * share
            mean = np.einsum("ste,ste->t", share, phase)
            variance = np.maximum(np.einsum("ste,ste->t", share, phase**2) - mean**2, 0.0)
        if times_s[-1] <= times_s[0]:
            return np.ones_like(mean), variance, np.zeros_like(mean)
        mean = np.maximum.accumulate(mean)
        mean += (1.0 - mean[-1]) * times_s / times_s[-1]
        return mean, variance, np.gradient(mean, times_s)


def _tabulated(phase: Floats, probability: Floats) -> Floats:
    """Probabilities of the `N_PHASES` tabulated phases, (..., G), from those of phases (..., E).

    Each probability is divided between the two neighbouring phases, so that the mean is kept.
    """
    place = phase * (N_PHASES - 1)
    cell = np.minimum(place.astype(np.int64), N_PHASES - 2)
    of_next = probability * (place - cell)
    n_rows = phase[..., 0].size
    index = cell.reshape(n_rows, -1) + N_PHASES * np.arange(n_rows)[:, None]
    table = np.bincount(
        np.concatenate([index.ravel(), index.ravel() + 1]),
        np.concatenate([(probability - of_next).ravel(), of_next.ravel()]),
        n_rows * N_PHASES,
    )
    return np.asarray(table, dtype=np.float64).reshape(*phase.shape[:-1], N_PHASES)
