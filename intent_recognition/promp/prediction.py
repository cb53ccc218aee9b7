# SPDX-License-Identifier: Apache-2.0
"""From the filtered observed weights to trajectories of both agents."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, condition, symmetrize
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.trajectory import dof_variance
from intent_recognition.signals import SPATIAL_UNITS, TURNS

USUAL_END_STD = {"rad": 0.35, "m": 0.1}
"""Largest standard deviation of a predicted end at which the robot acts [rad, m]
(docs/decisions/end_certainty.md)."""
CERTAIN_END = 1.5
"""Least value of that limit, relative to the standard deviation that a wholly observed movement
leaves (docs/decisions/end_certainty.md)."""


class StartPosture(NamedTuple):
    """Measured position of the controlled agent at onset, (Q,), and its variance, (Q,)."""

    position: Floats
    variance: Floats


def controlled_weights(
    library: TaskLibrary, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    They are N(A m_o + b, u C + A P_o A^T), exactly (`TaskLibrary.regressions`), where u accounts
    for the uncertain coefficients A (`Regressions.uncertainty`). A start posture is one more
    observation of the controlled weights, at phase 0; it does not influence recognition.

    Args:
        library: the learned tasks.
        task: index of the task.
        observed: filtered observed weights, (P N,) and (P N, P N).
        start: measured posture at onset; None if it is not known.

    Returns:
        Mean (Q N,) and covariance (Q N, Q N).
    """
    matrix, offset, covariance = library.regressions[task]
    mean = matrix @ observed.mean + offset
    covariance = library.regressions.uncertainty(task, *observed) * covariance
    covariance = symmetrize(covariance + matrix @ observed.covariance @ matrix.T)
    if start is None:
        return Gaussian(mean, covariance)
    row = library.basis.design_matrix(np.zeros(1))
    design = np.kron(np.eye(library.n_controlled), row).astype(np.float64, copy=False)
    noise = np.diag(start.variance + library.control_noise_variance())
    return condition(Gaussian(mean, covariance), design, start.position, noise)[0]


def largest_by_unit(std: Floats, units: Sequence[str]) -> dict[str, float]:
    """Largest of the standard deviations (d,) among the DOFs of each unit."""
    largest: dict[str, float] = {}
    for value, unit in zip(std.tolist(), units, strict=True):
        largest[unit] = max(value, largest.get(unit, value))
    return largest


def angle_starts(library: TaskLibrary) -> tuple[float | None, ...]:
    """Start of each DOF that is an angle, observed ones first; None for other DOFs.

    It is half-way between the extreme mean starts of the tasks: all were learned within one turn.
    """
    start = library.basis.design_matrix(np.zeros(1))[0]
    mean = library.weight_mean.reshape(library.n_tasks, len(library.units), -1) @ start
    middle = (0.5 * (mean.min(axis=0) + mean.max(axis=0))).tolist()
    pairs = zip(library.units, middle, strict=True)
    return tuple(at if unit in TURNS else None for unit, at in pairs)


def controlled_spread(library: TaskLibrary) -> Floats:
    """Spread of the demonstrations in the unit of each controlled DOF, (Q,).

    It is the standard deviation over all tasks, phases and demonstrations, and the largest among
    the DOFs of one unit. Constants for units other than m and rad are relative to it.
    """
    n, size = library.n_controlled, library.n_observed_weights
    mean = library.weight_mean[:, size:].reshape(library.n_tasks, n, -1)
    variance = np.diagonal(library.weight_covariance, axis1=1, axis2=2)[:, size:]
    square = (mean - mean.mean(axis=(0, 2), keepdims=True)) ** 2 + variance.reshape(mean.shape)
    of_unit = largest_by_unit(np.sqrt(square.mean(axis=(0, 2))), library.controlled_units)
    return np.array([of_unit[unit] for unit in library.controlled_units])


def least_end_std(library: TaskLibrary, task: int, *, start_known: bool = True) -> dict[str, float]:
    """Least standard deviation of a task's predicted end, however much is observed, by unit.

    It is the largest among the controlled DOFs of a unit if the observed weights are known exactly
    and, like the duration, are about one standard deviation from their means. With `start_known`,
    the controlled agent's start is known exactly, too.
    """
    n, size = library.n_controlled, library.n_observed_weights
    usual = np.linalg.cholesky(library.weight_covariance[task, :size, :size]).sum(axis=1)
    known = Gaussian(library.weight_mean[task, :size] + usual, np.zeros((size, size)))
    start = StartPosture(np.zeros(n), np.zeros(n)) if start_known else None
    covariance = controlled_weights(library, task, known, start).covariance
    long_s = library.usual_s[task] * np.exp(library.log_duration_std[task])
    scaling = library.in_durations(task, long_s)
    variance = dof_variance(library.basis.design_matrix(np.ones(1)) @ scaling, covariance)[0]
    std = np.sqrt(variance + library.control_noise_variance())
    return largest_by_unit(std, library.controlled_units)


def end_std_limits(library: TaskLibrary) -> dict[str, dict[str, float]]:
    """Largest accepted standard deviation of each task's predicted end, by label and unit.

    It is `USUAL_END_STD`, or `CERTAIN_END` times the standard deviation that observing the whole
    movement leaves, whichever is larger.
    """
    spread = zip(library.controlled_units, controlled_spread(library).tolist(), strict=True)
    # about as large as 0.1 m is for a reach
    share = {unit: 0.5 * std for unit, std in spread if unit not in SPATIAL_UNITS}
    usual = USUAL_END_STD | share
    return {
        label: {
            unit: max(CERTAIN_END * std, usual.get(unit, 0.0))
            for unit, std in least_end_std(library, k, start_known=False).items()
        }
        for k, label in enumerate(library.labels)
    }
