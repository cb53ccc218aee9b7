# SPDX-License-Identifier: Apache-2.0
"""One observation of the human's hand, as a user of other libraries would take it.

movement_primitives and filterpy know no observed block: they hold one task's weights of both
agents. movement_primitives conditions on all DOFs or none, so those not observed get a variance
of 1e6. simdkalman takes all tasks at once, and is given the human's weights only.
"""

from collections.abc import Callable

import numpy as np
from filterpy.kalman import KalmanFilter
from movement_primitives.promp import ProMP
from simdkalman.primitives import update

from intent_recognition.promp import TaskLibrary

NOT_OBSERVED = 1e6
Peer = Callable[[], tuple[np.ndarray, np.ndarray]]
"""Takes the observation; returns mean and covariance of the human's weights, of the first task."""
MATRIX_GIVEN = ("filterpy", "simdkalman")
ALL_AT_ONCE = ("simdkalman",)


def movement_primitives(
    library: TaskLibrary, noise: np.ndarray, values: np.ndarray, phase: float
) -> Peer:
    """One task's observation in movement_primitives."""
    n_dofs = library.n_observed + library.n_controlled
    promp = ProMP(n_dims=n_dofs, n_weights_per_dim=library.basis.n_basis)
    promp.from_weight_distribution(*library.primitive(0).weights)
    y, covariance = np.zeros(n_dofs), NOT_OBSERVED * np.eye(n_dofs)
    y[: len(values)] = values
    covariance[: len(values), : len(values)] = noise
    n = library.n_observed_weights

    def observe() -> tuple[np.ndarray, np.ndarray]:
        posterior = promp.condition_position(y, y_cov=covariance, t=phase)
        return posterior.weight_mean[:n], posterior.weight_cov[:n, :n]

    return observe


def filterpy(library: TaskLibrary, noise: np.ndarray, values: np.ndarray, phase: float) -> Peer:
    """One task's observation in filterpy; the observation matrix is made beforehand."""
    mean, covariance = library.primitive(0).weights
    filtered = KalmanFilter(dim_x=len(mean), dim_z=len(values))
    filtered.x, filtered.P, filtered.R = mean[:, None].copy(), covariance.copy(), noise
    n_dofs = library.n_observed + library.n_controlled
    matrix = np.kron(np.eye(n_dofs)[: len(values)], library.basis.design_matrix(np.array([phase])))
    n, column = library.n_observed_weights, values[:, None]

    def observe() -> tuple[np.ndarray, np.ndarray]:
        filtered.update(column, H=matrix)
        return filtered.x[:n, 0], filtered.P[:n, :n]

    return observe


def simdkalman(library: TaskLibrary, noise: np.ndarray, values: np.ndarray, phase: float) -> Peer:
    """All tasks' observation in simdkalman, on the human's weights."""
    mean = library.observed_mean[:-1, :, None].copy()
    covariance = library.observed_covariance[:-1].copy()
    matrix = np.kron(np.eye(len(values)), library.basis.design_matrix(np.array([phase])))
    matrix = np.repeat(matrix[None], len(mean), axis=0)
    y = np.repeat(values[None, :, None], len(mean), axis=0)

    def observe() -> tuple[np.ndarray, np.ndarray]:
        filtered = update(mean, covariance, matrix, noise, y)
        return filtered[0][0, :, 0], filtered[1][0]

    return observe
