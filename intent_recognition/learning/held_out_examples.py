# SPDX-License-Identifier: Apache-2.0
"""Leave demonstrations out in turn, and estimate each one's task and rivals without it."""

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
from intent_recognition.learning.hyperparameters import Hyperparameters
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
"""Most other tasks, nearest by their means, that a demonstration is compared with. Bounds computing
time; tasks farther away have negligible evidence."""
MAX_VALIDATED = 60
"""Most demonstrations left out, evenly drawn from all tasks; bounds computing time."""
N_SCALES = 5
"""Durations per task when margins are learned. Bounds computing time; with the filter's 15, the
margin of a change of mind is about the same (docs/decisions/unknown_movements.md)."""
T = TypeVar("T")


class LeftOutExample(NamedTuple):
    """One demonstration, and its task estimated without it."""

    task: int  # index of its task
    mean: Floats  # mean weights of its task, (D N,)
    covariance: Floats  # covariance of the observed weights, shared by the tasks, (P N, P N)
    joint: Floats  # covariance of all weights of its task, (D N, D N)
    rule: Regression  # of the controlled weights on the observed ones, from `mean` and `joint`
    rivals: Integers  # indices of the other tasks it is compared with
    rival_means: Floats  # mean observed weights of the rivals, without a left-out person, (r, P N)
    observed: Floats  # samples of the observed DOFs, (m, P)
    seen: Floats  # observed DOFs at the scored phases, (s, P)
    poses: Floats  # controlled DOFs at `pose_phases`, (58, Q)
    duration_s: float
    log_duration: float  # mean log duration of the task's other demonstrations [log s]
    group: str  # the person who showed it, "" if unknown

    @property
    def truth(self) -> Floats:
        """Controlled DOFs at the scored phases, (s, Q)."""
        return self.poses[::3]


def leave_out(
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
    units: Sequence[str],
    chosen: Hyperparameters,
) -> list[LeftOutExample]:
    """Leave out demonstrations of each task that has two or more.

    Where all people are known, a person's demonstrations are left out together, provided that every
    task keeps demonstrations of others and that at least two people remain.
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
    """A task without some demonstrations; the fields are those of `LeftOutExample`."""

    mean: Floats
    covariance: Floats
    joint: Floats
    rule: Regression
    log_duration: float


def _of_others(
    rest: Sequence[TaskStatistics], floor: Floats, chosen: Hyperparameters
) -> list[_Rest]:
    """Estimate every task from other people's demonstrations."""
    n_observed = rest[0].examples[0].observed.shape[1]
    size, pooled = n_observed * rest[0].mean.shape[1], pooled_moments(rest)
    examples = [task.examples for task in rest]
    of_observed = observed_block(pooled, size), floor[:n_observed], chosen.shared_strength
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
        covariance = structured_target(own, pooled, floor)
    of_observed = observed_block(rest, size), floor[:n_observed], chosen.shared_strength
    shared = shared_covariance(*of_observed)
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
        as_recorded.group,
    )


def evenly(items: Sequence[T], most: int) -> list[T]:
    """At most `most` of the items, evenly spaced."""
    count = min(len(items), most)
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)]


def paired_examples(
    tasks: Mapping[str, TaskStatistics], recorded: Mapping[str, TaskStatistics], most: int
) -> list[tuple[int, TrainingExample, TrainingExample]]:
    """Draw demonstrations evenly from all tasks: (index of the task, as learned, as recorded).

    Args:
        tasks: statistics that primitives are built from.
        recorded: statistics of the examples as recorded, of the same labels or more.
        most: largest number of demonstrations.
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
    """Indices of the tasks whose mean weights are nearest to an example's, at most `MAX_RIVALS`.

    Args:
        tasks: statistics of all tasks.
        example: the example.
        others: indices of the tasks to choose from.
        units: units of the observed DOFs, (P,); squared distances in incommensurate units are each
            divided by their mean.
    """
    if len(others) <= MAX_RIVALS:
        return others
    apart = np.zeros(len(others))
    for dofs in commensurate(units):
        squares = [np.sum((tasks[k].mean - example.weights)[dofs] ** 2) for k in others]
        apart += len(dofs) * np.array(squares) / (np.mean(squares) or 1.0)
    return others[np.argsort(apart)[:MAX_RIVALS]]
