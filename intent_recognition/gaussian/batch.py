# SPDX-License-Identifier: Apache-2.0
"""Many Gaussians over the weights, conditioned in place on one observation after the other.

Conditioning takes V^T V off a covariance, V = L^-1 H S being as many rows as there are observed
values (Maeda et al. 2014, Eq. 6, with L L^T = H S H^T + R). Subtracting that from every
covariance at every observation costs more in memory traffic than in arithmetic. So V is kept, and
the covariance in force is S - V^T V with the rows of several observations in V; only when they
are `PENDING_ROWS` are they subtracted, in one product of matrices. This is exact: the products
H S that the next observation needs are corrected for what is pending.
"""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian.linalg import cholesky, student_log_density, symmetrize
from intent_recognition.gaussian.normal import Gaussian

PENDING_ROWS = 24
"""Rows of V kept before they are subtracted. Measured: about the least time (docs/speed.md)."""
CACHE_FLOATS = 2**16
"""Numbers subtracted from covariances at a time. Convention: half a megabyte fits the core's cache.
"""

N_PARTS = 4
"""Parts in which `GaussianBatch.catch_up` applies downdates. Convention: about as many observations
come between two that a filter uses."""

Run = tuple[slice, slice, NDArray[np.float64]]
"""Observed values that are projected together: which values, which DOFs, and their row (n, N)."""


