# SPDX-License-Identifier: Apache-2.0
"""How much evidence a movement must show against `none`, learned from demonstrations.

The log Bayes factor of the known tasks over none is followed through every demonstration, once
with a library that knows its task (the demonstration itself left out) and once with one that does
not. A decision is taken the first time a probability is high enough, so the highest factor that an
unknown movement reaches on its way counts, and the lowest one of a known movement; what lies
between them decides nothing. Where there is only one task, unknown movements are drawn from none.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from intent_recognition.gaussian.linalg import LOG_2_PI, cholesky
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp.bank import N_SCALES, SCALE_SPAN
from intent_recognition.promp.examples import sample_phases
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.none import departure, none_primitive, none_timing
from intent_recognition.promp.prior import (
    Scatter,
    leave_one_out_scatter,
    observed_block,
    recognition_covariances,
)
from intent_recognition.promp.statistics import TaskStatistics, pooled_moments

SPREADS = 2.0
"""Standard deviations beyond the mean extreme at which a factor begins to count."""
RARE = 0.02
"""Share of known movements that may speak for none; their worst factors have a long tail."""
TAIL_RATE = 2.373
"""Rate at which a normal distribution's tail falls there, d(-log(1 - Phi(z)))/dz at z = 2."""
MAX_CALIBRATED = 120
NEAREST = 8
"""Demonstrations followed, and other tasks that each is compared with, at most."""
N_IMAGINED = 40
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


