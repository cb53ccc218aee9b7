# SPDX-License-Identifier: Apache-2.0
"""The hypotheses of a movement: a table with one row per hypothesis.

A row is a task, a timing, and the posterior of the weights and of the phase deviation under them.
Hypotheses of the onset, turns, reaches and delays differ in their columns only.

A measurement is y = H w + e. A row of H holds the basis functions (for a velocity, their time
derivatives) at the phase of the measurement under the hypothesis, in the block of the measured DOF.
DOFs that were not measured have no row. A hypothesis born on the way has three more weights per
DOF, those of its offset (`fading`, `ending`).
"""

from dataclasses import replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.filtering.deviations import Deviations
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.rates import AFRESH
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement, state_width
from intent_recognition.promp import (
    STEADY,
    TaskLibrary,
    deviation_prior,
    deviation_transition,
    reference_phase,
    steady_rate,
)

OFFSET_BASIS = 3
"""Number of weights of an offset: position and velocity at birth, and a push or acceleration."""
COLUMNS = np.dtype(
    [
        ("task", np.int64),  # index of the task; K is none
        ("kind", np.int64),  # kind of birth (`rates`)
        ("seen", np.int64),  # number of measurements it was conditioned on
        ("onset_s", np.float64),  # time at which its phase is zero, after the movement's onset
        ("duration_s", np.float64),
        ("birth_s", np.float64),  # time of its birth, after the movement's onset
        ("rate", np.float64),  # rate of its offset's spring, or 1 / R of a reach [1/s]
        ("log_share", np.float64),  # log of its share among the newborn of its kind and task
        ("log_prior", np.float64),
        ("log_birth", np.float64),  # its log prior relative to all known tasks when it settled
        ("log_evidence", np.float64),  # log density of all measurements after it settled
    ]
)
"""Columns of a hypothesis besides its state and the probabilities of its phase deviation."""


