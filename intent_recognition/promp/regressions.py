# SPDX-License-Identifier: Apache-2.0
"""Regression of the controlled weights on the observed ones, kept for the tasks in use."""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, Regression, regression

N_KEPT = 16
"""Regressions held in memory. Convention: few tasks become the most probable in one movement."""


class Regressions:
    """Regressions of K tasks, computed when asked for; the most recently used are kept.

    Args:
        mean: weights, observed first, (K, D N).
        covariance: (K, D N, D N).
        n_observed: number of observed weights.
    """

    def __init__(self, mean: NDArray[np.float64], covariance: NDArray[np.float64], n_observed: int):
        self._mean, self._covariance, self._n_observed = mean, covariance, n_observed
        self._kept: dict[int, Regression] = {}

    def __len__(self) -> int:
        return len(self._mean)

    def __getitem__(self, task: int) -> Regression:
        """N(A w_o + b, C) of a task, negative numbers counting from the end."""
        index = range(len(self))[task]
        found = self._kept.pop(index, None)
        if found is None:
            joint = Gaussian(self._mean[index], self._covariance[index])
            found = regression(joint, self._n_observed)
            while len(self._kept) >= N_KEPT:
                del self._kept[next(iter(self._kept))]
        self._kept[index] = found
        return found
