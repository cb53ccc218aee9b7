# SPDX-License-Identifier: Apache-2.0
"""The multivariate normal distribution: density, marginal, conditioning on a linear observation."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.gaussian.linalg import cholesky, log_normalizer, symmetrize


class Gaussian(NamedTuple):
    """A normal distribution: mean (d,) and covariance (d, d)."""

    mean: np.ndarray
    covariance: np.ndarray


def gaussian(mean, covariance) -> Gaussian:
    """Check a mean and a covariance once, at the border.

    Raises:
        ShapeError: the covariance does not fit the mean.
        ArgumentError: a value is not finite or the covariance is not symmetric.
    """
    mean = np.array(mean, dtype=np.float64)
    covariance = np.array(covariance, dtype=np.float64)
    if mean.ndim != 1 or covariance.shape != (mean.size, mean.size):
        raise ShapeError(
            describe(
                "covariance",
                f"shape ({mean.size}, {mean.size}) to go with a mean of shape {mean.shape}",
                covariance.shape,
                "Pass one row and one column per element of the mean.",
            )
        )
    if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(covariance))):
        raise ArgumentError(
            describe("mean, covariance", "finite numbers", "NaN or infinity", "Clean the input.")
        )
    if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=1e-12 * np.abs(covariance).max()):
        raise ArgumentError(
            describe("covariance", "a symmetric matrix", "an asymmetric one", "Symmetrise it.")
        )
    return Gaussian(mean, covariance)


def log_density(distribution: Gaussian, value: np.ndarray) -> float:
    """Log density of `value` (d,) under the distribution."""
    factor = cholesky(distribution.covariance)
    whitened = solve_triangular(factor, value - distribution.mean, lower=True)
    return float(-0.5 * whitened @ whitened - log_normalizer(factor))


def marginal(distribution: Gaussian, index: np.ndarray) -> Gaussian:
    """Distribution of some of the elements.

    Args:
        distribution: over (d,).
        index: which elements to keep, (m,).
    """
    index = np.asarray(index)
    return Gaussian(distribution.mean[index], distribution.covariance[np.ix_(index, index)])


def condition(
    prior: Gaussian,
    observation_matrix: np.ndarray,
    observation: np.ndarray,
    noise_covariance: np.ndarray,
) -> tuple[Gaussian, float]:
    """Condition on y = H w + noise (Maeda et al. 2014, Eq. 6; prior covariance in the gain).

    An unobserved quantity has no row in H.

    Args:
        prior: distribution of w (d,).
        observation_matrix: H, (m, d).
        observation: y, (m,).
        noise_covariance: R, (m, m), positive definite.

    Returns:
        The posterior of w and the log evidence log p(y).

    Raises:
        ShapeError: H, y and R do not fit each other.
        ArgumentError: the innovation covariance is not positive definite.
    """
    m, d = np.shape(observation_matrix)
    if (
        np.shape(observation) != (m,)
        or np.shape(noise_covariance) != (m, m)
        or d != prior.mean.size
    ):
        raise ShapeError(
            describe(
                "observation",
                f"y ({m},), R ({m}, {m}) and {prior.mean.size} columns in H",
                f"y {np.shape(observation)}, R {np.shape(noise_covariance)}, H ({m}, {d})",
                "Give H one row per observed value and one column per weight.",
            )
        )
    cross = prior.covariance @ observation_matrix.T
    factor = cholesky(
        symmetrize(observation_matrix @ cross) + noise_covariance, name="innovation covariance"
    )
    innovation = observation - observation_matrix @ prior.mean
    whitened = solve_triangular(factor, innovation, lower=True)
    whitened_cross = solve_triangular(factor, cross.T, lower=True)
    posterior = Gaussian(
        prior.mean + whitened_cross.T @ whitened,
        symmetrize(prior.covariance - whitened_cross.T @ whitened_cross),
    )
    return posterior, float(-0.5 * whitened @ whitened - log_normalizer(factor))


class Regression(NamedTuple):
    """A linear Gaussian map: target given source is N(offset + matrix source, covariance)."""

    matrix: np.ndarray
    offset: np.ndarray
    covariance: np.ndarray


def regression(joint: Gaussian, n_source: int) -> Regression:
    """The conditional of the last elements of a joint Gaussian on its first `n_source`.

    For the weights of Maeda et al. 2014, Eq. 4: w_c | w_o = mu_c + S_co S_oo^-1 (w_o - mu_o).
    """
    source, target = slice(0, n_source), slice(n_source, None)
    factor = (cholesky(joint.covariance[source, source]), True)
    matrix = cho_solve(factor, joint.covariance[source, target]).T
    covariance = joint.covariance[target, target] - matrix @ joint.covariance[source, target]
    return Regression(
        matrix, joint.mean[target] - matrix @ joint.mean[source], symmetrize(covariance)
    )
