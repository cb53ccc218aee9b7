# SPDX-License-Identifier: Apache-2.0
"""The controlled weights' regression on the observed ones, per task, computed when asked for."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.gaussian import Gaussian, Regression, regression

N_KEPT = 16
"""Regressions held in memory; of 300 tasks few lead within one movement."""


class Recovery(Sequence[Regression]):
    """Regressions of K tasks; the most recently used are kept.

    Args:
        mean: weights, observed first, (K, D N).
        covariance: (K, D N, D N).
        n_observed: number of observed weights.
    """

    def __init__(self, mean: np.ndarray, covariance: np.ndarray, n_observed: int):
        self._mean, self._covariance, self._n_observed = mean, covariance, n_observed
        self._kept: dict[int, Regression] = {}

    def __len__(self) -> int:
        return len(self._mean)

    def __getitem__(self, task: int) -> Regression:
        """N(A w_o + b, C) of a task, negative numbers counting from the end."""
        index = range(len(self))[task]
        found = self._kept.pop(index, None)
        if found is None:
            found = regression(
                Gaussian(self._mean[index], self._covariance[index]), self._n_observed
            )
            while len(self._kept) >= N_KEPT:
                del self._kept[next(iter(self._kept))]
        self._kept[index] = found
        return found
