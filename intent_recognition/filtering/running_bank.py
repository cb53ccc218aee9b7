# SPDX-License-Identifier: Apache-2.0
"""The filtered hypotheses of a movement under way, in memory that is used again and again.

Hypotheses are filtered in blocks that fit the processor's cache. Whole tasks can be pruned: they
keep the state they have, and cost nothing until they are restored.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ShapeError, describe
from intent_recognition.filtering.conditioning import Step, condition_on
from intent_recognition.gaussian import GaussianBatch, pending_shape, state_width

BLOCK_SIZE = 512
"""Hypotheses in one block. Measured: the working set of a block stays in the cache."""

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
        self._state = np.empty((n, size, state_width(n_dofs, n_basis)))
        self._pending = np.empty((n, *pending_shape(n_dofs, n_basis)))
        for array in (self._state, self._pending):
            array.fill(0.0)  # the system hands out memory when it is touched: now, not later
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
        self._make_blocks()

    def _make_blocks(self) -> None:
        n = self.n_active * self.shape[1]
        n_blocks = -(-n // BLOCK_SIZE)
        edges = [n * k // n_blocks for k in range(n_blocks + 1)] if n_blocks else [0]
        self._blocks: list[tuple[int, int, GaussianBatch]] = []
        for k, (start, stop) in enumerate(pairwise(edges)):
            block = self._block(start, stop)
            # Blocks subtract what is pending one after the other, not all at one observation.
            block.first_downdate_at((k + 1) / n_blocks)
            self._blocks.append((start, stop, block))

    def _block(self, start: int, stop: int) -> GaussianBatch:
        some = slice(start, stop)
        return GaussianBatch(self._state[some], self.shape[3], self._pending[some])

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
        (n_tasks, n_scales), (_, size, width) = self.shape[:2], self._state.shape
        if mean.shape != (n_tasks, size) or covariance.shape != (n_tasks, size, size):
            raise ShapeError(
                describe(
                    "mean, covariance",
                    f"shapes ({n_tasks}, {size}) and ({n_tasks}, {size}, {size})",
                    f"{mean.shape} and {covariance.shape}",
                    "Pass one distribution per task.",
                )
            )
        state = self._state.reshape(n_tasks, n_scales, size, width)
        state[..., :size] = covariance[:, None]
        state[..., size] = mean[:, None]
        self._evidence[:] = 0.0
        self._deviation[:] = deviation
        self._activate_all()

    @property
    def n_bytes(self) -> int:
        """Memory in use."""
        return self._state.nbytes + self._pending.nbytes + self._evidence.nbytes

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

    def condition(self, step: Step) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Condition the active hypotheses on a measurement.

        Args:
            step: the measurement as the `active` hypotheses take it.

        Returns:
            Probability of each deviation, and what it was weighed with, (n, E) each.
        """
        n, weighed = self.n_active * self.shape[1], []
        for start, stop, block in self._blocks:
            some = slice(start, stop)
            part = step if stop - start == n else step.part(some)
            density, likelihood = condition_on(block, self._deviation[some], part)
            self._evidence[some] += density
            weighed.append(likelihood)
        return self._deviation[:n], weighed[0] if len(weighed) == 1 else np.concatenate(weighed)

    def apply_downdates(self) -> None:
        """Bring all means and covariances up to date with what was observed."""
        for _, _, block in self._blocks:
            block.apply_downdates()

    def catch_up(self) -> bool:
        """Apply a part of the downdates where many are pending; whether there were some."""
        return any(block.catch_up() for _, _, block in self._blocks)

    def distributions(
        self, hypotheses: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Copies of means (n, P N) and covariances (n, P N, P N) of some hypotheses, up to date."""
        n_scales = self.shape[1]
        at = self._place_of[hypotheses // n_scales] * n_scales + hypotheses % n_scales
        size = self._state.shape[1]
        mean, covariance = self._state[at, :, size], self._state[at, :, :size]
        for start, stop, block in self._blocks:
            inside = (at >= start) & (at < stop)
            if np.any(inside):
                mean[inside], covariance[inside] = block.current(at[inside] - start)
        return mean, covariance

    def prune(self, tasks: NDArray[np.int64]) -> None:
        """Stop filtering some active tasks; their state stays as it is."""
        self.apply_downdates()
        self.n_active -= len(tasks)
        leaving = tasks[self._place_of[tasks] < self.n_active]
        tail = self._task_at[self.n_active : self.n_active + len(tasks)]
        for task, other in zip(leaving, tail[~np.isin(tail, tasks)], strict=True):
            self._swap(self._place_of[task], self._place_of[other])
        self._make_blocks()

    def copies(self, tasks: NDArray[np.int64]) -> list[Block]:
        """Blocks over copies of the hypotheses of pruned tasks, in their order."""
        n_scales = self.shape[1]
        at = (self._place_of[tasks][:, None] * n_scales + np.arange(n_scales)).ravel()
        edges = range(0, len(at), BLOCK_SIZE)
        return [
            (GaussianBatch(self._state[some], self.shape[3]), self._deviation[some])
            for some in (at[k : k + BLOCK_SIZE] for k in edges)
        ]

    def gather(self, tasks: NDArray[np.int64]) -> list[Block]:
        """Move pruned tasks next to the active ones, to be conditioned on what they missed.

        Returns:
            Blocks over their hypotheses, in the order of the tasks. `activate` ends this.
        """
        for place, task in enumerate(tasks, self.n_active):
            self._swap(self._place_of[task], place)
        first = self.n_active * self.shape[1]
        last = first + len(tasks) * self.shape[1]
        edges = [(start, min(start + BLOCK_SIZE, last)) for start in range(first, last, BLOCK_SIZE)]
        return [(self._block(start, stop), self._deviation[start:stop]) for start, stop in edges]

    def activate(self, tasks: NDArray[np.int64], log_density: NDArray[np.float64]) -> None:
        """Filter the tasks of the last `gather` again, conditioned on what they missed.

        Args:
            tasks: as they were given to `gather`.
            log_density: of what their hypotheses were conditioned on meanwhile, (n S,).
        """
        self.apply_downdates()
        first = self.n_active * self.shape[1]
        self._evidence[first : first + len(log_density)] += log_density
        self.n_active += len(tasks)
        self._make_blocks()

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
