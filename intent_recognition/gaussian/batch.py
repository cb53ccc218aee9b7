# SPDX-License-Identifier: Apache-2.0
"""Many Gaussians over the weights, conditioned in place on one measurement after the other.

Weights and phase deviation are conditioned together. First, each phase deviation is weighted by the
likelihood of the measurement under it. Then the weights are conditioned once, at the expected basis
functions; the covariance that the uncertain phase induces is added to the noise (assumed-density
filtering). With a single deviation this is the exact update (Maeda et al. 2014, Eq. 6).

The compiled `_kernel.c` does the work where it was built, else `_condition`, its equal in numpy.
"""

import os
from functools import cache
from importlib import import_module
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian.linalg import (
    cholesky,
    half_log_det,
    solve_lower,
    student_log_density,
)
from intent_recognition.gaussian.normal import Gaussian

KERNEL = os.environ.get("INTENT_KERNEL", "")
"""The update in use, "c" or "numpy": as INTENT_KERNEL demands, else "c" where it was built."""
if KERNEL not in ("", "c", "numpy"):
    raise ArgumentError.about("INTENT_KERNEL", "c or numpy", KERNEL, "Unset it.")
if KERNEL != "numpy":
    try:
        _compiled, KERNEL = import_module("intent_recognition.gaussian._kernel").condition, "c"
    except ImportError as error:
        if KERNEL == "c":
            cure = "Install a C compiler and the package again, or unset it."
            found = "INTENT_KERNEL", "a compiled update", f"none ({error})", cure
            raise ArgumentError.about(*found) from error
        KERNEL = "numpy"


class LinearMeasurement(NamedTuple):
    """One measurement y = H w + e of m values, for n Gaussians over the weights."""

    dofs: Integers  # index of the DOF of each value, (m,), in any order; a DOF may occur twice
    rows: Floats  # basis functions at each phase deviation, the same for all DOFs, (n, E, N)
    values: Floats  # (m,), or (n, m) if they differ between the Gaussians
    noise_covariance: Floats  # positive definite, (m, m), or (n, m, m) if it differs between them
    # transition matrices of the deviation since the last measurement, (n, E, E); None at the first
    transition: Floats | None = None
    exponent: float = 1.0  # power of the likelihood in the posterior of the deviation
    degrees_of_freedom: float = inf  # those of a Student density; infinite for the normal density


