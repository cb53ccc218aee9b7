# SPDX-License-Identifier: Apache-2.0
"""Primitives over reference phase, for predicting one task's trajectories.

Recognition compares tasks at steady progress, with the deviations of people's timing inside the
covariance (`library.py`). Here demonstrations are aligned before their weights are taken, so that
the covariance holds what varies in space alone, and the timing is a variable of its own
(`progress.py`). What the covariance of the weights cannot say, how an oscillation goes on, or a
hesitation, is said by the lead.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.phase_deviation import PhaseDeviation
from intent_recognition.promp.regression import Recovery


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
        phase_deviation: prior of a person's lead.
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
    def recovery(self) -> Recovery:
        """Regression of the controlled weights on the observed ones, one `Regression` per task.

        Observations touch only the observed weights, so the controlled ones are recovered when
        asked for, exactly: N(A w_o + b, C).
        """
        return Recovery(self.weight_mean, self.weight_covariance, self.n_observed_weights)

    def noise_covariance(self, dofs: NDArray[np.int64]) -> NDArray[np.float64]:
        """Noise of one observation of the observed DOFs `dofs`, (m, m)."""
        return np.diag(self.noise_variance[dofs] * self.noise_scale)

    def control_noise_variance(self) -> NDArray[np.float64]:
        """Residual variance of the controlled DOFs, (Q,)."""
        return self.noise_variance[self.n_observed :]
