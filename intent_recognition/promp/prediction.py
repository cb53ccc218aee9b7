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
"""Largest standard deviation of a predicted end that is acted on, by unit, in [rad] and [m]
(docs/decisions/end_certainty.md)."""
CERTAIN_END = 1.5
"""Where a whole movement leaves more than that, its standard deviation may be this many times as
large (docs/decisions/end_certainty.md)."""


class StartPosture(NamedTuple):
    """The controlled agent's measured position at onset: (Q,) and its variance (Q,)."""

    position: Floats
    variance: Floats


def controlled_weights(
    library: TaskLibrary, task: int, observed: Gaussian, start: StartPosture | None = None
) -> Gaussian:
    """Controlled weights given the task and the filtered observed weights.

    N(A m_o + b, u C + A P_o A^T), exact (`TaskLibrary.regressions`), with u for the uncertain
    coefficients A (`Regressions.uncertainty`). A start posture is one
    more observation of the controlled weights at phase 0; it does not bear on the task.

    Args:
        library: the learned tasks.
        task: its number.
        observed: filtered observed weights, (P N,) and (P N, P N).
        start: measured posture at onset; None where it is not known.

    Returns:
        (Q N,) and (Q N, Q N).
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
    """The largest of some standard deviations (d,) over the DOFs of each unit."""
    largest: dict[str, float] = {}
    for value, unit in zip(std.tolist(), units, strict=True):
        largest[unit] = max(value, largest.get(unit, value))
    return largest


def angle_starts(library: TaskLibrary) -> tuple[float | None, ...]:
    """Where each DOF that is an angle begins, observed ones first; None for other DOFs.

    Half-way between the tasks' extreme means: all tasks were learned in one turn about it.
    """
    start = library.basis.design_matrix(np.zeros(1))[0]
    mean = library.weight_mean.reshape(library.n_tasks, len(library.units), -1) @ start
    middle = (0.5 * (mean.min(axis=0) + mean.max(axis=0))).tolist()
    pairs = zip(library.units, middle, strict=True)
    return tuple(at if unit in TURNS else None for unit, at in pairs)


def controlled_spread(library: TaskLibrary) -> Floats:
    """How far the demonstrations go in the unit of each controlled DOF, (Q,).

    Standard deviation over all tasks, phases and demonstrations, the largest of the DOFs that have
    the unit: what a constant is measured by where it can be in neither metres nor radians.
    """
    n, size = library.n_controlled, library.n_observed_weights
    mean = library.weight_mean[:, size:].reshape(library.n_tasks, n, -1)
    variance = np.diagonal(library.weight_covariance, axis1=1, axis2=2)[:, size:]
    square = (mean - mean.mean(axis=(0, 2), keepdims=True)) ** 2 + variance.reshape(mean.shape)
    of_unit = largest_by_unit(np.sqrt(square.mean(axis=(0, 2))), library.controlled_units)
    return np.array([of_unit[unit] for unit in library.controlled_units])


def least_end_std(library: TaskLibrary, task: int, *, start_known: bool = True) -> dict[str, float]:
    """Least uncertainty of a task's predicted end, however much is observed, by unit.

    Largest standard deviation over the controlled DOFs of each unit when the observed weights are
    known exactly, and they and the duration are as far from their means as those of a person
    usually are; with `start_known` the controlled agent's start, too.
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
    """What is asked of the certainty of each task's predicted end, by label and unit.

    `USUAL_END_STD`, but never what even the whole movement cannot give: at least `CERTAIN_END`
    times the least standard deviation that observing it leaves.
    """
    spread = zip(library.controlled_units, controlled_spread(library).tolist(), strict=True)
    # about what 0.1 m are of a reach
    share = {unit: 0.5 * std for unit, std in spread if unit not in SPATIAL_UNITS}
    usual = USUAL_END_STD | share
    return {
        label: {
            unit: max(CERTAIN_END * std, usual.get(unit, 0.0))
            for unit, std in least_end_std(library, k, start_known=False).items()
        }
        for k, label in enumerate(library.labels)
    }
