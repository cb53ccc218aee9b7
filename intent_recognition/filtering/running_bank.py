# SPDX-License-Identifier: Apache-2.0
"""The filtered hypotheses of a movement under way, in memory that is used again and again.

Whole tasks can be pruned: they keep the state they have, and cost nothing until they are restored.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ShapeError, describe
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement

Block = tuple[GaussianBatch, NDArray[np.float64]]
"""Weights of some hypotheses, and the probabilities of their phase deviations, (n, E)."""


class RunningBank:
    """T tasks (none among them) by S hypotheses each, over P DOFs with N basis functions.

    In memory the active tasks come first, so that they are filtered without being copied.

    Args:
        n_tasks: T.
        n_scales: S.
        n_dofs: P.
        n_basis: N.
        n_deviations: E values of the phase deviation.
    """

    def __init__(
        self, n_tasks: int, n_scales: int, n_dofs: int, n_basis: int, n_deviations: int = 1
    ):
        self.shape = (n_tasks, n_scales, n_dofs, n_basis, n_deviations)
        n, size = n_tasks * n_scales, n_dofs * n_basis
        # The system hands out memory when it is touched: now, not later.
        self._state = np.full((n, size + size * (size + 1) // 2), 0.0)
        self._deviation = np.ones((n, n_deviations))
        self._evidence = np.zeros(n)
        self._activate_all()

    def _activate_all(self) -> None:
        n_tasks, n_scales = self.shape[:2]
        self._task_at = np.arange(n_tasks)
        self._place_of = np.arange(n_tasks)
        self._hypothesis_at = np.arange(n_tasks * n_scales)
        self._moved = False
        self.n_active = n_tasks

    def _block(self, start: int, stop: int) -> GaussianBatch:
        return GaussianBatch(self._state[start:stop], self.shape[3])

    def start(
        self,
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
        deviation: NDArray[np.float64] | float = 1.0,
    ) -> None:
        """Begin with these distributions, shared by the hypotheses of a task, all active.

        Args:
            mean: (T, P N).
            covariance: (T, P N, P N).
            deviation: probability of each phase deviation, (E,).

        Raises:
            ShapeError: the arrays do not fit the bank.
        """
        n_tasks, n_scales, n_dofs, n_basis = self.shape[:4]
        size = n_dofs * n_basis
        if mean.shape != (n_tasks, size) or covariance.shape != (n_tasks, size, size):
            raise ShapeError(
                describe(
                    "mean, covariance",
                    f"shapes ({n_tasks}, {size}) and ({n_tasks}, {size}, {size})",
                    f"{mean.shape} and {covariance.shape}",
                    "Pass one distribution per task.",
                )
            )
        state = GaussianBatch.of(mean, covariance, n_basis).state
        self._state.reshape(n_tasks, n_scales, -1)[:] = state[:, None]
        self._evidence[:] = 0.0
        self._deviation[:] = deviation
        self._activate_all()

    @property
    def n_bytes(self) -> int:
        """Memory in use."""
        return self._state.nbytes + self._evidence.nbytes

    @property
    def active(self) -> NDArray[np.int64] | slice:
        """The hypotheses that are filtered, in the order in which `condition` wants their rows."""
        if not self._moved:
            return slice(None)
        return self._hypothesis_at[: self.n_active * self.shape[1]]

    @property
    def active_hypotheses(self) -> NDArray[np.int64]:
        """Their numbers."""
        return self._hypothesis_at[: self.n_active * self.shape[1]]

    @property
    def active_evidence(self) -> NDArray[np.float64]:
        """`log_evidence` of the active hypotheses, in the order of `active`."""
        return self._evidence[: self.n_active * self.shape[1]]

    @property
    def log_evidence(self) -> NDArray[np.float64]:
        """Log density of what each hypothesis was conditioned on, (T S,)."""
        if not self._moved:
            return self._evidence.copy()
        evidence = np.empty_like(self._evidence)
        evidence[self._hypothesis_at] = self._evidence
        return evidence

    def condition(
        self, measurement: LinearMeasurement
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Condition the active hypotheses on a measurement, as they take it in their order.

        Returns:
            Probability of each deviation, and what it was weighed with, (n, E) each.
        """
        n = self.n_active * self.shape[1]
        deviation = self._deviation[:n]
        density, likelihood = self._block(0, n).condition(measurement, deviation)
        self._evidence[:n] += density
        return deviation, likelihood

    def distributions(
        self, hypotheses: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Copies of means (n, P N) and covariances (n, P N, P N) of some hypotheses."""
        n_scales = self.shape[1]
        at = self._place_of[hypotheses // n_scales] * n_scales + hypotheses % n_scales
        return GaussianBatch(self._state, self.shape[3]).moments(at)

    def prune(self, tasks: NDArray[np.int64]) -> None:
        """Stop filtering some active tasks; their state stays as it is."""
        self.n_active -= len(tasks)
        leaving = tasks[self._place_of[tasks] < self.n_active]
        tail = self._task_at[self.n_active : self.n_active + len(tasks)]
        for task, other in zip(leaving, tail[~np.isin(tail, tasks)], strict=True):
            self._swap(self._place_of[task], self._place_of[other])

    def copies(self, tasks: NDArray[np.int64]) -> Block:
        """Copies of the hypotheses of pruned tasks, in their order."""
        n_scales = self.shape[1]
        at = (self._place_of[tasks][:, None] * n_scales + np.arange(n_scales)).ravel()
        return GaussianBatch(self._state[at], self.shape[3]), self._deviation[at]

    def gather(self, tasks: NDArray[np.int64]) -> Block:
        """Move pruned tasks next to the active ones, to be conditioned on what they missed.

        Returns:
            Their hypotheses, in the order of the tasks. `activate` ends this.
        """
        for place, task in enumerate(tasks, self.n_active):
            self._swap(self._place_of[task], place)
        first = self.n_active * self.shape[1]
        last = first + len(tasks) * self.shape[1]
        return self._block(first, last), self._deviation[first:last]

    def activate(self, tasks: NDArray[np.int64], log_density: NDArray[np.float64]) -> None:
        """Filter the tasks of the last `gather` again, conditioned on what they missed.

        Args:
            tasks: as they were given to `gather`.
            log_density: of what their hypotheses were conditioned on meanwhile, (n S,).
        """
        first = self.n_active * self.shape[1]
        self._evidence[first : first + len(log_density)] += log_density
        self.n_active += len(tasks)

    def _swap(self, a: int, b: int) -> None:
        """Exchange two tasks' places in memory."""
        if a == b:
            return
        self._moved = True
        n_scales = self.shape[1]
        one, other = (slice(p * n_scales, (p + 1) * n_scales) for p in (a, b))
        for array in (self._state, self._deviation, self._evidence, self._hypothesis_at):
            copy = array[one].copy()
            array[one] = array[other]
            array[other] = copy
        self._task_at[[a, b]] = self._task_at[[b, a]]
        self._place_of[self._task_at[[a, b]]] = [a, b]
