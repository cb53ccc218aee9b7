# SPDX-License-Identifier: Apache-2.0
"""The normalised product of normal densities raised to powers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from intent_recognition.gaussian.linalg import cholesky, symmetrize
from intent_recognition.gaussian.normal import Gaussian


def product(factors: Sequence[Gaussian], powers: Sequence[float]) -> Gaussian:
    """The normal distribution whose density is proportional to prod_i N(x; m_i, P_i)^a_i.

    Its precision is the sum of a_i P_i^-1, so that a power of zero leaves a factor out.

    Args:
        factors: over the same (d,), covariances positive definite.
        powers: not negative, not all zero.

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


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a positive definite matrix."""
    factor = cholesky(matrix)
    return symmetrize(cho_solve((factor, True), np.eye(len(matrix))))
