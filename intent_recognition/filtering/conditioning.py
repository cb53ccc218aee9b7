# SPDX-License-Identifier: Apache-2.0
"""Weights and phase deviation of hypotheses, conditioned together on one observation.

An observation weighs the deviations by how well each explains it. The weights are then conditioned
on it once, at the expected basis functions, with the covariance that the uncertain phase induces as
additional noise (assumed-density filtering). At steady progress there is a single deviation, and
this is the exact update (Maeda et al. 2014, Eq. 6).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import (
    GaussianBatch,
    cholesky,
    solve_lower,
    student_log_density,
    symmetrize,
)


class Step(NamedTuple):
    """One measurement, as n hypotheses take it.

    Attributes:
        dofs: index of the observed DOF behind each value, (m,).
        rows: of the basis functions at each phase deviation, shared by the DOFs, (n, E, N).
        values: (m,), or (n, m) for values of their own.
        noise_covariance: (m, m).
        transition: of the deviation since the measurement before, (n, E, E); None at the first one.
        exponent: of the evidence in the posterior of the deviation.
        degrees_of_freedom: of the density that the evidence is computed with.
    """

    dofs: NDArray[np.int64]
    rows: NDArray[np.float64]
    values: NDArray[np.float64]
    noise_covariance: NDArray[np.float64]
    transition: NDArray[np.float64] | None
    exponent: float
    degrees_of_freedom: float

    def part(self, some: slice) -> "Step":
        """The step of some of the hypotheses."""
        moved = None if self.transition is None else self.transition[some]
        return self._replace(rows=self.rows[some], transition=moved)


def condition_on(
    weights: GaussianBatch, deviation: NDArray[np.float64], step: Step
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Condition hypotheses on a measurement, in place; on an error nothing has changed.

    Args:
        weights: of the n hypotheses.
        deviation: probability of each phase deviation, (n, E).
        step: the measurement.

    Returns:
        Log density of the measurement, (n,), and what the deviations were weighed with, (n, E).

    Raises:
        ArgumentError: an innovation covariance is not positive definite.
    """
    dofs, rows, values, noise, transition, exponent, freedom = step
    if deviation.shape[1] == 1:
        return weights.condition(dofs, rows, values, noise, freedom), deviation
    moved = deviation
    if transition is not None:
        moved = np.matmul(deviation[:, None], transition)[:, 0]
    density, innovation = _densities(weights, moved, step)
    best = density.max(axis=1, keepdims=True)
    evidence = np.log(np.sum(moved * np.exp(density - best), axis=1)) + best[:, 0]
    likelihood = np.exp(exponent * (density - best))
    np.multiply(moved, likelihood, out=deviation)
    deviation /= deviation.sum(axis=1, keepdims=True)
    apart = innovation - np.matmul(deviation[:, None], innovation)
    induced = np.matmul(np.swapaxes(apart * deviation[..., None], 1, 2), apart)
    weights.condition(dofs, np.matmul(deviation[:, None], rows), values, noise + induced)
    return evidence, likelihood


def _densities(
    weights: GaussianBatch, deviation: NDArray[np.float64], step: Step
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Log density (n, E) and innovation (n, E, m) of the measurement at each deviation.

    The innovation covariance is that at the expected basis functions, for all deviations.
    """
    expected = np.matmul(deviation[:, None], step.rows)[:, 0]
    mean, covariance = weights.predicted(step.dofs, expected)
    factor = cholesky(symmetrize(covariance + step.noise_covariance), name="innovation covariance")
    innovation = step.values[..., None, :] - np.matmul(step.rows, np.swapaxes(mean, 1, 2))
    whitened = solve_lower(factor, np.swapaxes(innovation, 1, 2))
    log_scale = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    squares = np.sum(whitened**2, axis=1)
    m = innovation.shape[2]
    density = student_log_density(squares, log_scale[:, None], m, step.degrees_of_freedom)
    return density, innovation
