# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every (task, phase) hypothesis at once (Maeda et al. 2014, Eq. 6-11).

Only the observed block of the weights is filtered: observations do not touch the rest, which
follows by regression when asked for (`promp.controlled_weights`). No loop runs over hypotheses.
These are values and pure functions; `RunningBank` filters a movement under way in place.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.observation_model import check_observation
from intent_recognition.gaussian import Gaussian, GaussianBatch, make_state, symmetrize
from intent_recognition.promp import TaskLibrary


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
        mean = weight @ self.mean
        apart = (self.mean - mean) * np.sqrt(weight)[:, None]
        covariance = np.tensordot(weight, self.covariance, axes=1)
        return Gaussian(mean, symmetrize(covariance + apart.T @ apart))


def start_bank(library: TaskLibrary, hypotheses: Hypotheses) -> FilterBank:
    """The bank before any observation."""
    repeat = hypotheses.n_scales
    return FilterBank(
        np.repeat(library.observed_mean, repeat, axis=0),
        np.repeat(library.observed_covariance, repeat, axis=0),
        np.zeros(len(hypotheses.duration_s)),
    )


def condition_bank(
    bank: FilterBank,
    dofs: NDArray[np.int64],
    rows: NDArray[np.float64],
    values: NDArray[np.float64],
    noise_covariance: NDArray[np.float64],
) -> FilterBank:
    """Condition every hypothesis on one observation of some DOFs; the argument is not changed.

    Args:
        bank: B hypotheses over P DOFs.
        dofs: index of the DOF behind each observed value, (m,); a DOF may come twice (position
            and velocity), and what is not observed has no entry.
        rows: row of the observation matrix within that DOF's block, (B, m, N) or (B, 1, N) for
            positions, whose row is the same for all DOFs.
        values: observed values, (m,).
        noise_covariance: (m, m) or one per hypothesis, (B, m, m), positive definite.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: a value is not finite, or an innovation covariance not positive definite.
    """
    check_observation(dofs, values, noise_covariance)
    n, n_basis = len(bank.mean), rows.shape[-1]
    rows = np.broadcast_to(rows, (n, *rows.shape[1:]))
    block = GaussianBatch(make_state(bank.mean, bank.covariance, n_basis), n_basis)
    log_density = block.condition(dofs, rows, values, noise_covariance)
    block.apply_downdates()
    return FilterBank(block.mean, block.covariance, bank.log_evidence + log_density)
