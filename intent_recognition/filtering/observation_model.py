# SPDX-License-Identifier: Apache-2.0
"""What an observation is to the filters: observed DOFs, rows of the observation matrix, noise.

Each observation is y = H w + e. A row of H holds the basis functions, or for a velocity their
derivative, at the phase that a hypothesis gives to the time of measurement, in the block of the DOF
that was measured; what was not measured has no row.
"""

from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Observation


class Measurement(NamedTuple):
    """One observation as a filter takes it.

    Attributes:
        elapsed_s: time since onset.
        dofs: index of the observed DOF behind each value, (m,).
        values: (m,).
        noise_covariance: of the values, (m, m), positive definite.
        derivative: whether velocities were measured.
    """

    elapsed_s: float
    dofs: NDArray[np.int64]
    values: NDArray[np.float64]
    noise_covariance: NDArray[np.float64]
    derivative: bool


class ObservationModel:
    """Turns the observations of one movement into measurements, and these into rows.

    Args:
        library: the learned tasks.
        hypotheses: the grid of tasks and durations.
        onset_ns: stamp from which phases count.
    """

    def __init__(self, library: TaskLibrary, hypotheses: Hypotheses, onset_ns: int):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        self._last_ns: list[int | None] = [None] * library.n_observed

    def elapsed_s(self, observation: Observation) -> float:
        """Time from onset to an observation."""
        return (observation.stamp_ns - self.onset_ns) * 1e-9

    def for_recognition(self, observation: Observation) -> Measurement:
        """An observation with the noise by which tasks are told apart.

        That of positions grows as samples get denser (`TaskLibrary.noise_covariance`); the model
        remembers when each DOF was last observed. The sender's covariance is added.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        dofs = self.library.observed_dofs(observation.group, observation.dofs)
        if observation.derivative:
            return self._measurement(observation, dofs, None)
        last_ns = [self._last_ns[dof] for dof in dofs]
        known_ns = [stamp_ns for stamp_ns in last_ns if stamp_ns is not None]
        interval_s = (observation.stamp_ns - max(known_ns)) * 1e-9 if known_ns else inf
        learned = self.library.noise_covariance(dofs, interval_s)
        measurement = self._measurement(observation, dofs, learned)
        for dof in dofs:
            self._last_ns[dof] = observation.stamp_ns
        return measurement

    def for_prediction(self, observation: Observation) -> Measurement:
        """Observed positions with the noise of the primitives that trajectories come from.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite.
        """
        dofs = self.library.observed_dofs(observation.group, observation.dofs)
        learned = self.library.primitives.noise_covariance(dofs)
        return self._measurement(observation, dofs, learned)

    def rows(
        self, measurement: Measurement, index: NDArray[np.int64] | slice
    ) -> NDArray[np.float64]:
        """Rows of H under some hypotheses, one that all DOFs share: (n, 1, N)."""
        basis, elapsed_s = self.library.basis, measurement.elapsed_s
        phase = self.hypotheses.phase(elapsed_s)[index]
        if not measurement.derivative:
            return basis.design_matrix(phase)[:, None]
        rate = self.hypotheses.phase_rate(elapsed_s)[index]
        return (basis.derivative_matrix(phase) * rate[:, None])[:, None]

    def _measurement(
        self,
        observation: Observation,
        dofs: NDArray[np.int64],
        learned: NDArray[np.float64] | None,
    ) -> Measurement:
        """The learned noise and the sender's, checked."""
        noise = observation.covariance
        if learned is not None:
            noise = learned if noise is None else learned + noise
        elif noise is None:
            raise ArgumentError(
                describe(
                    "observation",
                    "a covariance with measured velocities",
                    "none",
                    "Pass the sensor's: noise is learned for positions only.",
                )
            )
        check_observation(dofs, observation.values, noise)
        elapsed_s = self.elapsed_s(observation)
        return Measurement(elapsed_s, dofs, observation.values, noise, observation.derivative)


def check_observation(
    dofs: NDArray[np.int64], values: NDArray[np.float64], noise_covariance: NDArray[np.float64]
) -> None:
    """Check that values and noise go with the DOFs.

    Raises:
        ShapeError: they do not.
        ArgumentError: a value is not finite.
    """
    m = len(dofs)
    if np.shape(values) != (m,) or np.shape(noise_covariance)[-2:] != (m, m):
        raise ShapeError(
            describe(
                "values, noise_covariance",
                f"shapes ({m},) and ({m}, {m}) for {m} observed values",
                f"{np.shape(values)} and {np.shape(noise_covariance)}",
                "Pass one value and one row and column of noise per entry of dofs.",
            )
        )
    if not isfinite(np.add.reduce(values)):
        raise ArgumentError(
            describe("values", "finite numbers", f"{values}", "Leave out what was not measured.")
        )
