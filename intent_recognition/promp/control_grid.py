# SPDX-License-Identifier: Apache-2.0
"""The controlled agent's trajectory at phases that never change, without its weights.

`rollout` of `controlled_weights` forms the covariance of all controlled
weights (Q N = 140 of them, usually) to read the variance of T Q values off it. What maps observed
weights to those values depends on the task alone and is kept here, so that a prediction costs two
products of matrices. The outcome is the same.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, symmetrize, whiten_innovation
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.prediction import StartPosture
from intent_recognition.promp.trajectory import Trajectory


class ControlGrid:
    """T evenly spaced phases of one task from start to end, or its end alone.

    Args:
        library: the learned tasks.
        task: number of the task.
        n_points: T; 1 is the end.
    """

    def __init__(self, library: TaskLibrary, task: int, n_points: int = 101):
        self.phase = np.linspace(1.0, 0.0, n_points)[::-1]
        self._n_controlled = library.n_controlled
        self._noise = library.control_noise_variance()
        self._regressions, self._task = library.regressions, task
        basis, (matrix, offset, covariance) = library.basis, self._regressions[task]
        shape = (library.n_controlled, basis.n_basis)
        matrix, offset = matrix.reshape(*shape, -1), offset.reshape(shape)
        covariance = covariance.reshape(*shape, *shape)
        design, slope = basis.design_matrix(self.phase), basis.derivative_matrix(self.phase)
        start = basis.design_matrix(np.zeros(1))[0]

        def rows(values: Floats) -> Floats:
            """Values of the DOFs at all phases, and of their slopes, (2, T Q, ...)."""
            parts = [np.tensordot(part, values, axes=(1, 1)) for part in (design, slope)]
            return np.array([part.reshape(-1, *values.shape[2:]) for part in parts])

        self._response, self._base, self._matrix, self._design = (
            rows(matrix),
            rows(offset),
            matrix,
            design,
        )
        self._start_response = np.tensordot(start, matrix, axes=(0, 1))
        self._start_base = offset @ start
        toward_start = covariance @ start  # (Q, N, Q)
        self._start_cross = rows(toward_start)
        self._start_covariance = np.tensordot(start, toward_start, axes=(0, 1))
        own = np.einsum("qnqm->qnm", covariance)
        variance = np.einsum("tn,qnm,tm->tq", design, own, design, optimize=True)
        self._variance, self._noise_at_all = variance.ravel(), np.tile(self._noise, n_points)

    def predict(
        self, observed: Gaussian, duration_s: float, start: StartPosture | None = None
    ) -> Trajectory:
        """The trajectory given the filtered observed weights, and the start posture if known.

        Args:
            observed: weights of the observed DOFs, (P N).
            duration_s: time from phase 0 to 1.
            start: measured posture of the controlled agent at onset.
        """
        values = self._response @ observed.mean + self._base
        within = self._matrix @ observed.covariance @ self._matrix.swapaxes(1, 2)  # (Q, N, N)
        at = np.add.reduce((self._design @ within) * self._design, axis=2)
        scale = self._regressions.uncertainty(self._task, *observed)
        variance = scale * self._variance + self._noise_at_all + at.T.ravel()
        if start is not None:
            toward = observed.covariance @ self._start_response.T
            covariance = scale * self._start_covariance + self._start_response @ toward
            covariance = symmetrize(covariance)
            covariance += np.diag(start.variance + self._noise)
            expected = self._start_response @ observed.mean + self._start_base
            cross = self._response @ toward + scale * self._start_cross
            cross, innovation, _ = whiten_innovation(
                covariance,
                cross.reshape(-1, self._n_controlled).T,
                start.position - expected,
                name="start posture covariance",
            )
            values += (innovation @ cross).reshape(values.shape)
            cross = cross[:, : variance.size]
            variance -= np.einsum("qa,qa->a", cross, cross)
        positions, slopes = values.reshape(2, -1, self._n_controlled)
        std = np.sqrt(variance).reshape(-1, self._n_controlled)
        return Trajectory(self.phase * duration_s, positions, slopes / duration_s, std)
