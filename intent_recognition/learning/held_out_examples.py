# SPDX-License-Identifier: Apache-2.0
"""Demonstrations that are left out in turn, each with its task and its rivals without it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian import Gaussian, Regression, regression
from intent_recognition.learning.examples import (
    TrainingExample,
    interpolated,
    sample_phases,
    scored_phases,
)
from intent_recognition.learning.hyperparameters import STRENGTH, Hyperparameters
from intent_recognition.learning.persons import covariance_of_strangers, people, without_group
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import (
    Scatter,
    observed_block,
    predictive_covariance,
    shared_covariance,
    structured_target,
    without_demonstration,
)
from intent_recognition.signals import commensurate

MAX_RIVALS = 8
"""Other tasks, those with the nearest means, that a demonstration is compared with. Convention: it
bounds the time; tasks farther away have no evidence to speak of."""
MAX_VALIDATED = 60
"""Demonstrations left out, evenly drawn from all tasks. Convention: it bounds the time."""
N_SCALES = 5
"""Durations per task where margins are learned. Convention: it bounds the time; with 15 that of a
change of mind is alike."""
T = TypeVar("T")


class LeftOutExample(NamedTuple):
    """One demonstration, and its task without it."""

    task: int  # number of its task
    mean: Floats  # weights of its task, (D N,)
    covariance: Floats  # of the observed weights, shared by the tasks, (P N, P N)
    joint: Floats  # covariance of all its weights, (D N, D N)
    rule: Regression  # regression of the controlled weights on the observed ones, from the same
    rivals: Integers  # numbers of the other tasks it is compared with
    rival_means: Floats  # their observed weights, without the person who was left out, (r, P N)
    observed: Floats  # its samples, (m, P)
    seen: Floats  # the same at the scored phases, (s, P)
    truth: Floats  # of the controlled DOFs there, (s, Q)
    duration_s: float
    log_duration: float  # mean of the logarithms of the others' durations [log s]


def leave_out(
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
    units: Sequence[str],
    chosen: Hyperparameters,
) -> list[LeftOutExample]:
    """Demonstrations of tasks that have two or more, each with its task without it.

    Where it is known whose they are, and others have shown each task, too, all demonstrations of
    the person are left out with it.
    """
    statistics = list(tasks.values())
    floor, _ = variance_scales(tasks, units)
    pooled = pooled_moments(statistics)
    several = {label: task for label, task in tasks.items() if task.n > 1}
    pairs = paired_examples(several, recorded, MAX_VALIDATED)
    others = {name: without_group(statistics, name) for name in {e.group for _, e, _ in pairs}}
    if pairs and all(rest is not None and people(rest) > 1 for rest in others.values()):
        found = {name: _of_others(rest, floor, chosen) for name, rest in others.items() if rest}
        means = {name: [task.mean for task in rest] for name, rest in found.items()}
        return [
            _left_out(statistics, k, found[one.group][k], means[one.group], units, one, as_recorded)
            for k, one, as_recorded in pairs
        ]
    return [
        _without(statistics, k, pooled, floor, units, chosen, example, as_recorded)
        for k, example, as_recorded in pairs
    ]


class _Rest(NamedTuple):
    """A task without some demonstrations: weights (D N,), and what `LeftOutExample` has of it."""

    mean: Floats
    covariance: Floats
    joint: Floats
    rule: Regression
    log_duration: float


def _of_others(
    rest: Sequence[TaskStatistics], floor: Floats, chosen: Hyperparameters
) -> list[_Rest]:
    """Every task of other people's demonstrations."""
    n_observed = rest[0].examples[0].observed.shape[1]
    size, pooled = n_observed * rest[0].mean.shape[1], pooled_moments(rest)
    examples = [task.examples for task in rest]
    of_observed = observed_block(pooled, size), floor[:n_observed], STRENGTH
    shared = covariance_of_strangers(examples, *of_observed)
    found = []
    for task in rest:
        parts = task.moments, pooled, task.n, floor, chosen.strength, chosen.target(n_observed)
        joint = Gaussian(task.mean.ravel(), predictive_covariance(*parts))
        rule = regression(joint, size)
        found.append(_Rest(joint.mean, shared, joint.covariance, rule, task.log_duration_mean))
    return found


