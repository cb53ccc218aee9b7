# SPDX-License-Identifier: Apache-2.0
"""Many Gaussians over the weights, conditioned in place on one observation after the other.

Conditioning takes V^T V off a covariance, V = L^-1 H S being as many rows as there are observed
values (Maeda et al. 2014, Eq. 6, with L L^T = H S H^T + R). Subtracting that from every
covariance at every observation costs more in memory traffic than in arithmetic. So V is kept, and
the covariance in force is S - V^T V with the rows of several observations in V; only when they
are `PENDING_ROWS` are they subtracted, in one product of matrices. This is exact: the products
H S that the next observation needs are corrected for what is pending.
"""

import numpy as np

from intent_recognition.gaussian.linalg import (
    cholesky,
    log_normalizer,
    solve_lower_in_place,
)

PENDING_ROWS = 24
CACHE_FLOATS = 2**17
"""So many numbers at a time are subtracted from covariances: they stay in the core's cache."""


class FilterBlock:
    """n Gaussians over the weights of P DOFs with N basis functions each.

    Between `fold`s, `mean` and `covariance` lag behind what was observed.

    Attributes:
        mean: (n, P N), a part of the state.
        covariance: (n, P N, P N), the rest of it; symmetric to the last bit.
    """

    def __init__(self, state: np.ndarray, n_basis: int, pending: np.ndarray | None = None):
        """Take over the arrays.

        Args:
            state: covariance with the mean as one more column, (n, P N, P N + 1); see `make_state`.
                It is changed in place.
            n_basis: N.
            pending: working memory, (n, rows, P N + 1); None for new memory.
        """
        n, size, _ = state.shape
        self.mean, self.covariance = state[:, :, size], state[:, :, :size]
        self._n_basis, self._size = n_basis, size
        self._by_dof = state.reshape(n, -1, n_basis, size + 1)
        if pending is None:
            pending = np.empty((n, pending_rows(size // n_basis), size + 1))
        self._take_memory(pending)

    def _take_memory(self, pending: np.ndarray) -> None:
        # Of a row, the last element is minus the whitened innovation: what happens to the
        # products H S on the way to V happens to H m - y on the way to it.
        n, n_rows, _ = pending.shape
        self._pending, self._n_pending, self._limit = pending, 0, n_rows
        by_dof = pending[:, :, : self._size].reshape(n, n_rows, -1, self._n_basis)
        self._pending_by_dof = by_dof.transpose(0, 2, 1, 3)

    def condition(
        self, dofs: np.ndarray, rows: np.ndarray, values: np.ndarray, noise_covariance: np.ndarray
    ) -> np.ndarray:
        """Condition on one observation; on an error nothing has changed.

        Args:
            dofs: index of the DOF behind each observed value, (m,), in any order; one may come
                twice.
            rows: (n, m, N), or (n, 1, N) for one row that all DOFs share.
            values: (m,).
            noise_covariance: (m, m) or (n, m, m), positive definite.

        Returns:
            Log density of the observation under each Gaussian, (n,).

        Raises:
            ArgumentError: an innovation covariance is not positive definite.
        """
        m = len(values)
        if self._n_pending + m > self._limit:
            self.fold()
            if m > self._limit:
                self._take_memory(np.empty((len(self.mean), m, self._size + 1)))
        runs = _runs(dofs, rows)
        new = self._project(runs, values)
        first = self._n_pending
        innovation_covariance = self._times_rows(runs, slice(first, first + m), m)
        innovation_covariance += noise_covariance
        factor = cholesky(innovation_covariance, name="innovation covariance")
        solve_lower_in_place(factor, new)
        self._n_pending = first + m
        whitened = new[:, :, self._size]
        squares = np.matmul(whitened[:, None, :], whitened[:, :, None])[:, 0, 0]
        return -0.5 * squares - log_normalizer(factor)

    def _project(self, runs: list, values: np.ndarray) -> np.ndarray:
        """H S and, as the last column, H m - y of the distributions in force: (n, m, P N + 1)."""
        first, size = self._n_pending, self._size
        m = len(values)
        new = self._pending[:, first : first + m]
        for observed, dofs, row in runs:
            np.matmul(row[:, None, None], self._by_dof[:, dofs], out=new[:, observed, None])
        new[:, :, size] -= values
        if first:
            new -= np.matmul(self._times_rows(runs, slice(0, first), m), self._pending[:, :first])
        return new

    def _times_rows(self, runs: list, pending: slice, m: int) -> np.ndarray:
        """H V^T for some of the pending rows V, (n, m, rows)."""
        product = np.empty((len(self.mean), m, pending.stop - pending.start))
        for observed, dofs, row in runs:
            np.matmul(
                self._pending_by_dof[:, dofs, pending],
                row[:, None, :, None],
                out=product[:, observed, :, None],
            )
        return product

    def fold(self) -> None:
        """Bring mean and covariance up to date."""
        if not self._n_pending:
            return
        step = max(1, CACHE_FLOATS // self._size**2)
        work = np.empty((min(step, len(self.mean)), self._size, self._size))
        for start in range(0, len(self.mean), step):
            some = slice(start, start + step)
            mean, covariance = self.mean[some], self.covariance[some]
            change, shrink = self._pending_change(some, out=work[: len(mean)])
            mean -= change
            covariance -= shrink
        self._n_pending, self._limit = 0, self._pending.shape[1]

    def current(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means (k, P N) and covariances (k, P N, P N) of some, up to date; nothing changes."""
        change, shrink = self._pending_change(index)
        return self.mean[index] - change, self.covariance[index] - shrink

    def _pending_change(
        self, some: slice | np.ndarray, out: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is still to be subtracted from means and covariances."""
        pending = self._pending[some, : self._n_pending]
        weights = pending[:, :, : self._size]
        # numpy forms A^T A from one triangle, so that it is exactly symmetric.
        shrink = np.matmul(weights.transpose(0, 2, 1), weights, out=out)
        return np.matmul(pending[:, None, :, self._size], weights)[:, 0], shrink

    def fold_first_at(self, share: float) -> None:
        """Fold for the first time when a share of the working memory is in use."""
        self._limit = max(1, round(share * self._pending.shape[1]))


def make_state(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Means (n, d) and covariances (n, d, d) in one new array, (n, d, d + 1)."""
    return np.concatenate([covariance, mean[:, :, None]], axis=2)


def pending_rows(n_dofs: int) -> int:
    """Rows of working memory for P DOFs: room for two observations of all of them at least."""
    return max(PENDING_ROWS, 2 * n_dofs)


def _runs(dofs: np.ndarray, rows: np.ndarray) -> list[tuple[slice, slice, np.ndarray]]:
    """Observed values that are projected together: neighbouring DOFs which share one row.

    Returns:
        For each run, which values, which DOFs and their row, (n, N).
    """
    numbers, shared = dofs.tolist(), rows.shape[1] == 1
    first, m = numbers[0], len(numbers)
    if shared and numbers == list(range(first, first + m)):
        return [(slice(0, m), slice(first, first + m), rows[:, 0])]
    return [
        (slice(i, i + 1), slice(dof, dof + 1), rows[:, 0 if shared else i])
        for i, dof in enumerate(numbers)
    ]