def calibrate(known: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """How a log Bayes factor of the known tasks over none is to be read, (4,).

    Slope and threshold above which it speaks for a known task, slope and threshold below which
    against, as `recognition.read_factor` takes them. Slopes are at most 1: evidence is never made
    stronger than it is.

    Args:
        known: factors through movements of known tasks, (n, m).
        unknown: through movements of tasks left out, (n', m). With fewer than two of either, that
            side is read as it is: slope 1, threshold 0.
    """
    upper_slope = lower_slope = 1.0
    upper = lower = 0.0
    if len(unknown) > 1:
        best = np.max(unknown, axis=1)
        spread = max(float(best.std(ddof=1)), 1e-9)
        upper_slope = min(1.0, TAIL_RATE / spread)
        upper = max(float(best.mean()) + SPREADS * spread, 0.0)
    if len(known) > 1:
        worst = np.min(known, axis=1)
        spread = max(float(worst.std(ddof=1)), 1e-9)
        lower_slope = min(1.0, TAIL_RATE / spread)
        usual = float(worst.mean()) - SPREADS * spread
        lower = min(usual, float(np.quantile(worst, RARE)), 0.0)
    return np.array([upper_slope, upper, lower_slope, lower])


def calibrate_none(
    library: TaskLibrary, tasks: Mapping[str, TaskStatistics], strength: float, floor: np.ndarray
) -> np.ndarray:
    """The calibration of a library's none, from `MAX_CALIBRATED` of its demonstrations, (4,).

    Args:
        library: the learned tasks; its own none is not looked at.
        tasks: their statistics.
        strength: of the targets of the covariances that tasks are told apart by.
        floor: variance floor per DOF, (D,).
    """
    departed = departure(list(tasks.values()), library.n_observed)
    known, unknown = [], []
    for one in _held_out(library, tasks, strength, floor):
        others = np.delete(np.arange(library.n_tasks), one.task)
        evidence = _others_evidence(library, one, others)
        if len(others):
            none = _evidence_of_none(library, one, others, None, departed)
            unknown.append(_total(evidence, len(others)) - none)
        if one.own is not None:
            timing = (library.log_duration_mean[one.task], library.log_duration_std[one.task])
            own = prefix_log_evidence(library, one.own, np.array(timing), one.times_s, one.values)
            everyone = np.arange(library.n_tasks)
            none = _evidence_of_none(library, one, everyone, one.own, departed)
            known.append(_total([*evidence, own], library.n_tasks) - none)
    if library.n_tasks == 1:
        unknown = _imagined(library, departed)
    return calibrate(np.array(known), np.array(unknown))


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


def _held_out(
    library: TaskLibrary, tasks: Mapping[str, TaskStatistics], strength: float, floor: np.ndarray
) -> Iterator[HeldOut]:
    """Demonstrations, evenly drawn from all tasks, each with its task learned without it."""
    size, n_dofs = library.n_observed_weights, library.n_observed
    pooled = observed_block(pooled_moments(tasks.values()), size)
    every = [(k, task, e) for k, task in enumerate(tasks.values()) for e in task.examples]
    for number, task, example in _evenly(every, MAX_CALIBRATED):
        own = None
        if task.n > 1:
            deviation = (example.weights - task.mean)[:n_dofs]
            mine, rest = observed_block(task.moments, size), pooled
            if pooled.freedom > 1:
                part = leave_one_out_scatter(mine, deviation.ravel())
                rest = Scatter(pooled.matrix - (mine.matrix - part), pooled.freedom - 1)
                mine = Scatter(part, mine.freedom - 1)
            (covariance,) = recognition_covariances([mine], rest, floor[:n_dofs], strength)
            own = Gaussian((task.mean[:n_dofs] - deviation / (task.n - 1)).ravel(), covariance)
        times_s = sample_phases() * example.duration_s
        yield HeldOut(number, times_s, example.observed, own)


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


def _imagined(library: TaskLibrary, departed: np.ndarray) -> list[np.ndarray]:
    """Factors through movements drawn from none itself, where no task can be left out."""
    rng = np.random.default_rng(N_IMAGINED)
    every = np.arange(library.n_tasks)
    means = library.observed_mean[every].reshape(len(every), library.n_observed, -1)
    none = none_primitive(means, library.observed_covariance[every], departed)
    log_mean, log_std = none_timing(library.log_duration_mean, library.log_duration_std)
    design = library.basis.design_matrix(sample_phases())
    weights = rng.multivariate_normal(none.mean, none.covariance, size=N_IMAGINED)
    noise_std = np.sqrt(library.noise_variance[: library.n_observed])
    factors = []
    for one in weights.reshape(N_IMAGINED, library.n_observed, -1):
        times_s = sample_phases() * np.exp(log_mean + log_std * rng.normal())
        values = design @ one.T + noise_std * rng.normal(size=(len(design), library.n_observed))
        imagined = HeldOut(-1, times_s, values, None)
        evidence = _others_evidence(library, imagined, every)
        none_evidence = _evidence_of_none(library, imagined, every, None, departed)
        factors.append(_total(evidence, library.n_tasks) - none_evidence)
    return factors


def _others_evidence(library: TaskLibrary, one: HeldOut, others: np.ndarray) -> list[np.ndarray]:
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


def _nearest(library: TaskLibrary, one: HeldOut, others: np.ndarray) -> np.ndarray:
    """The tasks whose means come nearest to the movement, at most `NEAREST`."""
    if len(others) <= NEAREST:
        return others
    design = library.basis.design_matrix(one.times_s / one.times_s[-1])
    means = library.observed_mean[others].reshape(len(others), library.n_observed, -1)
    path = np.einsum("mn,kpn->kmp", design, means)
    return others[np.argsort(np.sum((path - one.values) ** 2, axis=(1, 2)))[:NEAREST]]


def _evidence_of_none(
    library: TaskLibrary,
    one: HeldOut,
    tasks: np.ndarray,
    own: Gaussian | None,
    departed: np.ndarray,
) -> np.ndarray:
    """Log evidence of none as a library of these tasks would have it, `own` in place of its own."""
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


def _total(evidence: Sequence[np.ndarray], n_tasks: int) -> np.ndarray:
    """Log evidence of all tasks under equal priors; those left out are too far to count."""
    return np.logaddexp.reduce(np.array(evidence), axis=0) - np.log(n_tasks)


def _evenly(items: Sequence, most: int) -> Iterator:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return (items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int))