class HypothesisTable:
    """Rows of hypotheses over P DOFs, in memory that is reused.

    Args:
        room: largest number of rows.
        library: the learned tasks, with the prior of the phase deviation.
        settling: number of measurements that initialise a row's offset and do not count as
            evidence; 0 for rows without offsets. Offsets replace the phase deviation.

    Attributes:
        n: number of rows in use.
        has_offsets: whether rows have offsets.
        deviation: probability of each phase deviation, (room, E).
    """

    def __init__(self, room: int, library: TaskLibrary, settling: int = 0):
        model = library.phase_deviation
        steady = replace(STEADY, duration_exponent=model.duration_exponent)
        self._model, self._settling = steady if settling else model, settling
        self.has_offsets = settling > 0
        self._usual_s = library.usual_s
        self._basis, n_dofs, n_basis = library.basis, library.n_observed, library.basis.n_basis
        self._shape = n_dofs, n_basis + OFFSET_BASIS * self.has_offsets
        # Touch the memory now, so that it is not allocated on first use. Align it to a cache line:
        # updates of blocks that cross two lines take a tenth longer.
        shape = room, state_width(n_dofs * self._shape[1])
        memory = np.full(room * shape[1] + 8, 0.0)
        self._state = memory[-memory.ctypes.data // 8 % 8 :][: room * shape[1]].reshape(shape)
        self._columns = np.zeros(room, dtype=COLUMNS)
        self._prior = deviation_prior(self._model)
        self.deviation = np.ones((room, len(self._prior)))
        self.clear()

    def clear(self) -> None:
        """Remove all rows: another movement begins."""
        self.n = 0
        self._history: list[tuple[float, Integers, NDArray, NDArray]] = []

    @property
    def rows(self) -> NDArray[np.void]:
        """Columns of the rows in use, (n,)."""
        return self._columns[: self.n]

    @property
    def log_joint(self) -> Floats:
        """Log of prior times density of the observations, (n,)."""
        return self.rows["log_prior"] + self.rows["log_evidence"]

    def add(self, state: Floats, times: int = 1, **columns: object) -> slice:
        """Add rows without measurements, and return their slice of the table.

        Args:
            state: prior of their weights, (k, ...), as in `GaussianBatch`.
            times: number of consecutive rows per state.
            columns: values of `COLUMNS`, a number or (k times,) each. The default is zero, and for
                `log_prior` minus infinity.
        """
        new = slice(self.n, self.n + len(state) * times)
        self.n = new.stop
        self._state[new].reshape(len(state), times, -1)[:] = state[:, None]
        self.deviation[new], self._columns[new] = self._prior, 0
        for name, values in {"log_prior": -inf, **columns}.items():
            self._columns[name][new] = values
        return new

    def condition(self, measurement: Measurement, index: Integers | None = None) -> None:
        """Condition rows on a measurement: the rows of an ascending index, or all."""
        where = slice(self.n) if index is None else index
        rows, deviation = self._columns[where], self.deviation[: self.n]
        batch = GaussianBatch(self._state[: self.n], *self._shape)
        density, likelihood = batch.condition(self.linear(measurement, rows), deviation, index)
        rows["seen"] += 1
        if self.has_offsets:
            density = np.where(rows["seen"] > self._settling, density, 0.0)
        rows["log_evidence"] += density
        if index is not None:
            self._columns[index] = rows
        if deviation.shape[1] > 1:
            index = np.arange(self.n) if index is None else index
            step = measurement.elapsed_s, index, deviation[where].copy(), likelihood
            self._history.append(step)

    def design(
        self, elapsed_s: Floats | float, rows: NDArray[np.void], *, derivative: bool = False
    ) -> Floats:
        """Basis functions of the hypotheses of some rows at times after onset, (n,): (n, E, N)."""
        model, basis, duration_s = self._model, self._basis, rows["duration_s"]
        into = (elapsed_s - rows["onset_s"]) / duration_s
        relative = duration_s / self._usual_s[rows["task"]]
        phase = reference_phase(model, into, relative)
        if derivative:
            rate = steady_rate(model, into, relative) / duration_s
            course = basis.derivative_matrix(phase) * rate[:, None, None]
        else:
            course = basis.design_matrix(phase)
        if self.has_offsets:
            since_s, rate = elapsed_s - rows["birth_s"], rows["rate"]
            offset = fading(since_s, rate, derivative=derivative)
            anew = rows["kind"] == AFRESH
            offset[anew] = ending(since_s[anew], rate[anew], derivative=derivative)
            course = np.concatenate([course, offset[:, None]], axis=2)
        return course

    def linear(self, measurement: Measurement, rows: NDArray[np.void]) -> LinearMeasurement:
        """The linear measurement of the weights under the hypotheses of some rows, (n,)."""
        model, transition = self._model, None
        if len(model.grid) > 1 and measurement.interval_s < inf:
            transition = deviation_transition(model, measurement.interval_s / rows["duration_s"])
        return LinearMeasurement(
            measurement.dofs,
            self.design(measurement.elapsed_s, rows, derivative=measurement.derivative),
            measurement.values,
            measurement.noise_covariance,
            transition,
            model.evidence,
            measurement.freedom,
        )

    def drop(self, which: Flags) -> None:
        """Remove the rows where `which` (n,) is true; the last rows kept fill the gaps."""
        self.n -= int(np.count_nonzero(which))
        free, moved = np.flatnonzero(which[: self.n]), self.n + np.flatnonzero(~which[self.n :])
        for array in (self._state, self.deviation, self._columns):
            array[free] = array[moved]

    def weights(self, index: Integers) -> GaussianBatch:
        """Copy of the weights of some rows, with those of their offsets."""
        return GaussianBatch(self._state[index], *self._shape)

    def courses(self, index: Integers) -> GaussianBatch:
        """Copy of the weights of some rows, without the weights of their offsets.

        Only the observed block of the weights is filtered (Maeda et al. 2014, Eq. 6-8). The
        controlled block follows from it by regression (`promp.controlled_weights`).
        """
        return self.weights(index).resized(slice(None), self._basis.n_basis)

    def deviations(self, index: Integers) -> Deviations:
        """Filtered deviations of adjacent rows that were always conditioned together."""
        ends = index[0], index[-1] + 1
        found = [
            (elapsed_s, filtered[some], likelihood[some])
            for elapsed_s, conditioned, filtered, likelihood in self._history
            if (some := slice(*np.searchsorted(conditioned, ends))).stop > some.start
        ]
        if not found:
            empty = np.zeros((0, len(index), 1))
            return Deviations(np.zeros(0), empty, empty)
        times_s, filtered, likelihood = zip(*found, strict=True)
        return Deviations(np.maximum.accumulate(times_s), np.array(filtered), np.array(likelihood))


def fading(since_s: Floats, rate: Floats, *, derivative: bool = False) -> Floats:
    """Factors of a, b and c in an offset that fades as a spring, (n, 3).

    The offset (a (1 + r s) + b s + c s^2 / 2) exp(-r s) is a critically damped spring of rate r
    [1/s], (n,), with an initial push c, at times s since birth, (n,); s below 0 counts as 0. With
    `derivative`, factors in its time derivative [1/s].
    """
    s = np.maximum(since_s, 0.0)
    if derivative:
        shapes = [-(rate**2) * s, 1.0 - rate * s, s - 0.5 * rate * s**2]
    else:
        shapes = [1.0 + rate * s, s, 0.5 * s**2]
    return np.stack(shapes, axis=1) * np.exp(-rate * s)[:, None]


def ending(since_s: Floats, rate: Floats, *, derivative: bool = False) -> Floats:
    """Factors of the position, velocity and acceleration at birth in an offset that ends, (n, 3).

    They are the quintics of least jerk that end at rest after R = 1 / rate (Flash and Hogan 1985),
    at times since birth, (n,); below 0 counts as 0. With `derivative`, their time derivatives.
    """
    u = np.clip(since_s * rate, 0.0, 1.0)
    left = 1.0 - u
    if derivative:
        shapes = [-30.0 * u**2, 1.0 + 2.0 * u - 15.0 * u**2, u - 2.5 * u**2]
        scale = left**2 * rate
    else:
        shapes, scale = [1.0 + 3.0 * u + 6.0 * u**2, u + 3.0 * u**2, 0.5 * u**2], left**3
    return np.stack([scale * shape / rate**k for k, shape in enumerate(shapes)], axis=1)
