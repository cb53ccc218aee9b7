# SPDX-License-Identifier: Apache-2.0
"""The hypothesis that a movement is none of the known tasks: its model and its calibration.

The model: an unknown movement is one more draw from the population of the known tasks. Its mean is
distributed about their mean as they are themselves, and it varies as they vary. The scatter of few
tasks is hardly known, so it is shrunk towards how far movements depart from their starts.

The calibration: how much evidence against `none` counts is learned from the demonstrations. The log
Bayes factor of the known tasks over none is computed along each demonstration, once with a library
that knows its task (the demonstration itself held out) and once with a library without its task. A
decision is taken the first time a probability is high enough, so the highest factor of an unknown
movement counts, and the lowest of a known one; values between them decide nothing
(docs/recognition.md).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.learning.examples import sample_phases
from intent_recognition.learning.held_out_recognition import (
    HeldOut,
    held_out,
    others_evidence,
    own_evidence,
    total_evidence,
)
from intent_recognition.learning.movement_evidence import prefix_log_evidence
from intent_recognition.learning.preprocessing import Preprocessing
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import TaskLibrary

DEPARTURE_SAMPLE_SIZE = 0.25
"""Equivalent sample size, in tasks, of the prior that tasks differ as much as movements depart from
their starts (docs/recognition.md)."""
UNKNOWN_DEVIATION_WIDTH = 0.25
"""Width of the kernel, in phase, that correlates an unknown movement's deviation from the tasks'
mean along the movement. Convention."""
UNKNOWN_AMPLITUDE_WIDTH = 0.1
"""Width of the kernel, in phase, that the variance of this deviation is averaged with. Convention.
"""
EXTREME_STDS = 2.0
"""Standard deviations from the mean extreme at which a log Bayes factor begins to count
(docs/recognition.md)."""
LOWER_TAIL_PROBABILITY = 0.005
"""Share of known movements whose factor may count as evidence for none (docs/recognition.md)."""
TAIL_SHARE = 0.1
"""Share of known movements, those with the lowest factors, that an exponential tail is fitted to.
Convention."""
TAIL_RATE = 2.373
"""Rate at which the tail of a normal distribution falls at `EXTREME_STDS`:
d(-log(1 - Phi(z)))/dz at z = 2."""
MIN_DEMONSTRATIONS = 5
"""Demonstrations from which on a task is used for calibration, where two tasks have as many
(docs/recognition.md)."""
MAX_RECALIBRATED = 10
"""Demonstrations of a task beyond which one more does not ask for a new calibration
(docs/recognition.md)."""
MAX_CALIBRATED = 120
"""Demonstrations used for calibration at most. Convention: it bounds the time."""
N_SIMULATED = 40
"""Unknown movements simulated where there is one task only; the seed of their generator, too.
Convention."""


def departure(tasks: Sequence[TaskStatistics], n_observed: int) -> NDArray[np.float64]:
    """Mean square distance of movements from where they start, per basis function, (N,).

    The variance of the starts is added; mean over the P observed DOFs.
    """
    n_basis = tasks[0].mean.shape[1]
    count = np.array([task.n for task in tasks], dtype=np.float64)
    means = np.array([task.mean[:n_observed] for task in tasks])
    centre = np.einsum("k,kp->p", count, means[:, :, 0]) / count.sum()
    total = np.zeros(n_basis)
    for task, mean in zip(tasks, means, strict=True):
        rows = task.scatter.reshape(len(task.mean), n_basis, len(task.mean), n_basis)
        own = np.einsum("dkdl->dkl", rows)[:n_observed]
        variance, at_start = np.einsum("pkk->k", own), np.sum(own[:, 0, 0])
        total += (
            variance
            + at_start
            - 2.0 * np.sum(own[:, 0], axis=0)
            + task.n * np.sum((mean - mean[:, :1]) ** 2, axis=0)
        )
        total += at_start + task.n * np.sum((mean[:, 0] - centre) ** 2)
    return total / (count.sum() * n_observed)


def none_primitive(
    means: NDArray[np.float64], covariances: NDArray[np.float64], departed: NDArray[np.float64]
) -> Gaussian:
    """Observed weights of a movement that is none of K tasks but of their kind.

    Args:
        means: of the tasks' observed weights, (K, P, N).
        covariances: theirs, (K, P N, P N).
        departed: see `departure`, (N,).
    """
    n_tasks, n_dofs, n_basis = means.shape
    centre = means.mean(axis=0)
    scatter = np.sum(np.mean((means - centre) ** 2, axis=1), axis=0)
    phase = np.linspace(0.0, 1.0, n_basis)
    distance = phase[:, None] - phase
    average = np.exp(-0.5 * (distance / UNKNOWN_AMPLITUDE_WIDTH) ** 2)
    average /= average.sum(axis=1, keepdims=True)
    variance = (scatter + DEPARTURE_SAMPLE_SIZE * departed) / (n_tasks - 1 + DEPARTURE_SAMPLE_SIZE)
    amplitude = np.sqrt(average @ variance * (1.0 + 1.0 / n_tasks))
    correlation = np.exp(-0.5 * (distance / UNKNOWN_DEVIATION_WIDTH) ** 2)
    between = np.kron(np.eye(n_dofs), correlation * np.outer(amplitude, amplitude))
    return Gaussian(centre.ravel(), symmetrize(covariances.mean(axis=0) + between))


def none_timing(log_mean: NDArray[np.float64], log_std: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean and standard deviation of its log duration, (2,), from the tasks' (K,) and (K,)."""
    return np.array([log_mean.mean(), np.sqrt(np.mean(log_std**2) + log_mean.var())])