class GaussianBatch:
    """n Gaussians over the weights of P DOFs with N basis functions each.

    `mean` and `covariance` lack what is pending until `apply_downdates`.

    Attributes:
        mean: (n, P N), a part of the state.
        covariance: (n, P N, P N), the rest of it; symmetric to the last bit.
    """

    def __init__(
        self,
        state: NDArray[np.float64],
        n_basis: int,
        pending: NDArray[np.float64] | None = None,
        n_pending: int = 0,
    ):
        """Take over the arrays.

        Args:
            state: what `make_state` gives, changed in place.
            n_basis: N.
            pending: working memory, (n, rows, columns), `pending_shape` or more; None for new
                memory.
            n_pending: rows of that memory which another batch over the same arrays has left.
        """
        n, size, width = state.shape
        self.mean, self.covariance = state[:, :, size], state[:, :, :size]
        self._n_basis, self._size, self._width = n_basis, size, width
        self._by_dof = state.reshape(n, size // n_basis, n_basis, width)
        if pending is None:
            pending = np.empty((n, *pending_shape(size // n_basis, n_basis)))
        self._take_memory(pending)
        self._n_pending = n_pending

    @property
    def n_pending(self) -> int:
        """Rows of the working memory that are still to be subtracted."""
        return self._n_pending

    def _take_memory(self, pending: NDArray[np.float64]) -> None:
        # A row holds one of V, the negative whitened innovation, and one of L^T: what turns H S
        # into V turns H m - y and the innovation covariance into these.
        n, n_rows, n_columns = pending.shape
        self._pending, self._n_pending, self._limit = pending, 0, n_rows
        self._n_up_to_date = 0
        self._most_values = min(n_rows, n_columns - self._size - 1)
        by_dof = pending[:, :, : self._size]
        by_dof = by_dof.reshape(n, n_rows, self._size // self._n_basis, self._n_basis)
        self._pending_by_dof = by_dof.transpose(0, 2, 1, 3)

    def condition(
        self,
        dofs: NDArray[np.int64],
        rows: NDArray[np.float64],
        values: NDArray[np.float64],
        noise_covariance: NDArray[np.float64],
        degrees_of_freedom: float = inf,
    ) -> NDArray[np.float64]:
        """Condition on one observation; on an error nothing has changed.

        Args:
            dofs: index of the DOF behind each observed value, (m,), in any order; one may come
                twice.
            rows: (n, m, N), or (n, 1, N) for one row that all DOFs share.
            values: (m,), or (n, m) for values of their own.
            noise_covariance: (m, m) or (n, m, m), positive definite.
            degrees_of_freedom: of the density that is returned, Student's; infinite for the normal
                one. The distributions are conditioned alike.

        Returns:
            Log density of the observation under each Gaussian, (n,).

        Raises:
            ArgumentError: an innovation covariance is not positive definite.
        """
        m = np.shape(values)[-1]
        if self._n_pending + m > self._limit or m > self._most_values:
            self.apply_downdates()
            if m > self._most_values:
                columns = self._size + 1 + m
                self._take_memory(np.empty((len(self.mean), m, max(columns, self._width))))
        runs = _runs(dofs, rows)
        first, new = self._n_pending, self._project(runs, values)
        own = new[:, :, self._size + 1 : self._size + 1 + m]  # the innovation covariance
        self._times_rows(runs, slice(first, first + m), own)
        own += noise_covariance
        with np.errstate(invalid="ignore", divide="ignore"):
            _whiten(new, own)
            log_scale = np.add.reduce(np.log(np.diagonal(own, axis1=1, axis2=2)), axis=1)
        if not isfinite(np.add.reduce(log_scale)):
            self._refuse(runs, values, noise_covariance)
        self._n_pending, self._n_up_to_date = first + m, 0
        whitened = new[:, :, self._size]
        squares = np.matmul(whitened[:, None, :], whitened[:, :, None])[:, 0, 0]
        return student_log_density(squares, log_scale, m, degrees_of_freedom)

    def predicted(
        self, dofs: NDArray[np.int64], row: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What is known of some DOFs before an observation; nothing changes.

        Args:
            dofs: which DOFs, (m,).
            row: of the basis functions, one for all DOFs, (n, N).

        Returns:
            Mean weights of the DOFs, (n, m, N), and covariance of their values, (n, m, m).
        """
        m, size, pending = len(dofs), self._size, self._pending[:, : self._n_pending]
        runs = _runs(dofs, row[:, None])
        cross = np.empty((len(row), m, size))
        for observed, some, _ in runs:
            known = self._by_dof[:, some, :, :size]
            np.matmul(row[:, None, None], known, out=cross[:, observed, None])
        by_dof = cross.reshape(len(row), m, -1, self._n_basis)
        covariance = np.matmul(by_dof, row[:, None, :, None])[:, :, dofs, 0]
        mean = self.mean
        if self._n_pending:
            product = np.empty((len(row), m, self._n_pending))
            self._times_rows(runs, slice(0, self._n_pending), product)
            covariance -= np.matmul(product, product.transpose(0, 2, 1))
            mean = mean - np.matmul(pending[:, None, :, size], pending[:, :, :size])[:, 0]
        return mean.reshape(len(row), -1, self._n_basis)[:, dofs], covariance

    def _refuse(
        self, runs: list[Run], values: NDArray[np.float64], noise_covariance: NDArray[np.float64]
    ) -> None:
        """Raise the error of an innovation covariance that is not positive definite."""
        m = np.shape(values)[-1]
        self._project(runs, values)
        own = np.empty((len(self.mean), m, m))
        self._times_rows(runs, slice(self._n_pending, self._n_pending + m), own)
        cholesky(own + noise_covariance, name="innovation covariance")

    def _project(self, runs: list[Run], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """H S and, after it, H m - y of the distributions in force: (n, m, columns)."""
        first, m = self._n_pending, np.shape(values)[-1]
        new = self._pending[:, first : first + m]
        known = new[:, :, : self._width]
        for observed, dofs, row in runs:
            np.matmul(row[:, None, None], self._by_dof[:, dofs], out=known[:, observed, None])
        known[:, :, self._size] -= values
        if first:
            product = np.empty((len(new), m, first))
            self._times_rows(runs, slice(0, first), product)
            known -= np.matmul(product, self._pending[:, :first, : self._width])
        return new

    def _times_rows(self, runs: list[Run], pending: slice, out: NDArray[np.float64]) -> None:
        """H V^T for some of the pending rows V, (n, m, rows)."""
        for observed, dofs, row in runs:
            np.matmul(
                self._pending_by_dof[:, dofs, pending],
                row[:, None, :, None],
                out=out[:, observed, :, None],
            )

    def apply_downdates(self) -> None:
        """Bring mean and covariance up to date."""
        if self._n_pending:
            self._apply(slice(self._n_up_to_date, len(self.mean)))
        self._n_pending, self._n_up_to_date = 0, 0
        self._limit = self._pending.shape[1]

    def catch_up(self) -> bool:
        """Apply a part of the downdates if half of the working memory is in use.

        Called while there is time, it spares an observation the work, and what the rows cost that
        are still pending.

        Returns:
            Whether there was something to do.
        """
        if 2 * self._n_pending < self._limit:
            return False
        first, n = self._n_up_to_date, len(self.mean)
        some = slice(first, first + -(-n // N_PARTS))
        if some.stop >= n:
            self.apply_downdates()
        else:
            self._apply(some)
            self._pending[some, : self._n_pending] = 0.0
            self._n_up_to_date = some.stop
        return True

    def _apply(self, some: slice) -> None:
        """Subtract what is pending for some."""
        step = max(1, CACHE_FLOATS // self._size**2)
        work = np.empty((step, self._size, self._size))
        for start in range(some.start, some.stop, step):
            few = slice(start, min(start + step, some.stop))
            mean, covariance = self.mean[few], self.covariance[few]
            change, downdate = self._pending_change(few, out=work[: len(mean)])
            mean -= change
            covariance -= downdate

    def current(self, index: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Means (k, P N) and covariances (k, P N, P N) of some, up to date; nothing changes."""
        change, downdate = self._pending_change(index)
        return self.mean[index] - change, self.covariance[index] - downdate

    def part(self, index: NDArray[np.int64]) -> "GaussianBatch":
        """Some of them as they are now, a copy."""
        state = self._by_dof[index].reshape(len(index), self._size, self._width)
        pending = self._pending[index, : self._n_pending]
        return GaussianBatch(state, self._n_basis, pending, self._n_pending)

    def mixture(self, weight: NDArray[np.float64]) -> Gaussian:
        """Mean and covariance of their mixture, up to date.

        Args:
            weight: probability of each, (n,).
        """
        root = np.sqrt(weight)
        pending = self._pending[:, : self._n_pending, : self._size]
        change = np.matmul(self._pending[:, None, : self._n_pending, self._size], pending)
        means = self.mean - change[:, 0]
        mean = weight @ means
        apart = (means - mean) * root[:, None]
        downdate = (pending * root[:, None, None]).reshape(-1, self._size)
        covariance = np.tensordot(weight, self._by_dof, axes=1)
        covariance = covariance.reshape(self._size, self._width)[:, : self._size]
        return Gaussian(mean, symmetrize(covariance - downdate.T @ downdate + apart.T @ apart))

    def _pending_change(
        self, some: slice | NDArray[np.int64], out: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What is still to be subtracted from means and covariances."""
        pending = self._pending[some, : self._n_pending]
        weights = pending[:, :, : self._size]
        # numpy forms A^T A from one triangle, so that it is exactly symmetric.
        downdate = np.matmul(weights.transpose(0, 2, 1), weights, out=out)
        return np.matmul(pending[:, None, :, self._size], weights)[:, 0], downdate

    def first_downdate_at(self, share: float) -> None:
        """Apply the first downdates when this share of the working memory is in use."""
        self._limit = max(1, round(share * self._pending.shape[1]))


def state_width(n_dofs: int, n_basis: int) -> int:
    """Columns of a state: covariance, mean, and room for innovation covariances of P values."""
    return n_dofs * n_basis + 1 + n_dofs


def pending_shape(n_dofs: int, n_basis: int) -> tuple[int, int]:
    """Rows and columns of working memory: two observations of all DOFs fit in at least."""
    return max(PENDING_ROWS, 2 * n_dofs), state_width(n_dofs, n_basis)


def make_state(
    mean: NDArray[np.float64], covariance: NDArray[np.float64], n_basis: int
) -> NDArray[np.float64]:
    """Means (n, P N) and covariances (n, P N, P N) as the state of a batch, a copy."""
    n, size = mean.shape
    state = np.zeros((n, size, state_width(size // n_basis, n_basis)))
    state[:, :, :size], state[:, :, size] = covariance, mean
    return state


def _whiten(rows: NDArray[np.float64], innovation_covariance: NDArray[np.float64]) -> None:
    """Multiply rows (n, m, k) by L^-1 from the left, in place.

    L L^T = S is the innovation covariance, itself m of their columns, which become L^T: steps of
    Gauss' elimination, each vectorised over all n and all columns.

    Args:
        rows: changed.
        innovation_covariance: view of the columns that hold S, (n, m, m); only its upper triangle
            is used.
    """
    m = rows.shape[1]
    for i in range(m):
        row = rows[:, i]
        row /= np.sqrt(innovation_covariance[:, i, i])[:, None]
        if i + 1 < m:
            rows[:, i + 1 :] -= innovation_covariance[:, i, i + 1 :, None] * row[:, None, :]


def _runs(dofs: NDArray[np.int64], rows: NDArray[np.float64]) -> list[Run]:
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
