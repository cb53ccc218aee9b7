# SPDX-License-Identifier: Apache-2.0
"""Regression of the controlled weights on the observed ones, and its uncertainty."""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, Regression, expected_distance, regression

N_KEPT = 16
"""Largest number of regressions in memory: few tasks become the most probable in one movement."""


class Regressions:
    """Regressions of K tasks, computed on demand; the most recently used are kept.

    Args:
        mean: means of the weights, observed first, (K, D N).
        covariance: covariances of the weights, (K, D N, D N).
        n_observed: number of observed weights.
        variance: variance of the coefficients, as a factor of C (x) S_oo^-1.
    """

    def __init__(self, mean: Floats, covariance: Floats, n_observed: int, variance: float = 0.0):
        self._mean, self._covariance, self._n_observed = mean, covariance, n_observed
        self._variance = variance
        self._kept: dict[int, tuple[Regression, Floats | None]] = {}

    def __getitem__(self, task: int) -> Regression:
        """Regression N(A w_o + b, C) of a task."""
        return self._find(task)[0]

    def _find(self, task: int) -> tuple[Regression, Floats | None]:
        """Regression of a task, and S_oo^-1 if its coefficients are uncertain."""
        n, found = self._n_observed, self._kept.pop(task, None)
        if found is None:
            joint = Gaussian(self._mean[task], self._covariance[task])
            precision: Floats | None = None
            if self._variance:
                precision = np.asarray(np.linalg.inv(joint.covariance[:n, :n]), dtype=np.float64)
            found = regression(joint, n), precision
            while len(self._kept) >= N_KEPT:
                del self._kept[next(iter(self._kept))]
        self._kept[task] = found
        return found

    def uncertainty(self, task: int, mean: Floats, covariance: Floats) -> Floats:
        """Factor by which the uncertain coefficients multiply C at given observed weights, (...).

        It is 1 + r E[(w_o - mu_o)^T S_oo^-1 (w_o - mu_o)], with r the variance of the coefficients.

        Args:
            task: index of the task.
            mean: means of the observed weights, (..., P N).
            covariance: covariances of the observed weights, (..., P N, P N).
        """
        _, precision = self._find(task)
        if precision is None:
            return np.ones(mean.shape[:-1])
        apart = mean - self._mean[task, : self._n_observed]
        distance = expected_distance(precision, apart, covariance)
        return np.asarray(1.0 + self._variance * distance, dtype=np.float64)
