# SPDX-License-Identifier: Apache-2.0
"""Build the library from statistics and hyperparameters; no recording is needed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.learning.context import fit_context
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT
from intent_recognition.learning.hyperparameters import Hyperparameters
from intent_recognition.learning.none_model import departures, none_primitive, none_timing
from intent_recognition.learning.persons import (
    covariance_of_strangers,
    log_duration_variance_of_strangers,
)
from intent_recognition.learning.preprocessing import Preprocessing
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import (
    STUDENT_FREEDOM,
    USUAL,
    TargetSettings,
    TaskLibrary,
    observed_block,
    predictive_covariance,
)


def library_from_statistics(
    tasks: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
    chosen: Hyperparameters,
    provenance: Mapping[str, object] | None = None,
) -> TaskLibrary:
    """Build the library from statistics.

    Args:
        tasks: statistics of each label, sorted; at least one task has two demonstrations.
        preprocessing: how the examples were made.
        chosen: the hyperparameters.
        provenance: stored in the library together with the settings and hyperparameters.
    """
    settings, n_tasks = preprocessing.settings, len(tasks)
    observed, controlled = preprocessing.observed, preprocessing.controlled
    return TaskLibrary(
        labels=tuple(tasks),
        observed_names=tuple(name for signal in observed for name in signal.names),
        controlled_names=tuple(name for signal in controlled for name in signal.names),
        observed_units=tuple(signal.unit for signal in observed for _ in signal.names),
        controlled_units=tuple(signal.unit for signal in controlled for _ in signal.names),
        observed_groups=tuple(len(signal.names) for signal in observed),
        **chosen_fields(preprocessing, chosen),
        **learned_from(tasks, preprocessing, chosen),
        task_prior=np.full(n_tasks, 1.0 / n_tasks),
        transition_prior=np.full((n_tasks + 1, n_tasks), 1.0 / n_tasks),
        none_prior=settings.none_prior,
        evidence_freedom=STUDENT_FREEDOM,
        onset=preprocessing.onset,
        displacement_exponent=preprocessing.timing.displacement_exponent,
        delay_s=preprocessing.timing.delay_s,
        provenance={**(provenance or {}), "settings": asdict(settings), "chosen": chosen._asdict()},
    )


def chosen_fields(preprocessing: Preprocessing, chosen: Hyperparameters) -> dict[str, Any]:
    """Fields of the library that depend only on the preprocessing and the hyperparameters."""
    evidence = preprocessing.settings.duration_evidence or chosen.duration_evidence
    return {
        "basis": preprocessing.basis_of(chosen.aligned),
        "phase_deviation": preprocessing.timing.phase_deviation(chosen.pace),
        "duration_evidence": evidence,
        "task_evidence": chosen.task_evidence,
        "regression_variance": chosen.regression_variance,
    }


def learned_from(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing, chosen: Hyperparameters
) -> dict[str, Any]:
    """Fields of the library that change with every demonstration."""
    n_observed, over = preprocessing.n_observed, statistics_of(tasks, chosen.aligned)
    floor, noise = variance_scales(over, preprocessing.units)
    log_mean, log_std = _durations(list(tasks.values()))
    n = np.array([task.n for task in tasks.values()])
    means = np.array([task.mean[:n_observed] for task in over.values()])
    pooled = observed_block(pooled_moments(over.values()), means[0].size)
    examples = [task.examples for task in over.values()]
    shared = covariance_of_strangers(examples, pooled, floor[:n_observed], chosen.shared_strength)
    covariance = (1.0 + 1.0 / n)[:, None, None] * shared
    departed = departures(list(over.values()), preprocessing.units[:n_observed])
    none = none_primitive(means, covariance, departed)
    timing, none_duration = preprocessing.timing, none_timing(log_mean, log_std)
    usual = None
    if timing.duration_exponent or timing.displacement_exponent or timing.delay_s:
        usual = np.r_[np.log([timing.usual_of(label) for label in tasks]), none_duration[0]]
    mean_duration_s = float(sum(task.duration_sum_s for task in tasks.values()) / n.sum())
    context = None
    assumed = chosen.target(n_observed)
    weight_covariance = predictive_covariances(over, chosen.strength, floor, assumed)
    if preprocessing.context:
        context, weight_covariance, covariance = fit_context(
            over, preprocessing.context, n_observed, floor, chosen
        )
    return {
        "weight_mean": np.array([task.mean.ravel() for task in over.values()]),
        "weight_covariance": weight_covariance,
        "noise_variance": noise,
        "noise_scale": chosen.noise_scale,
        "n_demonstrations": n,
        "log_duration_mean": log_mean,
        "log_duration_std": log_std,
        "correlation_time_s": mean_duration_s / SAMPLES_PER_MOVEMENT,
        "observed_weight_covariance": covariance,
        "none_mean": none.mean,
        "none_covariance": none.covariance,
        "none_log_duration": none_duration,
        "usual_log_duration": usual,
        "context": context,
    }


def statistics_of(
    tasks: Mapping[str, TaskStatistics], aligned: bool
) -> Mapping[str, TaskStatistics]:
    """Statistics of the aligned examples if `aligned`, else of the examples as recorded."""
    if not aligned:
        return tasks
    found = {label: task.aligned for label, task in tasks.items() if task.aligned is not None}
    if missing := [label for label in tasks if label not in found]:
        expected, cure = "examples aligned as those learned before", "Make them by `example_of`."
        raise ArgumentError.about("tasks", expected, f"others of {', '.join(missing)}", cure)
    return found


def predictive_covariances(
    tasks: Mapping[str, TaskStatistics],
    strength: float,
    floor: Floats,
    assumed: TargetSettings = USUAL,
) -> Floats:
    """Predictive covariance of each task's next demonstration, (K, D N, D N).

    Args:
        tasks: statistics of each label.
        strength: equivalent sample size of the target, in demonstrations.
        floor: variance floor per DOF, (D,).
        assumed: assumptions of the target of each task's covariance.
    """
    pooled = pooled_moments(tasks.values())
    of_all = floor, strength, assumed
    return np.array(
        [predictive_covariance(task.moments, pooled, task.n, *of_all) for task in tasks.values()]
    )


def _durations(tasks: Sequence[TaskStatistics]) -> tuple[Floats, Floats]:
    """Mean and predictive standard deviation of each task's log duration, (K,) each.

    The variance is shrunk towards the one pooled over all tasks. Where demonstrations are known to
    come from several people, it is the variance of a new person's durations.
    """
    scatter = np.array([task.log_duration_scatter for task in tasks])
    n = np.array([task.n for task in tasks])
    pooled = scatter.sum() / max(n.sum() - len(n), 1)
    size = 4.0  # equivalent sample size of the pooled variance, in demonstrations
    variance = (scatter + size * pooled) / (n - 1 + size) * (1 + 1 / n)
    of_strangers = log_duration_variance_of_strangers([task.examples for task in tasks])
    if of_strangers is not None:
        variance = np.full(len(tasks), of_strangers)
    mean = np.array([task.log_duration_mean for task in tasks])
    return mean, np.sqrt(np.maximum(variance, 0.05**2))  # at least 5 % of the duration