def _without(
    tasks: Sequence[TaskStatistics],
    number: int,
    pooled: Scatter,
    floor: Floats,
    units: Sequence[str],
    chosen: Hyperparameters,
    example: TrainingExample,
    as_recorded: TrainingExample,
) -> LeftOutExample:
    task, n_observed = tasks[number], example.observed.shape[1]
    size = n_observed * example.weights.shape[1]
    deviation, own = example.weights - task.mean, task.moments
    if pooled.freedom > 1:
        part, rest = without_demonstration(pooled, own, deviation.ravel())
        assumed = chosen.strength, chosen.target(n_observed)
        covariance = predictive_covariance(part, rest, task.n - 1, floor, *assumed)
    else:  # two demonstrations in all: nothing would be left to estimate a target from
        rest = pooled
        covariance = structured_target(own, pooled, floor).covariance()
    shared = shared_covariance(observed_block(rest, size), floor[:n_observed], STRENGTH)
    mean = (task.mean - deviation / (task.n - 1)).ravel()
    log_s = float(np.log(as_recorded.duration_s))
    log_duration = task.log_duration_mean + (task.log_duration_mean - log_s) / (task.n - 1)
    rule = regression(Gaussian(mean, covariance), size)
    rest_of_task = _Rest(mean, shared, covariance, rule, log_duration)
    means = [one.mean.ravel() for one in tasks]
    return _left_out(tasks, number, rest_of_task, means, units, example, as_recorded)


def _left_out(
    tasks: Sequence[TaskStatistics],
    number: int,
    rest: _Rest,
    means: Sequence[Floats],
    units: Sequence[str],
    example: TrainingExample,
    as_recorded: TrainingExample,
) -> LeftOutExample:
    others = np.delete(np.arange(len(tasks)), number)
    rivals = nearest_tasks(tasks, example, others, units[: example.observed.shape[1]])
    samples, size = as_recorded.observed, rest.rule.matrix.shape[1]
    return LeftOutExample(
        number,
        *rest[:4],
        rivals,
        np.array([means[rival][:size] for rival in rivals]).reshape(-1, size),
        samples,
        interpolated(scored_phases(), sample_phases(), samples),
        as_recorded.controlled,
        as_recorded.duration_s,
        rest.log_duration,
    )


def evenly(items: Sequence[T], most: int) -> list[T]:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)]


def paired_examples(
    tasks: Mapping[str, TaskStatistics], recorded: Mapping[str, TaskStatistics], most: int
) -> list[tuple[int, TrainingExample, TrainingExample]]:
    """Demonstrations, evenly drawn from all tasks: number of the task, as learned, as recorded.

    Args:
        tasks: statistics that primitives are built from.
        recorded: of the same labels or more, of the examples as they were recorded.
        most: how many.
    """
    labels = list(recorded)
    pairs = [
        (labels.index(label), example, as_recorded)
        for label, task in tasks.items()
        for example, as_recorded in zip(task.examples, recorded[label].examples, strict=True)
    ]
    return evenly(pairs, most)


def nearest_tasks(
    tasks: Sequence[TaskStatistics],
    example: TrainingExample,
    others: Integers,
    units: Sequence[str],
) -> Integers:
    """The tasks whose mean weights come nearest to an example's, at most `MAX_RIVALS`.

    Args:
        tasks: their statistics.
        example: what they are compared with.
        others: numbers of those that are compared.
        units: of the observed DOFs, (P,); distances in incommensurate ones are each divided by
            their mean.
    """
    if len(others) <= MAX_RIVALS:
        return others
    apart = np.zeros(len(others))
    for dofs in commensurate(units):
        squares = [np.sum((tasks[k].mean - example.weights)[dofs] ** 2) for k in others]
        apart += len(dofs) * np.array(squares) / (np.mean(squares) or 1.0)
    return others[np.argsort(apart)[:MAX_RIVALS]]
