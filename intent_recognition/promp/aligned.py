# SPDX-License-Identifier: Apache-2.0
"""Primitives over reference phase, for predicting one task's trajectories.

Recognition compares tasks at steady progress, with the deviations of people's timing inside the
covariance (`library.py`). Here demonstrations are aligned before their weights are taken, so that
the covariance holds what varies in space alone, and the timing is a variable of its own
(`phase_deviation.py`), which describes what the covariance of the weights cannot: how an
oscillation goes on, or a hesitation.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, Regression, regression
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.phase_deviation import PhaseDeviation

N_KEPT = 16
"""Regressions held in memory. Convention: few tasks become the most probable in one movement."""


@dataclass(frozen=True)
class AlignedPrimitives:
    """K primitives over P observed and Q controlled DOFs in reference phase.

    Attributes:
        basis: the basis functions, N.
        n_observed: P.
        weight_mean: (K, D N), grouped by DOF, observed first.
        weight_covariance: predictive covariance of the next demonstration's, (K, D N, D N).
        noise_variance: residual variance per DOF, (D,).
        noise_scale: factor of the observed DOFs' noise variance.
        phase_deviation: prior of a person's phase deviation.
    """

    basis: NormalizedRBFBasis
    n_observed: int
    weight_mean: NDArray[np.float64]
    weight_covariance: NDArray[np.float64]
    noise_variance: NDArray[np.float64]
    noise_scale: float
    phase_deviation: PhaseDeviation

    @property
    def n_observed_weights(self) -> int:
        """P N."""
        return self.n_observed * self.basis.n_basis

    @property
    def n_controlled(self) -> int:
        """Number of controlled DOFs Q."""
        return len(self.noise_variance) - self.n_observed

    @cached_property
    def regressions(self) -> "Regressions":
        """Regression of the controlled weights on the observed ones, one `Regression` per task.

        Observations touch only the observed weights; the controlled ones follow exactly when asked
        for: N(A w_o + b, C).
        """
        return Regressions(self.weight_mean, self.weight_covariance, self.n_observed_weights)

    def noise_covariance(self, dofs: NDArray[np.int64]) -> NDArray[np.float64]:
        """Noise of one observation of the observed DOFs `dofs`, (m, m)."""
        return np.diag(self.noise_variance[dofs] * self.noise_scale)

    def control_noise_variance(self) -> NDArray[np.float64]:
        """Residual variance of the controlled DOFs, (Q,)."""
        return self.noise_variance[self.n_observed :]


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
