# SPDX-License-Identifier: Apache-2.0
"""The interaction primitive of one task: one Gaussian over the weights of both agents.

This is the model of Maeda et al. 2014 at known phase, for arrays. The online estimator filters many
tasks and durations at once (`filtering`); for one task of known duration its result is that of
`InteractionProMP.condition`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, brief
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import Gaussian, condition, marginal
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.trajectory import Trajectory, check_points, rollout
from intent_recognition.signals import as_numbers


@brief
@dataclass(frozen=True)
class InteractionProMP:
    """Joint distribution of the weights of P observed and Q controlled DOFs, D = P + Q.

    Attributes:
        basis: the N basis functions of each DOF.
        weights: joint distribution of all weights, (D N,), grouped by DOF, observed DOFs first
            (Maeda et al. 2014, Eq. 4).
        n_observed: number of observed DOFs, P.
        noise_variance: variance of a measured position about the trajectory, per DOF, (D,), in the
            squared unit of the DOF.
        duration_s: duration of the interaction [s]; the phase is time since onset divided by it.
    """

    basis: NormalizedRBFBasis
    weights: Gaussian
    n_observed: int
    noise_variance: Floats
    duration_s: float

    @property
    def n_dofs(self) -> int:
        """Number of observed and controlled DOFs D."""
        return len(self.noise_variance)

    def observation_matrix(self, phase: ArrayLike, dofs: Sequence[int]) -> Floats:
        """Observation matrix H of positions of m DOFs, (T m, D N).

        Row t m + k is DOF `dofs[k]` at `phase[t]`; other DOFs have no row.

        Args:
            phase: T phases, (T,), or a number for one.
            dofs: m indices, counted from 0 over the observed, then the controlled DOFs.
        """
        design = self.basis.design_matrix(np.atleast_1d(np.asarray(phase, dtype=np.float64)))
        select = np.eye(self.n_dofs)[list(dofs)]
        return np.einsum("md,tn->tmdn", select, design).reshape(len(design) * len(dofs), -1)

    def condition(
        self,
        phase: ArrayLike,
        values: ArrayLike,
        *,
        dofs: Sequence[int] | None = None,
        covariance: ArrayLike | None = None,
    ) -> tuple[InteractionProMP, float]:
        """Condition on measured positions at known phases (Maeda et al. 2014, Eq. 6).

        The learned noise is taken as independent from sample to sample.

        Args:
            phase: phases of the samples in [0, 1], (T,), or a number for one sample.
            values: measured positions, (T, m), or (m,) for one sample, in the units of the DOFs.
            dofs: m indices of the measured DOFs, counted from 0 over the observed, then the
                controlled DOFs; None for all observed DOFs.
            covariance: measurement covariance of one sample, (m, m), added to `noise_variance`.

        Returns:
            The primitive with the posterior of the weights, and the log evidence log p(values).

        Raises:
            ShapeError: the arrays do not fit each other.
            ArgumentError: a number is not finite, a phase is outside of [0, 1], there is no such
                DOF, or the noise is not positive definite.
        """
        index = list(range(self.n_observed) if dofs is None else dofs)
        if not index or not all(dof in range(self.n_dofs) for dof in index):
            expected, cure = f"numbers from 0 to {self.n_dofs - 1}", "Observed DOFs come first."
            raise ArgumentError.about("dofs", expected, index, cure)
        noise = np.diag(self.noise_variance[index])
        if covariance is not None:
            noise = noise + _finite("covariance", covariance, noise.shape)
        phases = as_numbers("phase", phase)
        shape = (*phases.shape, len(index))
        if phases.ndim > 1:
            cure = "Pass one phase per sample."
            raise ShapeError.about("phase", "a number or shape (T,)", phases.shape, cure)
        phases = _finite("phase", phases, phases.shape)
        if np.any(np.abs(phases - 0.5) > 0.5 + 1e-6):  # stamps are rounded
            expected, cure = "numbers in [0, 1]", "Divide times since onset by the duration."
            raise ArgumentError.about("phase", expected, phase, cure)
        observed = _finite("values", values, shape)
        posterior, log_evidence = condition(
            self.weights,
            self.observation_matrix(phases, index),
            observed.ravel(),
            np.kron(np.eye(phases.size), noise).astype(np.float64, copy=False),
        )
        return replace(self, weights=posterior), log_evidence

    def predict_observed(self, n_points: int = 50) -> Trajectory:
        """Trajectory of the observed DOFs at T evenly spaced times from onset to end, (T, P)."""
        return self._predict(slice(0, self.n_observed), n_points)

    def predict_controlled(self, n_points: int = 50) -> Trajectory:
        """Trajectory of the controlled DOFs at T evenly spaced times from onset to end, (T, Q).

        Its standard deviation is that of a measured position: it includes the uncertain weights and
        the noise (Maeda et al. 2014, Eq. 8).
        """
        return self._predict(slice(self.n_observed, None), n_points)

    def _predict(self, dofs: slice, n_points: int) -> Trajectory:
        check_points(n_points)
        index = np.arange(len(self.weights.mean)).reshape(self.n_dofs, -1)[dofs].ravel()
        phase = np.linspace(0.0, 1.0, n_points)
        weights, noise = marginal(self.weights, index), self.noise_variance[dofs]
        return rollout(self.basis, weights, phase, self.duration_s, noise)


def _finite(argument: str, values: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """An argument as an array, checked to be finite and of the given shape."""
    array = as_numbers(argument, values)
    if array.shape != shape:
        cure = "Pass one row per sample and one column per DOF."
        raise ShapeError.about(argument, f"shape {shape}", array.shape, cure)
    if not np.all(np.isfinite(array)):
        cure = "Leave out samples that were not measured, and name the measured DOFs as `dofs`."
        raise ArgumentError.about(argument, "finite numbers", "NaN or infinity", cure)
    return array
