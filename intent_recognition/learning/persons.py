# SPDX-License-Identifier: Apache-2.0
"""Variation between people, beyond the variation within one person's demonstrations.

Demonstrations of one person resemble each other: together they are a single draw from the
population of people. The observed weights of demonstration i of task k by person g are

    w_kgi = mu_k + b_kg + e_kgi,    b ~ N(0, B),    e ~ N(0, E),

a one-way random-effects model. E is estimated from the scatter about the mean of each person's
demonstrations of a task, and the covariance C of these means from their scatter. B follows from
both by restricted maximum likelihood: in coordinates in which E is the identity, its eigenvalues
are those of C less h, or zero, where h is the mean of 1 / n_kg (Amemiya 1985).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import cholesky, symmetrize
from intent_recognition.learning.examples import TrainingExample
from intent_recognition.learning.statistics import TaskStatistics, summarize
from intent_recognition.promp import Scatter, shared_covariance


class Grouped(NamedTuple):
    """Scatter of demonstrations within and between people."""

    within: Scatter  # about the mean of each person's demonstrations of a task
    between: Scatter  # of these means about the mean of the task
    share: float  # mean of 1 / n over the numbers of demonstrations behind the means
    n_groups: int  # number of people


def compares_people(groups: Sequence[Sequence[str]]) -> bool:
    """Whether the groups of each task's demonstrations show how people differ.

    They do if all are known, somebody has shown a task twice, and there are at least three more
    pairs of person and task than tasks.
    """
    n, cells = sum(map(len, groups)), sum(len(set(task)) for task in groups)
    known = all(name for task in groups for name in task)
    return known and n > cells and cells - len(groups) >= 3


def group_scatter(
    examples: Sequence[Sequence[TrainingExample]], value: Callable[[TrainingExample], Floats]
) -> Grouped | None:
    """Scatter of K tasks' demonstrations by group; None if groups do not show how people differ.

    `value` returns the vector (d,) of an example that is compared.
    """
    if not compares_people([[one.group for one in task] for task in examples]):
        return None
    apart, means, shares = [], [], []
    for task in examples:
        groups = sorted({one.group for one in task})
        cells = [np.array([value(one) for one in task if one.group == name]) for name in groups]
        own = np.array([cell.mean(axis=0) for cell in cells])
        apart += [cell - mean for cell, mean in zip(cells, own, strict=True)]
        means.append(own - own.mean(axis=0))
        shares += [1.0 / len(cell) for cell in cells]
    within, between = np.concatenate(apart), np.concatenate(means)
    n_groups = len({one.group for task in examples for one in task})
    return Grouped(
        Scatter(within.T @ within, len(within) - len(between)),
        Scatter(between.T @ between, len(between) - len(means)),
        float(np.mean(shares)),
        n_groups,
    )


def people(tasks: Sequence[TaskStatistics]) -> int:
    """Number of people who have shown the tasks; 0 if the group of a demonstration is unknown."""
    names = {one.group for task in tasks for one in task.examples}
    return 0 if "" in names else len(names)


def without_group(tasks: Sequence[TaskStatistics], name: str) -> list[TaskStatistics] | None:
    """Tasks without a person's demonstrations; None if a task then has none, or each only one.

    Only demonstrations kept whole count. The group "" is an unknown person: None is returned.
    """
    kept = [[one for one in task.examples if one.group != name] for task in tasks]
    if not name or not all(kept) or sum(map(len, kept)) == len(kept):
        return None
    return [summarize(examples) for examples in kept]


def between_people(grouped: Grouped, floor: Floats, strength: float) -> tuple[Floats, Floats]:
    """Covariances E within and B between people, (d, d) each.

    With few people, the DOFs in which they differ are mostly chance. B is therefore shrunk towards
    equal and slow variation in all DOFs, which counts as `strength` people.

    Args:
        grouped: scatter within and between people.
        floor: variance floor per observed DOF, (P,).
        strength: equivalent sample size of the target that both are shrunk towards.
    """
    within = shared_covariance(grouped.within, floor, strength)
    freedom = grouped.between.freedom
    alike = strength / (strength + freedom)
    strength *= freedom / (grouped.n_groups - 1)  # each person is one draw, in all tasks
    slow = 2.0 / 3.0 / (grouped.n_groups - 1) ** 2
    means = shared_covariance(grouped.between, floor, strength, alike, slow)
    root = cholesky(within, name="covariance within people")
    scaled = np.linalg.solve(root, np.linalg.solve(root, means).T)
    values, vectors = np.linalg.eigh(symmetrize(scaled))
    apart = (root @ vectors) * np.sqrt(np.maximum(values - grouped.share, 0.0))
    return within, symmetrize(apart @ apart.T)


def covariance_of_strangers(
    examples: Sequence[Sequence[TrainingExample]], pooled: Scatter, floor: Floats, strength: float
) -> Floats:
    """Covariance of a new person's demonstrations about the means of their tasks, (d, d).

    The means are uncertain, too, as if each of the G people were one demonstration, so B is
    multiplied by 1 + 1 / G. Without people to compare, the result is the covariance shared by all
    demonstrations.

    Args:
        examples: examples of each task.
        pooled: scatter of the observed weights of all demonstrations about the tasks' means.
        floor: variance floor per observed DOF, (P,).
        strength: equivalent sample size of the target, in demonstrations.
    """
    grouped = group_scatter(examples, lambda one: one.weights[: len(floor)].ravel())
    if grouped is None:
        return shared_covariance(pooled, floor, strength)
    within, between = between_people(grouped, floor, strength)
    return within + (1.0 + 1.0 / grouped.n_groups) * between


def log_duration_variance_of_strangers(
    examples: Sequence[Sequence[TrainingExample]],
) -> float | None:
    """Variance of a new person's log durations about the means of their tasks.

    It is estimated as in `covariance_of_strangers`; None without people to compare.
    """
    grouped = group_scatter(examples, lambda one: np.log([one.duration_s]))
    if grouped is None:
        return None
    within, means = (part.matrix[0, 0] / part.freedom for part in grouped[:2])
    between = max(means - grouped.share * within, 0.0)
    return float(within + (1.0 + 1.0 / grouped.n_groups) * between)
