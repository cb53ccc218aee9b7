# SPDX-License-Identifier: Apache-2.0
"""From observations to measurements: the index of each observed DOF, and the noise."""

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Observation

SPACING = 0.4995
"""Least time between two used observations of the same DOFs, relative to the correlation time: half
of it, less a thousandth of slack for stamps (docs/decisions/one_filter.md)."""


class Measurement(NamedTuple):
    """One observation in the form that the filter conditions on."""

    elapsed_s: float  # time since onset
    interval_s: float  # time since the last measurement, zero or more; infinite at the first
    dofs: Integers  # index of the observed DOF of each value, (m,)
    values: Floats  # (m,)
    noise_covariance: Floats  # covariance of the values' noise, (m, m), positive definite
    derivative: bool  # whether the values are velocities
    # Degrees of freedom of the Student density that gives the evidence. First positions have a
    # normal density: heavy tails allow for deviations on the way, but a movement that begins
    # elsewhere is not a known one.
    freedom: float = inf


class ObservationModel:
    """Turns the observations of one movement into measurements; phases count from its onset.

    An observation is left out if it follows a used one of the same DOFs within half of the
    library's `correlation_time_s`: their residuals are correlated, so it would add little.
    """

    def __init__(self, library: TaskLibrary, onset_ns: int):
        self._library, self._onset_ns = library, onset_ns
        self._spacing_ns = SPACING * library.correlation_time_s * 1e9
        self._last_ns: list[int | None] = [None] * library.n_observed
        self._used_ns: dict[tuple[int, tuple[int, ...] | None, bool], int] = {}
        self._last_s = -inf

    def measurement(self, observation: Observation) -> Measurement | None:
        """Measurement with its noise; None if the observation follows too closely on another.

        The noise of positions grows with the rate of the samples (`TaskLibrary.noise_covariance`),
        so the model remembers when each DOF was last measured. The sender's covariance is added.

        Raises:
            ShapeError: values, DOFs and covariance do not fit each other.
            ArgumentError: a value is not finite, or velocities come without a covariance.
        """
        library, stamp_ns, derivative = self._library, observation.stamp_ns, observation.derivative
        dofs, noise = library.observed_dofs(observation.group, observation.dofs), None
        known_ns = [t for t in (self._last_ns[dof] for dof in dofs) if t is not None]
        if not derivative:
            since_s = (stamp_ns - max(known_ns)) * 1e-9 if known_ns else inf
            noise = library.noise_covariance(dofs, since_s)
        if observation.covariance is not None:
            noise = observation.covariance + (0.0 if noise is None else noise)
        if noise is None:
            cure = "Pass the sensor's: noise is learned for positions only."
            expected = "a covariance with measured velocities"
            raise ArgumentError.about("observation", expected, "none", cure)
        check_observation(dofs, observation.values, noise)
        kind = (observation.group, observation.dofs, derivative)
        if stamp_ns - self._used_ns.get(kind, -(2**63)) < self._spacing_ns:
            return None
        self._used_ns[kind] = stamp_ns
        if not derivative:
            for dof in dofs:
                self._last_ns[dof] = stamp_ns
        elapsed_s = (stamp_ns - self._onset_ns) * 1e-9
        passed_s = max(elapsed_s - self._last_s, 0.0)
        self._last_s = max(elapsed_s, self._last_s)
        freedom = library.evidence_freedom if known_ns or derivative else inf
        return Measurement(
            elapsed_s, passed_s, dofs, observation.values, noise, derivative, freedom
        )


def check_observation(dofs: Integers, values: Floats, noise_covariance: Floats) -> None:
    """Refuse values or noise that do not fit the DOFs, and values that are not finite."""
    m = len(dofs)
    if np.shape(values) != (m,) or np.shape(noise_covariance)[-2:] != (m, m):
        expected = f"shapes ({m},) and ({m}, {m}) for {m} observed values"
        got = f"{np.shape(values)} and {np.shape(noise_covariance)}"
        cure = "Pass one value and one row and column of noise per entry of dofs."
        raise ShapeError.about("values, noise_covariance", expected, got, cure)
    if not isfinite(np.add.reduce(values)):
        cure = "Leave out what was not measured."
        raise ArgumentError.about("values", "finite numbers", values, cure)