class GaussianBatch:
    """n Gaussians over the D = P N weights of P DOFs with N basis functions each.

    Attributes:
        state: one row per Gaussian, (n, `state_width`): its mean, then the upper triangle of its
            covariance line by line, so that the covariance is symmetric to the last bit.
        mean: means, (n, D), a view of `state`.
    """

    def __init__(self, state: Floats, n_dofs: int, n_basis: int):
        self.state, self._shape, self._size = state, (n_dofs, n_basis), n_dofs * n_basis
        self.mean = state[:, : self._size]

    @classmethod
    def of(cls, mean: Floats, covariance: Floats, n_basis: int) -> "GaussianBatch":
        """Batch with copies of means (n, D) and covariances (n, D, D)."""
        state = np.concatenate([mean, _packed(covariance)], axis=1)
        return cls(state, mean.shape[1] // n_basis, n_basis)

    def moments(self, index: Integers | slice = slice(None)) -> tuple[Floats, Floats]:
        """Copies of the means (k, D) and covariances (k, D, D) of k selected Gaussians."""
        state, size = self.state[index], self._size
        covariance = np.take(state, _layout(size)[1].ravel(), axis=1)
        return state[:, :size].copy(), covariance.reshape(len(state), size, size)

    def mixture(self, weight: Floats) -> Gaussian:
        """Moments of the mixture with these weights, (n,) (Ewerton et al. 2015, Eq. 14)."""
        both = weight @ self.state
        mean = both[: self._size]
        apart = (self.mean - mean) * np.sqrt(weight)[:, None]
        return Gaussian(mean, both[_layout(self._size)[1]] + apart.T @ apart)

    def resized(
        self, index: Integers | slice, n_basis: int, variance: Floats | None = None
    ) -> "GaussianBatch":
        """Copy Gaussians R times, cut to M weights per DOF or extended to M by independent ones.

        Args:
            index: the Gaussians to copy.
            n_basis: weights per DOF of a copy, M.
            variance: variances of the new weights of mean zero, (R, P, M - N); None for R = 1.
        """
        (n_dofs, old), rows = self._shape, self.state[index]
        zero_first = np.concatenate([np.zeros((len(rows), 1)), rows], axis=1)
        state = np.take(zero_first, _resizing(n_dofs, old, n_basis), axis=1)
        if variance is not None:
            diagonal = np.diagonal(_layout(n_dofs * n_basis)[1]).reshape(n_dofs, n_basis)
            state = np.repeat(state, len(variance), axis=0)
            of_each = state.reshape(-1, len(variance), state.shape[1])
            of_each[..., diagonal[:, old:]] = variance
        return GaussianBatch(state, n_dofs, n_basis)

    def condition(
        self,
        measurement: LinearMeasurement,
        deviation: Floats | None = None,
        index: Integers | None = None,
    ) -> tuple[Floats, Floats]:
        """Condition k Gaussians on a measurement, in place; an error leaves them unchanged.

        Args:
            measurement: with rows for the k Gaussians only.
            deviation: probability of each phase deviation, (n, E), updated in place; None for one.
            index: the Gaussians to condition, (k,), without repeats; None for all.

        Returns:
            Log density of the measurement, (k,), and the factor by which the probability of each
            deviation was multiplied before it was normalised, (k, E).

        Raises:
            ShapeError: the arrays do not fit each other.
            ArgumentError: a number is not finite, or an innovation covariance is not positive
                definite.
        """
        if deviation is None:
            deviation = np.ones((len(self.state), 1))
        n, n_deviations = len(self.state) if index is None else len(index), deviation.shape[1]
        one = _checked(measurement, n, n_deviations, self._shape[1])
        if KERNEL != "c":
            return _condition(self, one, deviation, np.arange(n) if index is None else index)
        found = np.empty(n), np.empty((n, n_deviations))
        refused = _compiled(self.state, index, deviation, *one[:5], *found, *self._shape, *one[5:])
        if refused >= 0:
            expected, got = "a finite positive definite matrix", f"none for number {refused}"
            cure = "Leave out what is not finite, or raise the noise variance."
            raise ArgumentError.about("innovation covariance", expected, got, cure)
        return found


@cache
def _layout(size: int) -> tuple[Integers, Integers]:
    """Layout of the stored upper triangle of a covariance of D weights.

    Columns are padded to a multiple of four. Four lines at a time begin at the same column, so that
    the compiled update can handle them together.

    Returns:
        Flat indices of the stored elements in the padded covariance, in the order of storage; and
        the index of each element of the covariance in a state, (D, D).
    """
    line, column = np.arange(size)[:, None], np.arange(-(-size // 4) * 4)
    stored = column >= line // 4 * 4
    upper = np.triu((size - 1 + np.cumsum(stored).reshape(stored.shape))[:, :size])
    return np.flatnonzero(stored), upper + np.triu(upper, 1).T


def _packed(covariance: NDArray) -> NDArray:
    """Stored elements of covariances (n, D, D), one row each."""
    n, size, _ = covariance.shape
    whole = np.pad(covariance, ((0, 0), (0, 0), (0, -size % 4)))
    return np.take(whole.reshape(n, -1), _layout(size)[0], axis=1)


@cache
def _resizing(n_dofs: int, old: int, new: int) -> Integers:
    """Places, counted from 1, of the elements of a resized state in the old one; 0 for new ones.

    `old` and `new` are the weights per DOF.
    """
    kept = np.zeros((n_dofs, new), dtype=np.int64)
    kept[:, :old] = 1 + np.arange(n_dofs * old).reshape(n_dofs, old)[:, :new]
    places = np.pad(1 + _layout(n_dofs * old)[1], ((1, 0), (1, 0)))
    return np.append(kept, _packed(places[np.ix_(kept.ravel(), kept.ravel())][None]))


@cache
def state_width(size: int) -> int:
    """Length of the state of a Gaussian over D weights."""
    return size + len(_layout(size)[0])


def _checked(
    measurement: LinearMeasurement, n: int, n_deviations: int, n_basis: int
) -> LinearMeasurement:
    """Measurement with contiguous arrays of the types that the update reads, shapes checked."""
    m, transition = len(measurement.dofs), measurement.transition
    dofs = np.ascontiguousarray(measurement.dofs, dtype=np.int64)
    rows, values, noise = (
        np.ascontiguousarray(array, dtype=np.float64) for array in measurement[1:4]
    )
    if transition is not None:
        transition = np.ascontiguousarray(transition, dtype=np.float64)
    if not (
        rows.shape == (n, n_deviations, n_basis)
        and values.shape in ((m,), (n, m))
        and noise.shape in ((m, m), (n, m, m))
        and (transition is None or transition.shape == (n, n_deviations, n_deviations))
    ):
        expected = f"rows ({n}, {n_deviations}, {n_basis}), values ({m},), noise ({m}, {m})"
        got = f"{rows.shape}, {values.shape} and {noise.shape}"
        cure = "Pass one value and one row and column of noise per entry of dofs."
        raise ShapeError.about("measurement", expected, got, cure)
    return LinearMeasurement(dofs, rows, values, noise, transition, *measurement[5:])


def _condition(
    batch: GaussianBatch, measurement: LinearMeasurement, deviation: Floats, index: Integers
) -> tuple[Floats, Floats]:
    """The update of `_kernel.c` in numpy."""
    dofs, rows, values, noise, transition, exponent, freedom = measurement
    mean, covariance = batch.moments(index)
    n, size, n_basis = *mean.shape, rows.shape[2]
    n_dofs = size // n_basis
    blocks = covariance.reshape(n, n_dofs, n_basis, size)[:, dofs]
    known = mean.reshape(n, n_dofs, n_basis)[:, dofs].swapaxes(1, 2)

    def whitened(row, noise, innovation):  # type: ignore[no-untyped-def]
        """L^-1 [H C, innovation] for S = L L^T and innovations (n, m, k); half of log det S."""
        cross = np.matmul(row[:, None, None], blocks)[:, :, 0]
        by_dof = cross.reshape(n, len(dofs), n_dofs, n_basis)[:, :, dofs]
        own = np.matmul(by_dof, row[:, None, :, None])[..., 0]
        factor = cholesky(own + noise, name="innovation covariance")
        found = solve_lower(factor, np.concatenate([cross, innovation], axis=2))
        return found, half_log_det(factor)

    apart = values[..., None, :] - np.matmul(rows, known)  # (n, E, m)
    moved = deviation[index]
    if transition is not None:
        moved = np.matmul(moved[:, None], transition)[:, 0]
    row = np.matmul(moved[:, None], rows)[:, 0]
    found, log_scale = whitened(row, noise, apart.swapaxes(1, 2))
    squares = np.sum(found[:, :, size:] ** 2, axis=1)
    density = student_log_density(squares, log_scale[:, None], len(dofs), freedom)
    best = density.max(axis=1, keepdims=True)
    evidence = np.log(np.sum(moved * np.exp(density - best), axis=1)) + best[:, 0]
    likelihood = np.exp(exponent * (density - best))
    moved = moved * likelihood
    moved /= moved.sum(axis=1, keepdims=True)
    if rows.shape[1] > 1:  # with a single deviation, `found` is final: no phase uncertainty
        row = np.matmul(moved[:, None], rows)[:, 0]
        expected = np.matmul(moved[:, None], apart)
        apart -= expected
        induced = np.matmul((apart * moved[..., None]).swapaxes(1, 2), apart)
        found, _ = whitened(row, noise + induced, expected.swapaxes(1, 2))
    if not np.all(np.isfinite(found)):
        cure = "Leave out what is not finite."
        raise ArgumentError.about("innovation covariance", "finite numbers", "others", cure)
    cross, innovation = found[:, :, :size], found[:, :, size:]
    batch.state[index, :size] += np.matmul(innovation.swapaxes(1, 2), cross)[:, 0]
    batch.state[index, size:] -= _packed(np.matmul(cross.swapaxes(1, 2), cross))
    deviation[index] = moved
    return evidence, likelihood
