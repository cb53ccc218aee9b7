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
from intent_recognition.gaussian import LinearMeasurement
from intent_recognition.promp import TaskLibrary, deviation_transition, reference_phase
from intent_recognition.signals import Observation

SPACING = 0.4995
"""Least time between two used observations of the same DOFs, in parts of the correlation time:
half of it, and a thousandth of slack for stamps (docs/decisions/one_filter.md)."""


class Measurement(NamedTuple):
    """One observation as the filter takes it.

    Attributes:
        elapsed_s: time since onset.
        interval_s: time since the measurement before, zero or more; infinite at the first one.
        dofs: index of the observed DOF behind each value, (m,).
        values: (m,).
        noise_covariance: of the values, (m, m), positive definite.
        derivative: whether velocities were measured.
        first: whether none of the DOFs had been measured before.
    """

    elapsed_s: float
    interval_s: float
    dofs: NDArray[np.int64]
    values: NDArray[np.float64]
    noise_covariance: NDArray[np.float64]
    derivative: bool
    first: bool = False


class ObservationModel:
    """Turns the observations of one movement into measurements, and these into linear ones.

    Observations of the same DOFs closer together than half of the library's `correlation_time_s`
    say nothing new about what a primitive leaves unexplained; of them the first is used.

    Args:
        library: the learned tasks.
        hypotheses: the grid of tasks and durations.
        onset_ns: stamp from which phases count.
    """

    def __init__(self, library: TaskLibrary, hypotheses: Hypotheses, onset_ns: int):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        self._spacing_ns = SPACING * library.correlation_time_s * 1e9
        self._last_ns: list[int | None] = [None] * library.n_observed
        self._used_ns: dict[tuple[int, tuple[int, ...] | None, bool], int] = {}
        self._last_s: float | None = None

    def measurement(self, observation: Observation) -> Measurement | None:
        """An observation with its noise; None if it follows too closely on the last one.

        The noise of positions grows as samples get denser (`TaskLibrary.noise_covariance`); the
        model remembers when each DOF was last measured. The sender's covariance is added.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        dofs = self.library.observed_dofs(observation.group, observation.dofs)
        learned, first = None, False
        if not observation.derivative:
            last_ns = [self._last_ns[dof] for dof in dofs]
            known_ns = [stamp_ns for stamp_ns in last_ns if stamp_ns is not None]
            interval_s = (observation.stamp_ns - max(known_ns)) * 1e-9 if known_ns else inf
            learned, first = self.library.noise_covariance(dofs, interval_s), not known_ns
        noise = self._noise(observation, learned)
        check_observation(dofs, observation.values, noise)
        kind = (observation.group, observation.dofs, observation.derivative)
        used_ns = self._used_ns.get(kind)
        if used_ns is not None and observation.stamp_ns - used_ns < self._spacing_ns:
            return None
        self._used_ns[kind] = observation.stamp_ns
        if not observation.derivative:
            for dof in dofs:
                self._last_ns[dof] = observation.stamp_ns
        elapsed_s = (observation.stamp_ns - self.onset_ns) * 1e-9
        passed_s = inf if self._last_s is None else max(elapsed_s - self._last_s, 0.0)
        self._last_s = elapsed_s if self._last_s is None else max(elapsed_s, self._last_s)
        return Measurement(
            elapsed_s, passed_s, dofs, observation.values, noise, observation.derivative, first
        )

    def linear(
        self, measurement: Measurement, index: NDArray[np.int64] | slice
    ) -> LinearMeasurement:
        """A measurement as some hypotheses take it.

        Where the movement begins counts in full: the heavy tails of the Student density are for
        what people do on the way, and a movement that begins elsewhere is not a known one.
        """
        library, hypotheses, elapsed_s = self.library, self.hypotheses, measurement.elapsed_s
        deviation, basis = library.phase_deviation, library.basis
        phase = reference_phase(deviation, hypotheses.phase(elapsed_s)[index])
        if measurement.derivative:
            rate = hypotheses.phase_rate(elapsed_s)[index]
            rows = basis.derivative_matrix(phase) * rate[:, None, None]
        else:
            rows = basis.design_matrix(phase)
        transition = None
        if phase.shape[1] > 1 and measurement.interval_s < inf:
            passed = measurement.interval_s / hypotheses.duration_s[index]
            transition = deviation_transition(deviation, passed)
        return LinearMeasurement(
            measurement.dofs,
            rows,
            measurement.values,
            measurement.noise_covariance,
            transition,
            deviation.evidence,
            inf if measurement.first else library.evidence_freedom,
        )

    def _noise(
        self, observation: Observation, learned: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """The learned noise and the sender's."""
        noise = observation.covariance
        if learned is not None:
            return learned if noise is None else learned + noise
        if noise is None:
            raise ArgumentError(
                describe(
                    "observation",
                    "a covariance with measured velocities",
                    "none",
                    "Pass the sensor's: noise is learned for positions only.",
                )
            )
        return noise


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
