# SPDX-License-Identifier: Apache-2.0
"""Filtered weights of hypotheses, as the filter hands them out.

Only the observed block of the weights is filtered (Maeda et al. 2014, Eq. 6-8): observations do not
touch the rest, which follows by regression when asked for (`promp.controlled_weights`).
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, GaussianBatch, mixture_moments


class FilterBank(NamedTuple):
    """Filtered observed weights of B hypotheses.

    Attributes:
        mean: (B, P N).
        covariance: (B, P N, P N).
        log_evidence: log density of all observations so far under each hypothesis, (B,).
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    log_evidence: NDArray[np.float64]

    def mixture(self, weight: NDArray[np.float64]) -> Gaussian:
        """Mean and covariance of their mixture, each of a probability, (B,)."""
        return mixture_moments(weight, self.mean, self.covariance)


class CourseWeights:
    """Weights of some hypotheses' courses, as a `FilterBank`; those of their offsets left out.

    Each covariance is formed only when it is asked for: their mixture takes less.

    Args:
        weights: with those of the offsets, a copy that nothing changes.
        own: which of these are the course's, (P N,).
        log_evidence: of each hypothesis, (n,).
    """

    def __init__(
        self, weights: GaussianBatch, own: NDArray[np.int64], log_evidence: NDArray[np.float64]
    ):
        self._weights, self._own, self.log_evidence = weights, own, log_evidence

    @cached_property
    def _current(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        mean, covariance = self._weights.moments()
        return mean[:, self._own], covariance[:, self._own[:, None], self._own]

    @property
    def mean(self) -> NDArray[np.float64]:
        """(n, P N)."""
        return self._current[0]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(n, P N, P N)."""
        return self._current[1]

    def mixture(self, weight: NDArray[np.float64]) -> Gaussian:
        """Mean and covariance of their mixture, each of a probability, (n,)."""
        mean, covariance = self._weights.mixture(weight)
        return Gaussian(mean[self._own], covariance[np.ix_(self._own, self._own)])
