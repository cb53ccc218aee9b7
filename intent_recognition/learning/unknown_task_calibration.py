# SPDX-License-Identifier: Apache-2.0
"""How much evidence a movement must show against `none`, learned from demonstrations.

The log Bayes factor of the known tasks over none is followed through every demonstration, once
with a library that knows its task (the demonstration itself left out) and once with one that does
not. A decision is taken the first time a probability is high enough, so the highest factor that an
unknown movement reaches on its way counts, and the lowest one of a known movement; what lies
between them decides nothing. Where there is only one task, unknown movements are drawn from none.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.learning.accumulation import Reference
from intent_recognition.learning.examples import sample_phases
from intent_recognition.learning.held_out import (
    HeldOut,
    evidence_of_none,
    held_out,
    others_evidence,
    own_evidence,
    total_evidence,
)
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.learning.unknown_task import departure, none_primitive, none_timing
from intent_recognition.promp import TaskLibrary

SPREADS = 2.0
"""Standard deviations beyond the mean extreme at which a factor begins to count."""
RARE = 0.005
"""Share of known movements that may speak for none."""
TAIL = 0.1
"""Share of them that tells how their worst factors go on: exponentially, a long tail."""
TAIL_RATE = 2.373
"""Rate at which a normal distribution's tail falls there, d(-log(1 - Phi(z)))/dz at z = 2."""
ENOUGH = 5
"""Demonstrations from which on a task takes part, where two tasks have as many."""
PLENTY = 10
"""Demonstrations from which on one more of a task is not worth calibrating again."""
MAX_CALIBRATED = 120
"""Demonstrations followed, at most."""
N_IMAGINED = 40


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
        begin = np.quantile(worst, TAIL)
        excess = max(float(np.mean(begin - worst[worst <= begin])), 1e-9)
        lower_slope = min(lower_slope, 1.0 / excess)
        usual = float(worst.mean()) - SPREADS * spread
        lower = min(usual, float(begin) - excess * np.log(TAIL / RARE), 0.0)
    return np.array([upper_slope, upper, lower_slope, lower])


def calibrate_none(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    strength: float,
) -> np.ndarray:
    """The calibration of a library's none, from `MAX_CALIBRATED` of its demonstrations, (4,).

    Args:
        library: the learned tasks; its own none is not looked at.
        tasks: their statistics.
        reference: how their examples were made.
        strength: of the targets of the covariances that tasks are told apart by.
    """
    departed = departure(list(tasks.values()), library.n_observed)
    everyone, known, unknown = np.arange(library.n_tasks), [], []
    settled = settled_tasks([task.n for task in tasks.values()])
    for one in held_out(library, tasks, reference, strength, MAX_CALIBRATED):
        if one.task not in settled:
            continue
        others = np.delete(everyone, one.task)
        rivals = np.setdiff1d(settled, [one.task])
        evidence = others_evidence(library, one, others)
        if len(rivals):
            none = evidence_of_none(library, one, others, None, departed)
            all_settled = len(rivals) == len(others)
            theirs = evidence if all_settled else others_evidence(library, one, rivals)
            unknown.append(total_evidence(theirs, len(rivals)) - none)
        if one.own is not None:
            own = own_evidence(library, one)
            none = evidence_of_none(library, one, everyone, one.own, departed)
            known.append(total_evidence([*evidence, own], library.n_tasks) - none)
    if library.n_tasks == 1:
        unknown = _imagined(library, departed)
    return calibrate(np.array(known), np.array(unknown))


def settled_tasks(counts: Sequence[int]) -> np.ndarray:
    """Numbers of the tasks with `ENOUGH` demonstrations; of all where fewer than two have."""
    enough = np.flatnonzero(np.asarray(counts) >= ENOUGH)
    return enough if len(enough) > 1 else np.arange(len(counts))


def is_outdated(before: Mapping[str, int], now: Mapping[str, int]) -> bool:
    """Whether a calibration learned from so many demonstrations of each task should be made anew.

    It should where other tasks take part by now, or more of those that had few.
    """

    def part(counts: Mapping[str, int]) -> dict[str, int]:
        labels = sorted(counts)
        settled = settled_tasks([counts[label] for label in labels])
        return {labels[k]: min(counts[labels[k]], PLENTY) for k in settled}

    return part(before) != part(now)


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
        evidence = others_evidence(library, imagined, every)
        none_evidence = evidence_of_none(library, imagined, every, None, departed)
        factors.append(total_evidence(evidence, library.n_tasks) - none_evidence)
    return factors
