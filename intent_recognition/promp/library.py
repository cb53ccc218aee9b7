# SPDX-License-Identifier: Apache-2.0
"""The learned model: one interaction primitive per task, with timing, noise and the none model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers, read_only
from intent_recognition.errors import check_whole, first_of
from intent_recognition.gaussian import Gaussian
from intent_recognition.plots import Figure, by_unit, draw_bands, name_lines, new_panels
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.context import ContextModel, as_context
from intent_recognition.promp.coupling import ResidualCoupling
from intent_recognition.promp.interaction import InteractionProMP
from intent_recognition.promp.phase_deviation import STEADY, PhaseDeviation
from intent_recognition.promp.pose_regression import PoseRegression
from intent_recognition.promp.regressions import Regressions
from intent_recognition.promp.risk import NO_ODDS, LeftOutOdds
from intent_recognition.promp.trajectory import rollout
from intent_recognition.signals import OnsetSettings


@dataclass(frozen=True, repr=False)
class TaskLibrary:
    """K interaction primitives over P observed and Q controlled DOFs, N basis functions each.

    Weights are grouped by DOF, observed first (Maeda et al. 2014, Eq. 4); D = P + Q.

    Attributes:
        labels: names of the K tasks, sorted.
        basis: the basis functions.
        observed_names, controlled_names: names of the DOFs.
        observed_units, controlled_units: their units.
        weight_mean: (K, D N).
        weight_covariance: predictive covariance of the next demonstration's weights, (K, D N, D N).
        noise_variance: variance of the training residuals per DOF, (D,).
        noise_scale: factor of the observed DOFs' noise variance in the filter.
        correlation_time_s: time within which residuals count as one piece of evidence.
        log_duration_mean, log_duration_std: timing prior per task, log seconds, (K,).
        task_prior: probabilities p(s), (K,), which sum to one.
        transition_prior: p(next task | last task), (K + 1, K); the last row is for no last task.
        none_mean, none_covariance: observed weights of any human movement, (P N,), (P N, P N).
        none_log_duration: mean and standard deviation of the log duration of none, (2,).
        none_prior: prior probability that a movement is none of the tasks.
        none_margin: evidence of the known tasks against none that does not count, in nats.
        stop_margin: the same for movements that follow another without a rest; None for
            `none_margin`.
        switch_margin: evidence that a change of task must have over staying before it counts, in
            nats.
        n_demonstrations: number of demonstrations per task, (K,).
        observed_groups: number of DOFs of each observed signal, in order; they sum to P.
        onset: settings of onset detection, one per observed signal.
        duration_evidence: exponent of the evidence in the posterior of a movement's duration.
        task_evidence: exponent of the evidence of the tasks against each other.
        observed_weight_covariance: prior covariance of the observed weights in the filter, which
            differs between tasks only by the uncertainty of their means, (K, P N, P N); None for
            that in `weight_covariance`.
        phase_deviation: prior of a person's phase deviation from steady progress.
        evidence_freedom: degrees of freedom of the Student density that gives the evidence of an
            observation; infinite for the normal density.
        provenance: origin of the library: bags, settings, version, score.
        left_out_odds: odds of held-out demonstrations, which bound the risk of acting.
        context: dependence of the weights on the scene; None if none was learned, or if the weights
            are already conditioned on it (`given`).
        coupling: coupling of both agents' residuals; None for none.
        pose_regression: regression of the controlled agent's pose on the present state; None for
            none.
        regression_variance: variance of the coefficients in the regression of the controlled on the
            observed weights (`Regressions.uncertainty`).
        usual_log_duration: log seconds of the tasks' and none's usual durations, (K + 1,), for
            relative durations (`promp.steady_phase`); None for the means of their timing priors.
        displacement_exponent: the controlled agent's displacement is proportional to the relative
            duration to this power.
        delay_s: delay of the controlled agent behind the observed one, whatever the duration [s].
    """

    labels: tuple[str, ...]
    basis: NormalizedRBFBasis
    observed_names: tuple[str, ...]
    controlled_names: tuple[str, ...]
    observed_units: tuple[str, ...]
    controlled_units: tuple[str, ...]
    weight_mean: Floats
    weight_covariance: Floats
    noise_variance: Floats
    noise_scale: float
    correlation_time_s: float
    log_duration_mean: Floats
    log_duration_std: Floats
    task_prior: Floats
    transition_prior: Floats
    none_mean: Floats
    none_covariance: Floats
    none_log_duration: Floats
    none_prior: float
    n_demonstrations: Integers
    observed_groups: tuple[int, ...]
    onset: tuple[OnsetSettings, ...]
    duration_evidence: float = 1.0
    task_evidence: float = 1.0
    none_margin: float = 0.0
    switch_margin: float = 0.0
    observed_weight_covariance: Floats | None = None
    phase_deviation: PhaseDeviation = STEADY
    evidence_freedom: float = inf
    provenance: Mapping[str, object] = field(default_factory=dict)
    left_out_odds: LeftOutOdds = NO_ODDS
    context: ContextModel | None = None
    coupling: ResidualCoupling | None = None
    regression_variance: float = 0.0
    usual_log_duration: Floats | None = None
    displacement_exponent: float = 0.0
    delay_s: float = 0.0
    stop_margin: float | None = None
    pose_regression: PoseRegression | None = None

    def __repr__(self) -> str:
        """Tasks and sizes; the arrays are attributes."""
        counts = zip(self.labels, map(int, self.n_demonstrations), strict=True)
        tasks = first_of([f"{label} ({n} demonstration{'s' * (n != 1)})" for label, n in counts])
        return (
            f"<TaskLibrary: {tasks}; {self.n_observed} observed and {self.n_controlled} controlled"
            f" DOFs, {self.basis.n_basis} basis functions each>"
        )

    @property
    def context_names(self) -> tuple[str, ...]:
        """Names of the M numbers of the context; empty if there is no context to give."""
        return self.context.names if self.context else ()

    def given(self, context: ArrayLike) -> TaskLibrary:
        """The library with weights conditioned on a known context; the task prior is unchanged.

        The pose is no longer regressed on the present state.

        Args:
            context: M numbers in the order of `context_names`, (M,); NaN for unknown ones.

        Raises:
            ShapeError: `context` is not one number for each of `context_names`.
            ArgumentError: a number is infinite.
        """
        values = as_context(context, self.context_names)
        if self.context is None or np.all(np.isnan(values)):
            return self
        shift, reduction, scale = self.context.given(values)
        size, scale = self.n_observed_weights, scale[:, None, None]
        observed = self.observed_covariance[:-1] - reduction[:, :size, :size]
        return replace(
            self,
            weight_mean=self.weight_mean + shift,
            weight_covariance=scale * (self.weight_covariance - reduction),
            observed_weight_covariance=scale * observed,
            context=None,
            pose_regression=None,  # its share was chosen without knowing the context
        )

    @property
    def units(self) -> tuple[str, ...]:
        """Units of all DOFs, observed first, (D,)."""
        return (*self.observed_units, *self.controlled_units)

    @property
    def n_tasks(self) -> int:
        """Number of tasks K, without none."""
        return len(self.labels)

    @property
    def n_observed(self) -> int:
        """Number of observed DOFs P."""
        return len(self.observed_names)

    @property
    def n_controlled(self) -> int:
        """Number of controlled DOFs Q."""
        return len(self.controlled_names)

    @property
    def n_observed_weights(self) -> int:
        """Number of observed weights, P N."""
        return self.n_observed * self.basis.n_basis

    @property
    def durations_s(self) -> Floats:
        """Median duration of each task in seconds, (K,)."""
        return np.exp(self.log_duration_mean)

    @cached_property
    def usual_s(self) -> Floats:
        """Usual durations of the tasks and none, to which others are relative, (K + 1,) [s]."""
        usual = self.usual_log_duration
        if usual is None:
            usual = np.r_[self.log_duration_mean, self.none_log_duration[0]]
        return read_only(np.exp(usual))

    def in_durations(self, task: int, durations_s: Floats | float) -> Floats:
        """Matrices that convert controlled weights to durations (...), per DOF: (..., N, N)."""
        durations_s, usual_s = np.asarray(durations_s, dtype=np.float64), self.usual_s[task]
        factor = (durations_s / usual_s) ** self.displacement_exponent
        later = self.delay_s * (1.0 / durations_s - 1.0 / usual_s)
        return self.basis.shifting(later) @ self.basis.scaling(factor)

    def primitive(self, task: int) -> InteractionProMP:
        """Interaction primitive of the task with index `task`, at steady progress.

        Raises:
            ArgumentError: there is no such task.
        """
        check_whole("task", task, 0, "Pass a task's place in `labels`.", self.n_tasks - 1)
        return InteractionProMP(
            self.basis,
            Gaussian(self.weight_mean[task], self.weight_covariance[task]),
            self.n_observed,
            self.noise_variance,
            float(self.durations_s[task]),
        )

    def plot(self) -> Figure:
        """Draw each task's mean movement with bands of two standard deviations; needs matplotlib.

        Returns:
            The figure, with a column per task, and a row per agent and unit.
        """
        n, names = self.n_observed, (*self.observed_names, *self.controlled_names)
        rows = [("observed", *run) for run in by_unit(self.observed_units)]
        controlled = by_unit(self.controlled_units)
        rows += [("controlled", unit, [n + k for k in dofs]) for unit, dofs in controlled]
        figure, axes = new_panels(len(rows), self.n_tasks)
        for task, label in enumerate(self.labels):
            weights = Gaussian(self.weight_mean[task], self.weight_covariance[task])
            phase = np.linspace(0.0, 1.0, 101)
            course = rollout(
                self.basis, weights, phase, float(self.durations_s[task]), self.noise_variance
            )
            axes[0, task].set_title(label, parse_math=False)
            for row, (agent, unit, dofs) in enumerate(rows):
                panel, shown = axes[row, task], [names[k] for k in dofs]
                draw_bands(
                    panel, course.times_s, course.positions[:, dofs], course.std[:, dofs], shown
                )
                panel.set_ylabel(f"{agent} [{unit}]" if task == 0 else "")
        for panel in axes[:, -1]:
            name_lines(panel)
        return figure

    @cached_property
    def observed_mean(self) -> Floats:
        """Prior means of the observed weights of the tasks, then of none, (K + 1, P N)."""
        known = self.weight_mean[:, : self.n_observed_weights]
        return read_only(np.vstack([known, self.none_mean]))

    @cached_property
    def observed_covariance(self) -> Floats:
        """Prior covariances of the observed weights of the tasks, then none, (K + 1, P N, P N)."""
        size, known = self.n_observed_weights, self.observed_weight_covariance
        if known is None:
            known = self.weight_covariance[:, :size, :size]
        return read_only(np.concatenate([known, self.none_covariance[None]]))

    @cached_property
    def regressions(self) -> Regressions:
        """Regression of the controlled weights on the observed ones for each task.

        Only the observed weights are filtered. The controlled ones follow exactly as
        N(A w_o + b, u C), with u from `Regressions.uncertainty`.
        """
        parts = self.weight_mean, self.weight_covariance, self.n_observed_weights
        return Regressions(*parts, self.regression_variance)

    def observed_dofs(self, group: int, dofs: Sequence[int] | None = None) -> Integers:
        """Indices of the observed DOFs of a signal, (m,).

        Args:
            group: index of the observed signal.
            dofs: indices of its DOFs, counted from its first; None means all.
        """
        all_dofs = self._dofs_of_groups[group]
        return all_dofs if dofs is None else all_dofs[list(dofs)]

    @cached_property
    def _dofs_of_groups(self) -> tuple[Integers, ...]:
        ends = np.cumsum(self.observed_groups)[:-1]
        return read_only(tuple(np.split(np.arange(self.n_observed), ends)))

    def noise_covariance(self, dofs: Integers, interval_s: float) -> Floats:
        """Noise of one observation of the observed DOFs `dofs`, (m, m).

        Residuals are correlated in time. Samples closer together than `correlation_time_s` share
        one piece of evidence, so their noise variance grows in proportion to their rate.

        Args:
            dofs: indices of the observed DOFs, (m,).
            interval_s: time since the DOFs were last observed; infinite at the first.
        """
        crowding = max(1.0, self.correlation_time_s / max(interval_s, 1e-6))
        return np.diag(self.noise_variance[dofs] * (self.noise_scale * crowding))

    def control_noise_variance(self) -> Floats:
        """Residual variance of the controlled DOFs, (Q,)."""
        return self.noise_variance[self.n_observed :]
