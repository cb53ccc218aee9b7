# SPDX-License-Identifier: Apache-2.0
"""The hypothesis that a movement is none of the known tasks: its model and its margin.

The model: an unknown movement is one more draw from the population of the known tasks. Its mean is
distributed about their mean as they are themselves, and it varies as they vary. The scatter of few
tasks is hardly known, so it is shrunk towards how far movements depart from their starts.

The margin: the log Bayes factor of the known tasks over none is computed along demonstrations of
each task, with a library without the task, and with one without the demonstration alone. As a
decision is taken the first time that a factor is high enough, the highest factor along each
movement counts. The margin lies between those of unknown and of known movements
(docs/recognition.md).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from intent_recognition.filtering import duration_offsets
from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.learning.examples import TrainingExample, sample_phases
from intent_recognition.learning.held_out import (
    MAX_FLOATS,
    filter_samples,
    nearest_tasks,
    paired_examples,
    without_demonstration,
)
from intent_recognition.learning.selection import STRENGTH
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import (
    Scatter,
    TaskLibrary,
    observed_block,
    shared_covariance,
)

DEPARTURE_SAMPLE_SIZE = 0.25
"""Equivalent sample size, in tasks, of the prior that tasks differ as much as movements depart from
their starts (docs/recognition.md)."""
UNKNOWN_DEVIATION_WIDTH = 0.25
"""Width of the kernel, in phase, that correlates an unknown movement's deviation from the tasks'
mean along the movement. Convention."""
UNKNOWN_AMPLITUDE_WIDTH = 0.1
"""Width of the kernel, in phase, that the variance of this deviation is averaged with. Convention.
"""
UNKNOWN_ACCEPTED = 0.05
"""Share of unknown movements that may count as known (docs/recognition.md). Convention."""
MIN_DEMONSTRATIONS = 5
"""Demonstrations from which on a task is used for the margin, where two tasks have as many
(docs/recognition.md)."""
MAX_RECALIBRATED = 10
"""Demonstrations of a task beyond which one more does not ask for a new margin
(docs/recognition.md)."""
MAX_CALIBRATED = 60
"""Demonstrations used for the margin at most. Convention: it bounds the time."""
N_CALIBRATED_SCALES = 5
"""Durations per task in learning it. Convention: it bounds the time."""
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


def learn_none_margin(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
) -> float:
    """Evidence that a known task must have over none before it counts, in nats, zero or more.

    Args:
        library: the learned tasks; its own none is not used.
        tasks: statistics that it was built from.
        recorded: statistics of the examples as they were recorded.
    """
    statistics = list(tasks.values())
    departed = departure(statistics, library.n_observed)
    calibrating = calibrating_tasks([task.n for task in statistics])
    followed = {label: task for k, (label, task) in enumerate(tasks.items()) if k in calibrating}
    pooled = observed_block(pooled_moments(statistics), library.n_observed_weights)
    floor = variance_scales(tasks)[0][: library.n_observed]
    without: dict[int, _Without] = {}
    comparisons, is_known = list[Comparison](), list[bool]()
    for k, example, as_recorded in paired_examples(followed, recorded, MAX_CALIBRATED):
        rivals = np.setdiff1d(calibrating, [k])
        if len(rivals):
            if k not in without:
                without[k] = _without_task(library, tasks, k, pooled)
            compared = nearest_tasks(statistics, example, rivals)
            comparisons.append(Comparison(without[k], compared, len(rivals), as_recorded))
            is_known.append(False)
        if statistics[k].n > 1 and pooled.freedom > 1:
            left_out = _without_demonstration(
                library, statistics, k, example, pooled, floor, departed
            )
            compared = np.r_[k, nearest_tasks(statistics, example, rivals)]
            comparisons.append(Comparison(left_out, compared, len(calibrating), as_recorded))
            is_known.append(True)
    if library.n_tasks == 1:
        simulated = _simulated_unknown(library, departed)
        comparisons += simulated
        is_known += [False] * len(simulated)
    highest = np.array([np.max(factors) for factors in log_factors(comparisons)])
    known = np.array(is_known, dtype=bool)
    return margin_between(highest[~known], highest[known])


def margin_between(unknown: NDArray[np.float64], known: NDArray[np.float64]) -> float:
    """The margin between unknown and known movements with these highest factors, zero or more.

    Half-way between what unknown movements stay below and what known ones exceed, where there is a
    gap. The first is the conformal quantile: one more movement of their kind exceeds it with a
    probability of at most `UNKNOWN_ACCEPTED`, whatever the distribution (Vovk et al. 2005). Fewer
    movements than that takes are extrapolated by a normal distribution; of fewer than two nothing
    is learned. But a new task is not of their kind, it differs from them as they do from each
    other; hence the other half of the gap (docs/decisions/unknown_movements.md).

    Args:
        unknown: highest log Bayes factor of the known tasks over none along each, (n,).
        known: along movements of known tasks, (n',).
    """
    n = len(unknown)
    if n < 2:
        return 0.0
    rank = int(np.ceil((n + 1) * (1.0 - UNKNOWN_ACCEPTED)))
    if rank <= n:
        below = float(np.sort(unknown)[rank - 1])
    else:
        quantile = float(ndtri(1.0 - UNKNOWN_ACCEPTED))
        below = float(max(unknown.mean() + quantile * unknown.std(ddof=1), unknown.max()))
    above = float(np.quantile(known, UNKNOWN_ACCEPTED)) if len(known) > 1 else below
    return max(0.5 * (below + max(above, below)), 0.0)


class _Without(NamedTuple):
    """What a library without some demonstrations believes of the observed weights.

    Attributes:
        library: of all demonstrations.
        mean: of each task, (K, P N).
        covariance: under each task, its mean known, (P N, P N).
        n: demonstrations of each task, (K,).
        none: its none.
        timing: mean and standard deviation of the log duration of none, (2,).
    """

    library: TaskLibrary
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    n: NDArray[np.int64]
    none: Gaussian
    timing: NDArray[np.float64]


class Comparison(NamedTuple):
    """A movement along which some tasks are compared with none.

    Attributes:
        without: a library without some demonstrations.
        compared: numbers of the tasks.
        n_tasks: how many share the prior; those not compared are too far away to count.
        recorded: the movement.
    """

    without: _Without
    compared: NDArray[np.int64]
    n_tasks: int
    recorded: TrainingExample

    @property
    def n_hypotheses(self) -> int:
        """How many are filtered: durations of the tasks, and of none."""
        return (len(self.compared) + 1) * N_CALIBRATED_SCALES


def _without(
    library: TaskLibrary,
    left_out: NDArray[np.int64],
    covariance: NDArray[np.float64],
    departed: NDArray[np.float64],
    mean: NDArray[np.float64] | None = None,
    n: NDArray[np.int64] | None = None,
) -> _Without:
    """Without some tasks; other means and numbers of demonstrations than the library's if given."""
    mean = library.observed_mean[:-1] if mean is None else mean
    n = library.n_demonstrations if n is None else n
    kept = np.delete(np.arange(library.n_tasks), left_out)
    inflation = 1.0 + 1.0 / n[kept]
    means = mean[kept].reshape(len(kept), library.n_observed, -1)
    none = none_primitive(means, inflation[:, None, None] * covariance, departed)
    timing = none_timing(library.log_duration_mean[kept], library.log_duration_std[kept])
    return _Without(library, mean, covariance, n, none, timing)


def _without_task(
    library: TaskLibrary, tasks: Mapping[str, TaskStatistics], number: int, pooled: Scatter
) -> _Without:
    """As a library of the other tasks would have it."""
    label, n_observed = library.labels[number], library.n_observed
    own = observed_block(tasks[label].moments, library.n_observed_weights)
    rest = Scatter(pooled.matrix - own.matrix, pooled.freedom - own.freedom)
    kept = {other: task for other, task in tasks.items() if other != label}
    floor = variance_scales(kept)[0][:n_observed]
    covariance = shared_covariance(rest if rest.freedom else pooled, floor, STRENGTH)
    departed = departure(list(kept.values()), n_observed)
    return _without(library, np.array([number]), covariance, departed)


def _without_demonstration(
    library: TaskLibrary,
    tasks: Sequence[TaskStatistics],
    number: int,
    example: TrainingExample,
    pooled: Scatter,
    floor: NDArray[np.float64],
    departed: NDArray[np.float64],
) -> _Without:
    task, size = tasks[number], library.n_observed_weights
    deviation = (example.weights - task.mean).ravel()[:size]
    own = observed_block(task.moments, size)
    _, rest = without_demonstration(pooled, own, deviation)
    mean, n = library.observed_mean[:-1].copy(), library.n_demonstrations.copy()
    mean[number] -= deviation / (task.n - 1)
    n[number] -= 1
    covariance = shared_covariance(rest, floor, STRENGTH)
    return _without(library, np.array([], dtype=int), covariance, departed, mean, n)


def log_factors(comparisons: Sequence[Comparison]) -> list[NDArray[np.float64]]:
    """Log Bayes factor of the tasks over none after each sample of each movement, (m,) each.

    The durations are unknown. Comparisons are filtered together, as many as memory allows.
    """
    factors, first = list[NDArray[np.float64]](), 0
    while first < len(comparisons):
        size = comparisons[first].without.mean.shape[1]
        most = max(1, MAX_FLOATS // size**2)
        counts = np.cumsum([one.n_hypotheses for one in comparisons[first:]])
        last = first + max(1, int(np.searchsorted(counts, most, side="right")))
        factors += _log_factors_together(comparisons[first:last])
        first = last
    return factors


def _log_factors_together(comparisons: Sequence[Comparison]) -> list[NDArray[np.float64]]:
    """`log_factors` of comparisons that are filtered in one batch."""
    log_weight = duration_offsets(N_CALIBRATED_SCALES)[1]
    priors, paces = zip(*map(_hypotheses, comparisons), strict=True)
    prior = Gaussian(*(np.concatenate(parts) for parts in zip(*priors, strict=True)))
    values = np.stack([one.recorded.observed for one in comparisons], axis=1)
    samples = np.repeat(values, [len(pace) for pace in paces], axis=1)
    ends = np.cumsum([len(one.compared) + 1 for one in comparisons])
    library = comparisons[0].without.library
    factors = []
    for progress in filter_samples(library, prior, np.concatenate(paces), samples):
        joint = progress.log_evidence.reshape(-1, len(log_weight)) + log_weight
        evidence = np.logaddexp.reduce(joint, axis=1)
        of_each = np.split(evidence, ends[:-1])
        factors.append([np.logaddexp.reduce(of_one[:-1]) - of_one[-1] for of_one in of_each])
    n_tasks = np.array([one.n_tasks for one in comparisons])
    return list((np.array(factors) - np.log(n_tasks)).T)


def _hypotheses(comparison: Comparison) -> tuple[Gaussian, NDArray[np.float64]]:
    """Weights and pace of the tasks and of none, for each duration: those of none come last."""
    without, compared, _, recorded = comparison
    library, offsets = without.library, duration_offsets(N_CALIBRATED_SCALES)[0]
    inflation = 1.0 + 1.0 / without.n[compared]
    mean = np.vstack([without.mean[compared], without.none.mean])
    covariance = np.concatenate(
        [inflation[:, None, None] * without.covariance, without.none.covariance[None]]
    )
    log_mean = np.r_[library.log_duration_mean[compared], without.timing[0]]
    log_std = np.r_[library.log_duration_std[compared], without.timing[1]]
    pace = recorded.duration_s / np.exp(log_mean[:, None] + log_std[:, None] * offsets)
    n = len(offsets)
    return Gaussian(np.repeat(mean, n, axis=0), np.repeat(covariance, n, axis=0)), pace.ravel()


def calibrating_tasks(counts: Sequence[int]) -> NDArray[np.int64]:
    """Numbers of the tasks with `MIN_DEMONSTRATIONS`; of all where fewer than two have as many."""
    enough = np.flatnonzero(np.asarray(counts) >= MIN_DEMONSTRATIONS)
    return enough if len(enough) > 1 else np.arange(len(counts))


def is_outdated(before: Mapping[str, int], now: Mapping[str, int]) -> bool:
    """Whether the margin should be learned again, from demonstrations per task before and now.

    It should where other tasks are used by now, or more demonstrations of tasks that had few.
    """

    def used(counts: Mapping[str, int]) -> dict[str, int]:
        labels = sorted(counts)
        calibrating = calibrating_tasks([counts[label] for label in labels])
        return {labels[k]: min(counts[labels[k]], MAX_RECALIBRATED) for k in calibrating}

    return used(before) != used(now)


def _simulated_unknown(library: TaskLibrary, departed: NDArray[np.float64]) -> list[Comparison]:
    """Movements drawn from none itself, where no task can be left out."""
    rng = np.random.default_rng(N_SIMULATED)
    every = np.arange(library.n_tasks)
    inflation = 1.0 + 1.0 / library.n_demonstrations[0]
    covariance = library.observed_covariance[0] / inflation
    whole = _without(library, np.array([], dtype=int), covariance, departed)
    design = library.basis.design_matrix(sample_phases())
    weights = rng.multivariate_normal(whole.none.mean, whole.none.covariance, size=N_SIMULATED)
    noise_std = np.sqrt(library.noise_variance[: library.n_observed])
    drawn = []
    for one in weights.reshape(N_SIMULATED, library.n_observed, -1):
        duration_s = float(np.exp(whole.timing[0] + whole.timing[1] * rng.normal()))
        values = design @ one.T + noise_std * rng.normal(size=(len(design), library.n_observed))
        nothing = np.zeros(0)
        simulated = TrainingExample("", "", nothing, nothing, duration_s, values, nothing)
        drawn.append(Comparison(whole, every, len(every), simulated))
    return drawn
