# SPDX-License-Identifier: Apache-2.0
"""Demonstrations followed through the tasks' evidence, each with its task learned without it."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from intent_recognition.filtering import N_SCALES, SCALE_SPAN
from intent_recognition.gaussian import LOG_2_PI, Gaussian, cholesky
from intent_recognition.learning.accumulation import Reference
from intent_recognition.learning.examples import sample_phases
from intent_recognition.learning.fitting import scales
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments
from intent_recognition.learning.timing_covariance import (
    mean_timing,
    timing_covariance,
    unseen_timing,
)
from intent_recognition.learning.unknown_task import none_primitive, none_timing
from intent_recognition.promp import (
    Scatter,
    TaskLibrary,
    leave_one_out_scatter,
    observed_block,
    recognition_covariances,
)

NEAREST = 8
"""Other tasks that a demonstration is compared with, at most."""
LEAST_NOISE = 1e-12
"""Part of a movement's largest variance that the noise is at least, where there is hardly any."""


class HeldOut(NamedTuple):
    """One demonstration, and what its task looks like without it.

    Attributes:
        task: its task's number.
        times_s: times of its samples after the start, (m,), the same for all, increasing.
        values: observed DOFs, (m, P).
        own: observed weights of its task learned without it, (P N); None if nothing is left.
    """

    task: int
    times_s: np.ndarray
    values: np.ndarray
    own: Gaussian | None


def held_out(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    strength: float,
    most: int,
) -> Iterator[HeldOut]:
    """Demonstrations, evenly drawn from all tasks, each with its task learned without it.

    Args:
        library: the learned tasks.
        tasks: their statistics.
        reference: how their examples were made.
        strength: of the targets of the covariances that tasks are told apart by.
        most: how many.
    """
    size, n_dofs = library.n_observed_weights, library.n_observed
    pooled = observed_block(pooled_moments(tasks.values()), size)
    floor, _ = scales(tasks)
    basis, phase_deviation = library.basis, reference.timing.phase_deviation
    means = [task.mean[:n_dofs].ravel() for task in tasks.values()]
    shared = mean_timing(basis, means, phase_deviation)
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
            timing = unseen_timing(timing, shared + (timing - with_it) / len(means))
            own = Gaussian(mean, covariance + timing)
        times_s = sample_phases() * example.duration_s
        yield HeldOut(number, times_s, example.observed, own)


def own_evidence(library: TaskLibrary, one: HeldOut) -> np.ndarray:
    """Log evidence of its own task, learned without it, through the movement, (m,)."""
    timing = np.array([library.log_duration_mean[one.task], library.log_duration_std[one.task]])
    return prefix_log_evidence(library, one.own, timing, one.times_s, one.values)


def others_evidence(library: TaskLibrary, one: HeldOut, others: np.ndarray) -> list[np.ndarray]:
    """Log evidence of the nearest of the other tasks through the movement, each (m,)."""
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


def prefix_log_evidence(
    library: TaskLibrary,
    primitive: Gaussian,
    log_duration: np.ndarray,
    times_s: np.ndarray,
    values: np.ndarray,
) -> np.ndarray:
    """Log density of the first 1, 2, ... m samples, durations summed out, (m,).

    The sums of squares of one Cholesky factor per duration; equals conditioning on one sample
    after the other.

    Args:
        library: whose basis, noise and correlation time are used.
        primitive: of the observed weights, (P N,).
        log_duration: mean and standard deviation of the log duration in seconds, (2,).
        times_s: of the samples, (m,).
        values: (m, P).
    """
    m, n_dofs = values.shape
    offsets = np.linspace(-SCALE_SPAN, SCALE_SPAN, N_SCALES)
    log_weight = -0.5 * offsets**2
    log_weight -= np.logaddexp.reduce(log_weight)
    durations = np.exp(log_duration[0] + log_duration[1] * offsets)
    design = library.basis.design_matrix(np.clip(times_s / durations[:, None], 0.0, 1.0))
    mean, covariance = _at_samples(primitive, design, n_dofs)
    index = np.arange(m * n_dofs)
    noise = _noise(library, times_s, n_dofs)
    covariance[:, index, index] += np.maximum(noise, LEAST_NOISE * covariance.max())
    factor = cholesky(covariance, name="covariance of a movement")
    innovation = (values.ravel() - mean)[..., None]
    whitened = np.array(
        [solve_triangular(f, i, lower=True)[:, 0] for f, i in zip(factor, innovation, strict=True)]
    )
    density = -0.5 * (whitened**2 + LOG_2_PI) - np.log(factor[:, index, index])
    per_sample = density.reshape(N_SCALES, m, n_dofs).sum(axis=2)
    return np.logaddexp.reduce(np.cumsum(per_sample, axis=1) + log_weight[:, None], axis=0)


