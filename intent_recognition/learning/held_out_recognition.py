# SPDX-License-Identifier: Apache-2.0
"""How well held-out demonstrations are recognised, and the regularisation chosen by it.

Each demonstration is removed from the statistics of its task, in closed form. The log evidence of
the tasks is then computed along the demonstration, its duration unknown. The score is the mean log
loss over the samples: a model that is overconfident early pays for it, and so does one that
recognises late.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.examples import sample_phases
from intent_recognition.learning.movement_evidence import prefix_log_evidence
from intent_recognition.learning.preprocessing import Preprocessing
from intent_recognition.learning.selection import Hyperparameters
from intent_recognition.learning.statistics import (
    TaskStatistics,
    pooled_moments,
    variance_scales,
)
from intent_recognition.learning.timing import (
    mean_timing_covariance,
    timing_covariance,
    unshown_timing_covariance,
)
from intent_recognition.promp import (
    Scatter,
    TaskLibrary,
    leave_one_out_scatter,
    observed_block,
    recognition_covariances,
)

RECOGNITION_STRENGTHS = (1.0, 4.0)
"""Equivalent sample sizes, in demonstrations, of the target of the recognition covariances that
are tried (docs/prediction.md)."""
RECOGNITION_NOISE_SCALES = (1.0, 4.0, 16.0)
"""Factors of the observed DOFs' noise variance in recognition that are tried (docs/prediction.md).
"""
MAX_RECOGNISED = 60
"""Demonstrations held out to choose the two, evenly drawn from all tasks. Convention: it bounds the
time."""
MAX_RIVALS = 8
"""Other tasks, those with the nearest means, that a demonstration is compared with. Convention: it
bounds the time; tasks farther away have no evidence to speak of."""
T = TypeVar("T")


def recognition_covariance(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing, strength: float
) -> NDArray[np.float64]:
    """Covariances of the observed weights that tasks are recognised by, (K, P N, P N).

    Args:
        tasks: statistics of each label.
        preprocessing: how their examples were made.
        strength: equivalent sample size of the covariances' target.
    """
    floor, _ = variance_scales(tasks)
    basis, n_dofs = preprocessing.basis, preprocessing.n_observed
    size = n_dofs * basis.n_basis
    pooled = observed_block(pooled_moments(tasks.values()), size)
    own = [observed_block(task.moments, size) for task in tasks.values()]
    means = [task.mean[:n_dofs].ravel() for task in tasks.values()]
    covariances = recognition_covariances(own, pooled, floor[:n_dofs], strength)
    deviation = preprocessing.timing.phase_deviation
    shared = mean_timing_covariance(basis, means, deviation)
    for covariance, mean in zip(covariances, means, strict=True):
        covariance += unshown_timing_covariance(timing_covariance(basis, mean, deviation), shared)
    return covariances


def choose_recognition(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    chosen: Hyperparameters,
) -> Hyperparameters:
    """Hyperparameters of recognition, by the log loss of held-out demonstrations.

    Args:
        library: of the same statistics, whatever its recognition covariance.
        tasks: statistics of each label.
        preprocessing: how their examples were made.
        chosen: the other hyperparameters.
    """
    candidates = [
        chosen._replace(recognition_strength=strength, recognition_noise_scale=noise_scale)
        for noise_scale in RECOGNITION_NOISE_SCALES
        for strength in RECOGNITION_STRENGTHS
    ]
    losses = []
    for candidate in candidates:
        strength = candidate.recognition_strength
        recognising = replace(
            library,
            recognition_covariance=recognition_covariance(tasks, preprocessing, strength),
            recognition_noise_scale=candidate.recognition_noise_scale,
        )
        losses.append(recognition_losses(recognising, tasks, preprocessing, strength))
    return candidates[least_noise(np.array(losses))]


def recognition_losses(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    strength: float,
) -> NDArray[np.float64]:
    """Log loss of held-out demonstrations, mean over their samples, natural logarithm, (n,).

    The duration is unknown, and `none` does not compete. Empty where there is one task only.

    Args:
        library: the learned tasks, their recognition covariance of this strength.
        tasks: their statistics.
        preprocessing: how their examples were made.
        strength: equivalent sample size of the covariances' target.
    """
    losses = []
    for one in held_out(library, tasks, preprocessing, strength, MAX_RECOGNISED):
        others = np.delete(np.arange(library.n_tasks), one.task)
        if one.own is None or not len(others):
            continue
        own = own_evidence(library, one, one.own)
        everyone = np.logaddexp.reduce([own, *others_evidence(library, one, others)], axis=0)
        losses.append(np.mean(everyone - own))
    return np.array(losses)


def least_noise(losses: NDArray[np.float64]) -> int:
    """The first of several models whose loss is within one paired standard error of the least.

    With models in the order of their noise it is the one that recognises earliest.

    Args:
        losses: of each model and demonstration, (c, n).
    """
    if losses.shape[1] < 2:
        return 0
    excess = losses - losses[np.argmin(losses.mean(axis=1))]
    error = excess.std(axis=1, ddof=1) / np.sqrt(losses.shape[1])
    return int(np.argmax(excess.mean(axis=1) <= error + 1e-12))


class HeldOut(NamedTuple):
    """One demonstration, and what its task looks like without it.

    Attributes:
        task: its task's number.
        times_s: times of its samples after the start, (m,), the same for all, increasing.
        values: observed DOFs, (m, P).
        own: observed weights of its task learned without it, (P N); None if nothing is left.
    """

    task: int
    times_s: NDArray[np.float64]
    values: NDArray[np.float64]
    own: Gaussian | None


def held_out(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    strength: float,
    most: int,
) -> Iterator[HeldOut]:
    """Demonstrations, evenly drawn from all tasks, each with its task learned without it.

    Args:
        library: the learned tasks.
        tasks: their statistics.
        preprocessing: how their examples were made.
        strength: equivalent sample size of the recognition covariances' target.
        most: how many.
    """
    size, n_dofs = library.n_observed_weights, library.n_observed
    pooled = observed_block(pooled_moments(tasks.values()), size)
    floor, _ = variance_scales(tasks)
    basis, phase_deviation = library.basis, preprocessing.timing.phase_deviation
    means = [task.mean[:n_dofs].ravel() for task in tasks.values()]
    shared = mean_timing_covariance(basis, means, phase_deviation)
    every = [(k, task, e) for k, task in enumerate(tasks.values()) for e in task.examples]
    for number, task, example in _evenly(every, most):
        own = None
        if task.n > 1:
            deviation = (example.weights - task.mean)[:n_dofs]
            mine, rest = observed_block(task.moments, size), pooled
            if pooled.freedom > 1:
                part = leave_one_out_scatter(mine, deviation.ravel())
                rest = Scatter(pooled.matrix - (mine.matrix - part), pooled.freedom - 1)
                mine = Scatter(part, mine.freedom - 1)
            (covariance,) = recognition_covariances([mine], rest, floor[:n_dofs], strength)
            mean = (task.mean[:n_dofs] - deviation / (task.n - 1)).ravel()
            with_it, timing = (
                timing_covariance(basis, m, phase_deviation) for m in (means[number], mean)
            )
            timing = unshown_timing_covariance(timing, shared + (timing - with_it) / len(means))
            own = Gaussian(mean, covariance + timing)
        times_s = sample_phases() * example.duration_s
        yield HeldOut(number, times_s, example.observed, own)


def own_evidence(library: TaskLibrary, one: HeldOut, own: Gaussian) -> NDArray[np.float64]:
    """Log evidence of its own task, learned without it, along the movement, (m,)."""
    timing = np.array([library.log_duration_mean[one.task], library.log_duration_std[one.task]])
    return prefix_log_evidence(library, own, timing, one.times_s, one.values)


def others_evidence(
    library: TaskLibrary, one: HeldOut, others: NDArray[np.int64]
) -> list[NDArray[np.float64]]:
    """Log evidence of the nearest of the other tasks along the movement, each (m,)."""
    return [
        prefix_log_evidence(
            library,
            Gaussian(library.observed_mean[task], library.observed_covariance[task]),
            np.array([library.log_duration_mean[task], library.log_duration_std[task]]),
            one.times_s,
            one.values,
        )
        for task in _nearest(library, one, others)
    ]


def total_evidence(evidence: Sequence[NDArray[np.float64]], n_tasks: int) -> NDArray[np.float64]:
    """Log evidence of all tasks under equal priors, (m,); those left out are too far to count."""
    return np.logaddexp.reduce(np.array(evidence), axis=0) - np.log(n_tasks)


def _nearest(library: TaskLibrary, one: HeldOut, others: NDArray[np.int64]) -> NDArray[np.int64]:
    """The tasks whose means come nearest to the movement, at most `MAX_RIVALS`."""
    if len(others) <= MAX_RIVALS:
        return others
    design = library.basis.design_matrix(one.times_s / one.times_s[-1])
    means = library.observed_mean[others].reshape(len(others), library.n_observed, -1)
    path = np.einsum("mn,kpn->kmp", design, means)
    return others[np.argsort(np.sum((path - one.values) ** 2, axis=(1, 2)))[:MAX_RIVALS]]


def _evenly(items: Sequence[T], most: int) -> Iterator[T]:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return (items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int))