def evidence_of_none(
    library: TaskLibrary,
    one: HeldOut,
    tasks: NDArray[np.int64],
    own: Gaussian | None,
    departed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Log evidence of none as a library of these tasks would have it, (m,).

    Args:
        library: the learned tasks.
        one: the movement.
        tasks: numbers of the tasks that none is drawn from, (k,).
        own: in place of the library's model of its own task, where that is among them.
        departed: see `departure`.
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


def calibrate(known: NDArray[np.float64], unknown: NDArray[np.float64]) -> NDArray[np.float64]:
    """The calibration of the log Bayes factor of the known tasks over none, (4,).

    Slope and threshold above which it is evidence for a known task, then slope and threshold below
    which it is evidence against one, as `recognition` applies them. Slopes are at most 1: evidence
    is never made stronger than Bayes' rule has it.

    Args:
        known: factors along movements of known tasks, (n, m).
        unknown: along movements of tasks left out, (n', m). With fewer than two rows of either,
            that side is not changed: slope 1, threshold 0.
    """
    upper_slope = lower_slope = 1.0
    upper = lower = 0.0
    if len(unknown) > 1:
        best = np.max(unknown, axis=1)
        std = max(float(best.std(ddof=1)), 1e-9)
        upper_slope = min(1.0, TAIL_RATE / std)
        upper = max(float(best.mean()) + EXTREME_STDS * std, 0.0)
    if len(known) > 1:
        worst = np.min(known, axis=1)
        std = max(float(worst.std(ddof=1)), 1e-9)
        lower_slope = min(1.0, TAIL_RATE / std)
        begin = np.quantile(worst, TAIL_SHARE)
        excess = max(float(np.mean(begin - worst[worst <= begin])), 1e-9)
        lower_slope = min(lower_slope, 1.0 / excess)
        usual = float(worst.mean()) - EXTREME_STDS * std
        lower = min(usual, float(begin) - excess * np.log(TAIL_SHARE / LOWER_TAIL_PROBABILITY), 0.0)
    return np.array([upper_slope, upper, lower_slope, lower])


def calibrate_none(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    strength: float,
) -> NDArray[np.float64]:
    """The calibration of a library's none, from `MAX_CALIBRATED` of its demonstrations, (4,).

    Args:
        library: the learned tasks; its own none is not used.
        tasks: their statistics.
        preprocessing: how their examples were made.
        strength: equivalent sample size of the recognition covariances' target.
    """
    departed = departure(list(tasks.values()), library.n_observed)
    everyone, known, unknown = np.arange(library.n_tasks), [], []
    calibrating = calibrating_tasks([task.n for task in tasks.values()])
    for one in held_out(library, tasks, preprocessing, strength, MAX_CALIBRATED):
        if one.task not in calibrating:
            continue
        others = np.delete(everyone, one.task)
        rivals = np.setdiff1d(calibrating, [one.task])
        evidence = others_evidence(library, one, others)
        if len(rivals):
            none = evidence_of_none(library, one, others, None, departed)
            complete = len(rivals) == len(others)
            theirs = evidence if complete else others_evidence(library, one, rivals)
            unknown.append(total_evidence(theirs, len(rivals)) - none)
        if one.own is not None:
            own = own_evidence(library, one, one.own)
            none = evidence_of_none(library, one, everyone, one.own, departed)
            known.append(total_evidence([*evidence, own], library.n_tasks) - none)
    if library.n_tasks == 1:
        unknown = _simulated_unknown(library, departed)
    return calibrate(np.array(known), np.array(unknown))


def calibrating_tasks(counts: Sequence[int]) -> NDArray[np.int64]:
    """Numbers of the tasks with `MIN_DEMONSTRATIONS`; of all where fewer than two have as many."""
    enough = np.flatnonzero(np.asarray(counts) >= MIN_DEMONSTRATIONS)
    return enough if len(enough) > 1 else np.arange(len(counts))


def is_outdated(before: Mapping[str, int], now: Mapping[str, int]) -> bool:
    """Whether a calibration should be learned again, from demonstrations per task before and now.

    It should where other tasks are used by now, or more demonstrations of tasks that had few.
    """

    def used(counts: Mapping[str, int]) -> dict[str, int]:
        labels = sorted(counts)
        calibrating = calibrating_tasks([counts[label] for label in labels])
        return {labels[k]: min(counts[labels[k]], MAX_RECALIBRATED) for k in calibrating}

    return used(before) != used(now)


def _simulated_unknown(
    library: TaskLibrary, departed: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Factors along movements drawn from none itself, where no task can be left out."""
    rng = np.random.default_rng(N_SIMULATED)
    every = np.arange(library.n_tasks)
    means = library.observed_mean[every].reshape(len(every), library.n_observed, -1)
    none = none_primitive(means, library.observed_covariance[every], departed)
    log_mean, log_std = none_timing(library.log_duration_mean, library.log_duration_std)
    design = library.basis.design_matrix(sample_phases())
    weights = rng.multivariate_normal(none.mean, none.covariance, size=N_SIMULATED)
    noise_std = np.sqrt(library.noise_variance[: library.n_observed])
    factors = []
    for one in weights.reshape(N_SIMULATED, library.n_observed, -1):
        times_s = sample_phases() * np.exp(log_mean + log_std * rng.normal())
        values = design @ one.T + noise_std * rng.normal(size=(len(design), library.n_observed))
        simulated = HeldOut(-1, times_s, values, None)
        evidence = others_evidence(library, simulated, every)
        none_evidence = evidence_of_none(library, simulated, every, None, departed)
        factors.append(total_evidence(evidence, library.n_tasks) - none_evidence)
    return factors