def _at_samples(
    primitive: Gaussian, design: np.ndarray, n_dofs: int
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (S, m P) and covariance (S, m P, m P) of samples in order, from designs (S, m, N)."""
    n_scales, m, n_basis = design.shape
    mean = np.einsum("smn,pn->smp", design, primitive.mean.reshape(n_dofs, n_basis))
    blocks = primitive.covariance.reshape(n_dofs, n_basis, n_dofs * n_basis)
    half = np.einsum("smn,pnk->smpk", design, blocks, optimize=True)
    half = half.reshape(n_scales, m * n_dofs, n_dofs, n_basis)
    full = np.einsum("saqn,smn->samq", half, design, optimize=True)
    shape = (n_scales, m * n_dofs, m * n_dofs)
    return mean.reshape(n_scales, -1), full.reshape(shape)


def _noise(library: TaskLibrary, times_s: np.ndarray, n_dofs: int) -> np.ndarray:
    """Noise variance of each value, in the order of the samples, (m P,)."""
    dofs = np.arange(n_dofs)
    intervals = np.r_[np.inf, np.diff(times_s)]
    return np.concatenate([np.diag(library.noise_covariance(dofs, dt)) for dt in intervals])


def evidence_of_none(
    library: TaskLibrary,
    one: HeldOut,
    tasks: np.ndarray,
    own: Gaussian | None,
    departed: np.ndarray,
) -> np.ndarray:
    """Log evidence of none as a library of these tasks would have it, (m,).

    Args:
        library: the learned tasks.
        one: the movement.
        tasks: numbers of the tasks that none is drawn from, (k,).
        own: in place of the library's model of its own task, where that is among them.
        departed: see `none.departure`.
    """
    n_basis = library.basis.n_basis
    means = library.observed_mean[tasks].reshape(len(tasks), -1, n_basis)
    covariances = library.observed_covariance[tasks]
    if own is not None:
        place = int(np.flatnonzero(tasks == one.task)[0])
        means[place] = own.mean.reshape(-1, n_basis)
        covariances[place] = own.covariance
    timing = none_timing(library.log_duration_mean[tasks], library.log_duration_std[tasks])
    none = none_primitive(means, covariances, departed)
    return prefix_log_evidence(library, none, timing, one.times_s, one.values)


def total_evidence(evidence: Sequence[np.ndarray], n_tasks: int) -> np.ndarray:
    """Log evidence of all tasks under equal priors, (m,); those left out are too far to count."""
    return np.logaddexp.reduce(np.array(evidence), axis=0) - np.log(n_tasks)


def _nearest(library: TaskLibrary, one: HeldOut, others: np.ndarray) -> np.ndarray:
    """The tasks whose means come nearest to the movement, at most `NEAREST`."""
    if len(others) <= NEAREST:
        return others
    design = library.basis.design_matrix(one.times_s / one.times_s[-1])
    means = library.observed_mean[others].reshape(len(others), library.n_observed, -1)
    path = np.einsum("mn,kpn->kmp", design, means)
    return others[np.argsort(np.sum((path - one.values) ** 2, axis=(1, 2)))[:NEAREST]]


def _evenly(items: Sequence, most: int) -> Iterator:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return (items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int))
