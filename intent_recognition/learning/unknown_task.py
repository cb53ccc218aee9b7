# SPDX-License-Identifier: Apache-2.0
"""The margin of evidence that a known task must have over none before it counts.

The log Bayes factor of the known tasks over none is computed along demonstrations of each task:
with a library without the task, and with one without the demonstration or its person. As a decision
is taken the first time that a factor is high enough, the highest factor along each movement counts.
The margin lies between the highest factors of unknown and of known movements (docs/recognition.md).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.filtering import duration_offsets
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.examples import TrainingExample, sample_phases
from intent_recognition.learning.held_out import MAX_FLOATS, filter_samples
from intent_recognition.learning.held_out_examples import (
    MAX_VALIDATED,
    N_SCALES,
    nearest_tasks,
    paired_examples,
)
from intent_recognition.learning.left_out import LeavingOut, LeftOut
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import TaskLibrary, conformal_bound
from intent_recognition.signals import is_spatial

UNKNOWN_ACCEPTED = 0.05
"""Share of unknown movements that may count as known (docs/recognition.md)."""
MIN_DEMONSTRATIONS, MAX_RECALIBRATED = 5, 10
"""Fewest demonstrations of a task that is used for the margin, if two tasks have as many; and the
number beyond which one more does not require a new margin (docs/recognition.md)."""
N_SIMULATED = 40
"""Number of unknown movements simulated if there is only one task; also the generator's seed."""


def learn_none_margin(
    leaving_out: LeavingOut, recorded: Mapping[str, TaskStatistics], since: float = 0.0
) -> float:
    """Evidence that a known task must have over none before it counts, in nats, zero or more.

    The library's own none model is not used.

    Args:
        leaving_out: leaves demonstrations out of the library.
        recorded: statistics of the examples as recorded.
        since: phase from which on the movements are observed.
    """
    library, tasks = leaving_out.library, leaving_out.tasks
    statistics = leaving_out.statistics
    calibrating = calibrating_tasks([task.n for task in statistics])
    followed = {label: task for k, (label, task) in enumerate(tasks.items()) if k in calibrating}
    without: dict[int, LeftOut] = {}
    comparisons, is_known = list[Comparison](), list[bool]()
    for k, example, as_recorded in paired_examples(followed, recorded, MAX_VALIDATED):
        rivals = np.setdiff1d(calibrating, [k])
        if len(rivals):
            if k not in without:
                without[k] = leaving_out.task(k)
            compared = nearest_tasks(statistics, example, rivals, library.observed_units)
            comparisons.append(Comparison(without[k], compared, len(rivals), as_recorded))
            is_known.append(False)
        left_out = leaving_out.unseen(k, example)
        if left_out is not None:
            compared = np.r_[k, nearest_tasks(statistics, example, rivals, library.observed_units)]
            comparisons.append(Comparison(left_out, compared, len(calibrating), as_recorded))
            is_known.append(True)
    if library.n_tasks == 1:
        simulated = _simulated_unknown(leaving_out.nothing())
        comparisons += simulated
        is_known += [False] * len(simulated)
    first = int(np.searchsorted(sample_phases(), since))
    highest = np.array([np.max(factors) for factors in log_factors(comparisons, first)])
    known = np.array(is_known, dtype=bool)
    return margin_between(highest[~known], highest[known])


def margin_between(unknown: Floats, known: Floats) -> float:
    """Margin between the highest factors of unknown and of known movements, zero or more.

    If there is a gap, the margin is half-way between the bound that unknown movements stay below
    (`conformal_bound`) and the bound that known ones exceed: a new task differs from the unknown
    movements as they differ from each other. The margin is at most the median of the known
    movements; otherwise hardly any would be acted on where unknown movements resemble them
    (docs/decisions/unknown_movements.md). With fewer than two unknown movements it is zero.

    Args:
        unknown: highest log Bayes factor of the known tasks over none along each, (n,).
        known: the same along movements of known tasks, (n',).
    """
    if len(unknown) < 2:
        return 0.0
    below = conformal_bound(unknown, UNKNOWN_ACCEPTED)
    above, most = np.quantile(known, (UNKNOWN_ACCEPTED, 0.5)) if len(known) > 1 else (below, below)
    return max(float(min(0.5 * (below + max(above, below)), most)), 0.0)


class Comparison(NamedTuple):
    """A movement along which some tasks are compared with none."""

    without: LeftOut  # a library without some demonstrations
    compared: Integers  # indices of the tasks
    n_tasks: int  # tasks that share the prior; those not compared are too far away to matter
    recorded: TrainingExample


