# SPDX-License-Identifier: Apache-2.0
"""The multivariate normal distribution: density, marginal, conditioning, regression, products."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve

from intent_recognition.array_types import Floats, Integers, brief
from intent_recognition.errors import ArgumentError, ShapeError, check_type
from intent_recognition.gaussian.linalg import (
    cholesky,
    half_log_det,
    solve_lower,
    student_log_density,
    symmetrize,
)


@brief
class Gaussian(NamedTuple):
    """A normal distribution: mean (d,) and covariance (d, d)."""

    mean: Floats
    covariance: Floats


def log_density(distribution: Gaussian, value: Floats) -> Floats:
    """Log density (...) of values (..., d) under one distribution or a batch of them."""
    factor = cholesky(distribution.covariance)
    whitened = solve_lower(factor, (value - distribution.mean)[..., None])[..., 0]
    squares = np.sum(whitened**2, axis=-1)
    return student_log_density(squares, half_log_det(factor), whitened.shape[-1])


def marginal(distribution: Gaussian, index: Integers) -> Gaussian:
    """Marginal distribution of some elements.

    Args:
        distribution: distribution over vectors (d,).
        index: elements to keep, (m,), each from -d to d - 1.

    Raises:
        ShapeError: mean and covariance do not fit each other.
        ArgumentError: the distribution is no Gaussian, or has no such element.
    """
    distribution = _as_arrays("distribution", distribution)
    elements = np.arange(distribution.mean.size)
    try:
        index = elements[np.asarray(index)]
    except IndexError as error:
        cure = "Number the elements from 0 on."
        expected = f"whole numbers below {elements.size}"
        raise ArgumentError.about("index", expected, index, cure) from error
    return Gaussian(distribution.mean[index], distribution.covariance[np.ix_(index, index)])


def _as_arrays(argument: str, distribution: Gaussian) -> Gaussian:
    """Check one distribution that a caller made, perhaps of lists, and convert it to arrays."""
    check_type(argument, distribution, Gaussian, "Pass Gaussian(mean, covariance).")
    made = Gaussian(*(np.asarray(part, dtype=np.float64) for part in distribution))
    if made.mean.ndim != 1 or made.covariance.shape != 2 * made.mean.shape:
        got = f"{made.mean.shape} and {made.covariance.shape}"
        cure = "Pass numpy.diag(variances) if the elements are independent."
        raise ShapeError.about(argument, "mean (d,) and covariance (d, d)", got, cure)
    return made


def whiten_innovation(
    innovation_covariance: Floats,
    cross: Floats,
    innovation: Floats,
    *,
    name: str = "innovation covariance",
) -> tuple[Floats, Floats, Floats]:
    """Whiten H P and the innovation by the innovation covariance (Maeda et al. 2014, Eq. 6).

    With the whitened ones the posterior is N(m + cross^T innovation, P - cross^T cross).

    Args:
        innovation_covariance: S = H P H^T + R, (..., m, m).
        cross: H P, (..., m, d).
        innovation: y - H m, (..., m).
        name: name of S in the error message.

    Returns:
        L^-1 H P, (..., m, d), and L^-1 (y - H m), (..., m), for S = L L^T; and
        log N(y; H m, S), (...).

    Raises:
        ArgumentError: S is not positive definite.
    """
    factor = cholesky(innovation_covariance, name=name)
    solved = solve_lower(factor, np.concatenate([cross, innovation[..., None]], axis=-1))
    whitened = solved[..., -1]
    squares = np.sum(whitened**2, axis=-1)
    density = student_log_density(squares, half_log_det(factor), whitened.shape[-1])
    return solved[..., :-1], whitened, density


def condition(
    prior: Gaussian, observation_matrix: Floats, observation: Floats, noise_covariance: Floats
) -> tuple[Gaussian, float]:
    """Condition on y = H w + noise.

    Maeda et al. 2014, Eq. 6, with the prior covariance in the gain. H has no rows for unobserved
    quantities.

    Args:
        prior: distribution of w, (d,).
        observation_matrix: H, (m, d).
        observation: y, (m,).
        noise_covariance: R, (m, m), positive definite.

    Returns:
        The posterior of w and the log evidence log p(y).

    Raises:
        ShapeError: H, y, R and the prior do not fit each other.
        ArgumentError: the prior is no Gaussian, or the innovation covariance is not positive
            definite.
    """
    prior = _as_arrays("prior", prior)
    given = observation_matrix, observation, noise_covariance
    observation_matrix, observation, noise_covariance = (np.asarray(one, float) for one in given)
    m = observation_matrix.shape[0] if observation_matrix.ndim else 0
    shapes = observation_matrix.shape, observation.shape, noise_covariance.shape
    if shapes != ((m, prior.mean.size), (m,), (m, m)):
        expected = f"y ({m},), R ({m}, {m}) and {prior.mean.size} columns in H"
        got = f"y {shapes[1]}, R {shapes[2]}, H {shapes[0]}"
        cure = "Give H one row per observed value and one column per weight."
        raise ShapeError.about("observation", expected, got, cure)
    cross = observation_matrix @ prior.covariance
    cross, innovation, log_evidence = whiten_innovation(
        symmetrize(cross @ observation_matrix.T) + noise_covariance,
        cross,
        observation - observation_matrix @ prior.mean,
    )
    mean = prior.mean + cross.T @ innovation
    covariance = symmetrize(prior.covariance - cross.T @ cross)
    return Gaussian(mean, covariance), float(log_evidence)


class Regression(NamedTuple):
    """A linear Gaussian map: target given source is N(offset + matrix source, covariance)."""

    matrix: Floats
    offset: Floats
    covariance: Floats


def regression(joint: Gaussian, n_source: int) -> Regression:
    """Regression of the last elements of a joint Gaussian on its first `n_source`.

    For the weights of Maeda et al. 2014, Eq. 4: E[w_c | w_o] = mu_c + S_co S_oo^-1 (w_o - mu_o).
    """
    source, target = slice(0, n_source), slice(n_source, None)
    factor = (cholesky(joint.covariance[source, source]), True)
    matrix = cho_solve(factor, joint.covariance[source, target]).T
    covariance = joint.covariance[target, target] - matrix @ joint.covariance[source, target]
    return Regression(
        matrix, joint.mean[target] - matrix @ joint.mean[source], symmetrize(covariance)
    )


def expected_distance(precision: Floats, apart: Floats, covariance: Floats) -> Floats:
    """E[x^T precision x] for x ~ N(apart, covariance) of d elements, (...)."""
    turned = np.matmul(precision, apart[..., None])[..., 0]
    return np.sum(apart * turned, axis=-1) + np.sum(precision * covariance, axis=(-2, -1))


def product(factors: Sequence[Gaussian], powers: Sequence[float]) -> Gaussian:
    """The normal distribution whose density is proportional to prod_i N(x; m_i, P_i)^a_i.

    Its precision is the sum of a_i P_i^-1, so a power of zero leaves a factor out. Powers must not
    be negative, nor all zero.

    Raises:
        ArgumentError: a covariance is not positive definite.
    """
    used = [(factor, power) for factor, power in zip(factors, powers, strict=True) if power > 0.0]
    if len(used) == 1 and used[0][1] == 1.0:
        return used[0][0]
    size = len(factors[0].mean)
    precision, pull = np.zeros((size, size)), np.zeros(size)
    for factor, power in used:
        own = power * _inverse(factor.covariance)
        precision += own
        pull += own @ factor.mean
    covariance = _inverse(symmetrize(precision))
    return Gaussian(covariance @ pull, covariance)


def _inverse(matrix: Floats) -> Floats:
    """Inverse of a positive definite matrix."""
    factor = cholesky(matrix)
    return symmetrize(cho_solve((factor, True), np.eye(len(matrix))))
