# SPDX-License-Identifier: Apache-2.0
"""The samples of several signals as one stream of observations, in the order of their stamps."""

from collections.abc import Iterable

import numpy as np

from intent_recognition.errors import ArgumentError, describe
from intent_recognition.filtering.bank import FilterBank, check_observation
from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.pruning import PrunedBank, Step
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.gaussian import Gaussian
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Observation

PRUNE_FROM = 128
"""Fewer hypotheses are filtered in less time than it takes to choose among them."""


def group_dofs(library: TaskLibrary, group: int) -> np.ndarray:
    """Indices of the observed DOFs of a signal, (m,)."""
    start = sum(library.observed_groups[:group])
    return np.arange(start, start + library.observed_groups[group])


def observation_rows(
    library: TaskLibrary, hypotheses: Hypotheses, step: Step, index: np.ndarray | slice
) -> np.ndarray:
    """Rows of the observation matrix under some hypotheses, the same for all DOFs: (n, 1, N)."""
    phase = hypotheses.phase(step.elapsed_s)[index]
    if not step.derivative:
        return library.basis.design_matrix(phase)[:, None]
    rate = hypotheses.phase_rate(step.elapsed_s)[index]
    return (library.basis.derivative_matrix(phase) * rate[:, None])[:, None]


def make_memory(library: TaskLibrary, hypotheses: Hypotheses) -> RunningBank:
    """Memory for one `BankRun` after the other."""
    return RunningBank(*_shape(library, hypotheses))


def _shape(library: TaskLibrary, hypotheses: Hypotheses) -> tuple[int, int, int, int]:
    n_tasks = len(hypotheses.duration_s) // hypotheses.n_scales
    return n_tasks, hypotheses.n_scales, library.n_observed, library.basis.n_basis


class BankRun:
    """A bank that takes one observation after the other, and minds when each DOF was last used.

    Args:
        library: the learned tasks.
        hypotheses: the bank's grid.
        bank: the bank at onset; None for the library's priors.
        onset_ns: stamp from which phases count.
        memory: that of another run which is over, to be used again; None for new memory.
        prune: do not filter tasks whose posterior is negligible (`pruning`), when there are many.
        task_weight: what the posterior of the known tasks may be multiplied by, (K,); see there.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: Hypotheses,
        bank: FilterBank | None,
        onset_ns: int,
        *,
        memory: RunningBank | None = None,
        prune: bool = False,
        task_weight: np.ndarray | None = None,
    ):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        fits = memory is not None and memory.shape == _shape(library, hypotheses)
        self.memory = memory if fits else make_memory(library, hypotheses)
        self._evidence_before = 0.0
        if bank is None:
            self.memory.start(library.observed_mean, library.observed_covariance)
        else:
            self.memory.start(bank.mean, bank.covariance)
            self._evidence_before = bank.log_evidence
        self._dofs = [group_dofs(library, k) for k in range(len(library.observed_groups))]
        self._last_ns: list[int | None] = [None] * library.n_observed
        self._pruned: PrunedBank | None = None
        if prune and len(hypotheses.duration_s) >= PRUNE_FROM:
            prior = hypotheses.log_prior + self._evidence_before
            self._pruned = PrunedBank(self.memory, prior, self._rows, task_weight)

    def _rows(self, step: Step, index: np.ndarray | slice) -> np.ndarray:
        return observation_rows(self.library, self.hypotheses, step, index)

    def observe(self, observation: Observation) -> None:
        """Condition the bank on an observation.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: velocities without a covariance.
        """
        step = self._step(observation)
        check_observation(step.dofs, step.values, step.noise_covariance)
        if self._pruned is None:
            rows = self._rows(step, slice(None))
            self.memory.condition(step.dofs, rows, step.values, step.noise_covariance)
        else:
            self._pruned.condition(step)
        if not observation.derivative:
            for dof in step.dofs:
                self._last_ns[dof] = observation.stamp_ns

    def dofs_of(self, observation: Observation) -> np.ndarray:
        """Indices of the observed DOFs that an observation is of, (m,)."""
        dofs = self._dofs[observation.group]
        return dofs if observation.dofs is None else dofs[list(observation.dofs)]

    def _step(self, observation: Observation) -> Step:
        dofs = self.dofs_of(observation)
        elapsed_s = (observation.stamp_ns - self.onset_ns) * 1e-9
        noise = observation.covariance
        if not observation.derivative:
            last_ns = [self._last_ns[dof] for dof in dofs if self._last_ns[dof] is not None]
            interval_s = (observation.stamp_ns - max(last_ns)) * 1e-9 if last_ns else np.inf
            learned = self.library.noise_covariance(dofs, interval_s)
            noise = learned if noise is None else learned + noise
        elif noise is None:
            raise ArgumentError(
                describe(
                    "observation",
                    "a covariance with measured velocities",
                    "none",
                    "Pass the sensor's: noise is learned for positions only.",
                )
            )
        return Step(elapsed_s, dofs, observation.derivative, observation.values, noise)

    @property
    def log_evidence(self) -> np.ndarray:
        """Log density of all observations under each hypothesis, (B,); a bound where pruned."""
        source = self.memory if self._pruned is None else self._pruned
        return source.log_evidence + self._evidence_before

    @property
    def pruned_tasks(self) -> np.ndarray:
        """Numbers of the tasks that are not filtered for now."""
        return np.empty(0, int) if self._pruned is None else self._pruned.pruned_tasks

    @property
    def bank(self) -> FilterBank:
        """A copy of the whole bank, pruned tasks replayed."""
        return self._copy(np.arange(len(self.hypotheses.duration_s)))

    def task(self, task: int) -> FilterBank:
        """A copy of the hypotheses of one task, replayed if it was pruned: (S, ...)."""
        n_scales = self.hypotheses.n_scales
        return self._copy(np.arange(task * n_scales, (task + 1) * n_scales))

    def moments(self, task: int, scale_weights: np.ndarray) -> Gaussian:
        """Observed weights given a task, durations marginalised by matching moments.

        Args:
            task: number of the task.
            scale_weights: p(duration | task), (S,).
        """
        if self._pruned is not None:
            self._pruned.restore(np.intersect1d([task], self._pruned.pruned_tasks))
        return Gaussian(*self.memory.moments(task, scale_weights))

    def _copy(self, index: np.ndarray) -> FilterBank:
        if self._pruned is not None:
            tasks = np.unique(index // self.hypotheses.n_scales)
            self._pruned.restore(np.intersect1d(tasks, self._pruned.pruned_tasks))
        mean, covariance = self.memory.distributions(index)
        return FilterBank(mean, covariance, self.log_evidence[index])


def run_bank(
    library: TaskLibrary,
    hypotheses: Hypotheses,
    bank: FilterBank,
    observations: Iterable[Observation],
    onset_ns: int,
) -> FilterBank:
    """Condition the bank on a stretch of observations that begins at onset."""
    run = BankRun(library, hypotheses, bank, onset_ns)
    for observation in observations:
        run.observe(observation)
    return run.bank
