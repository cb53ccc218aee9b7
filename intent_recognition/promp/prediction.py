# SPDX-License-Identifier: Apache-2.0
"""From the filtered observed weights to trajectories of both agents."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, condition, symmetrize
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.trajectory import dof_variance

CERTAIN_END = 1.25
"""A predicted end is certain when its standard deviation is at most this many times the least that
a whole movement leaves (docs/decisions/end_certainty.md)."""


class StartPosture(NamedTuple):
    """The controlled agent's measured position at onset: (Q,) and its variance (Q,)."""

    position: NDArray[np.float64]
    variance: NDArray[np.float64]


def controlled_weights(
    library: TaskLibrary, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    N(A m_o + b, C + A P_o A^T), exact (`TaskLibrary.regressions`). A start posture is one
    more observation of the controlled weights at phase 0; it does not bear on the task.
    """
    matrix, offset, covariance = library.regressions[task]
    mean = matrix @ observed.mean + offset
    covariance = symmetrize(covariance + matrix @ observed.covariance @ matrix.T)
    if start is None:
        return Gaussian(mean, covariance)
    row = library.basis.design_matrix(np.zeros(1))
    design = np.kron(np.eye(library.n_controlled), row).astype(np.float64, copy=False)
    noise = np.diag(start.variance + library.control_noise_variance())
    return condition(Gaussian(mean, covariance), design, start.position, noise)[0]


def largest_by_unit(std: NDArray[np.float64], units: Sequence[str]) -> dict[str, float]:
    """The largest of some standard deviations (d,) over the DOFs of each unit."""
    largest: dict[str, float] = {}
    for value, unit in zip(std.tolist(), units, strict=True):
        largest[unit] = max(value, largest.get(unit, value))
    return largest


def least_end_std(library: TaskLibrary, task: int, *, start_known: bool = True) -> dict[str, float]:
    """Least uncertainty of a task's predicted end, however much is observed, by unit.

    Largest standard deviation over the controlled DOFs of each unit when the observed weights are
    known exactly.

    Args:
        library: the learned tasks.
        task: number of the task.
        start_known: whether the controlled agent's start is known exactly, too.
    """
    n, size = library.n_controlled, library.n_observed_weights
    known = Gaussian(np.zeros(size), np.zeros((size, size)))
    start = StartPosture(np.zeros(n), np.zeros(n)) if start_known else None
    covariance = controlled_weights(library, task, known, start).covariance
    variance = dof_variance(library.basis.design_matrix(np.ones(1)), covariance)[0]
    std = np.sqrt(variance + library.control_noise_variance())
    return largest_by_unit(std, library.controlled_units)


def end_std_limits(library: TaskLibrary) -> dict[str, dict[str, float]]:
    """What may be asked of the certainty of each task's predicted end, by label and unit.

    `CERTAIN_END` times the least that observing the whole movement leaves.
    """
    return {
        label: {
            unit: CERTAIN_END * std
            for unit, std in least_end_std(library, k, start_known=False).items()
        }
        for k, label in enumerate(library.labels)
    }