def log_factors(comparisons: Sequence[Comparison], first_sample: int = 0) -> list[Floats]:
    """Log Bayes factor of the tasks over none after each sample of each movement, (m,) each.

    Samples before `first_sample` are not used. The durations are unknown. Comparisons are filtered
    together, as many as memory allows.
    """
    factors, first = list[Floats](), 0
    while first < len(comparisons):
        size = comparisons[first].without.mean.shape[1]
        most = max(1, MAX_FLOATS // size**2)
        counts = np.cumsum([(len(one.compared) + 1) * N_SCALES for one in comparisons[first:]])
        last = first + max(1, int(np.searchsorted(counts, most, side="right")))
        factors += _log_factors_together(comparisons[first:last], first_sample)
        first = last
    return factors


def _log_factors_together(comparisons: Sequence[Comparison], first: int) -> list[Floats]:
    """`log_factors` of comparisons that are filtered in one batch."""
    log_weight = duration_offsets(N_SCALES)[1]
    priors, *timing = zip(*map(_hypotheses, comparisons), strict=True)
    paces, relative = map(np.concatenate, timing)
    prior = Gaussian(*(np.concatenate(parts) for parts in zip(*priors, strict=True)))
    values = np.stack([one.recorded.observed for one in comparisons], axis=1)
    samples = np.repeat(values, [len(prior.mean) for prior in priors], axis=1)
    ends = np.cumsum([len(one.compared) + 1 for one in comparisons])
    library = comparisons[0].without.library
    factors = []
    for progress in filter_samples(library, prior, paces, relative, samples, first):
        joint = progress.log_evidence.reshape(-1, len(log_weight)) + log_weight
        evidence = np.logaddexp.reduce(joint, axis=1)
        of_each = np.split(evidence, ends[:-1])
        factors.append([np.logaddexp.reduce(of_one[:-1]) - of_one[-1] for of_one in of_each])
    n_tasks = np.array([one.n_tasks for one in comparisons])
    return list((np.array(factors) - np.log(n_tasks)).T)


def _hypotheses(comparison: Comparison) -> tuple[Gaussian, Floats, Floats]:
    """Weights, pace and relative duration of the tasks and of none; those of none come last."""
    without, compared, _, recorded = comparison
    library, offsets = without.library, duration_offsets(N_SCALES)[0]
    inflation = 1.0 + 1.0 / without.n[compared]
    mean = np.vstack([without.mean[compared], without.none.mean])
    covariance = np.concatenate(
        [inflation[:, None, None] * without.covariance, without.none.covariance[None]]
    )
    log_mean = np.r_[library.log_duration_mean[compared], without.timing[0]]
    log_std = np.r_[library.log_duration_std[compared], without.timing[1]]
    duration_s = np.exp(log_mean[:, None] + log_std[:, None] * offsets)
    usual_s = np.r_[library.usual_s[compared], np.exp(without.timing[0])]
    n, relative = len(offsets), duration_s / usual_s[:, None]
    weights = Gaussian(np.repeat(mean, n, axis=0), np.repeat(covariance, n, axis=0))
    return weights, (recorded.duration_s / duration_s).ravel(), relative.ravel()


def calibrating_tasks(counts: Sequence[int]) -> Integers:
    """Indices of tasks with `MIN_DEMONSTRATIONS`, or of all if fewer than two have as many."""
    enough = np.flatnonzero(np.asarray(counts) >= MIN_DEMONSTRATIONS)
    return enough if len(enough) > 1 else np.arange(len(counts))


def is_outdated(before: Mapping[str, int], now: Mapping[str, int]) -> bool:
    """Whether the margin should be learned again, from demonstrations per task before and now.

    It should if other tasks are used now, or another number of demonstrations of tasks with few.
    """

    def used(counts: Mapping[str, int]) -> dict[str, int]:
        labels = sorted(counts)
        calibrating = calibrating_tasks([counts[label] for label in labels])
        return {labels[k]: min(counts[labels[k]], MAX_RECALIBRATED) for k in calibrating}

    return used(before) != used(now)


def _simulated_unknown(whole: LeftOut) -> list[Comparison]:
    """Draw movements from the none model itself, for when no task can be left out."""
    library = whole.library
    rng = np.random.default_rng(N_SIMULATED)
    every = np.arange(library.n_tasks)
    design = library.basis.design_matrix(sample_phases())
    mean, covariance = whole.none
    scale = _unit_scale(library, covariance)  # makes draws independent of units
    weights = rng.multivariate_normal(
        mean / scale, covariance / np.outer(scale, scale), size=N_SIMULATED
    )
    weights *= scale
    noise_std = np.sqrt(library.noise_variance[: library.n_observed])
    drawn = []
    for one in weights.reshape(N_SIMULATED, library.n_observed, -1):
        duration_s = float(np.exp(whole.timing[0] + whole.timing[1] * rng.normal()))
        values = design @ one.T + noise_std * rng.normal(size=(len(design), library.n_observed))
        nothing = np.zeros(0)
        simulated = TrainingExample("", "", nothing, nothing, duration_s, values, nothing)
        drawn.append(Comparison(whole, every, len(every), simulated))
    return drawn


def _unit_scale(library: TaskLibrary, covariance: Floats) -> Floats:
    """1 for weights in metres and radians, else their largest standard deviation, (P N,)."""
    std = np.sqrt(np.diagonal(covariance)).reshape(library.n_observed, -1).max(axis=1)
    scale = np.where(is_spatial(library.observed_units), 1.0, std)
    return np.repeat(scale, library.basis.n_basis)
