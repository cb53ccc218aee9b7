# SPDX-License-Identifier: Apache-2.0
"""Tell people apart whom the recordings do not name.

A person's offset from the means of the tasks is alike in all tasks. Offsets of all demonstrations
therefore form clusters, one for each person: a Gaussian mixture with one covariance within people.
The number of people has the largest integrated completed likelihood (Biernacki, Celeux and Govaert
2000), the Bayesian information criterion less the entropy of who showed what. Clusters that do not
each show all tasks are ways to do a task, and are no people; nor are those of a single task.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian import cholesky, half_log_det, kmeans_starts, one_hot, solve_lower
from intent_recognition.learning.persons import compares_people
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import UNNAMED

MOST_AXES, PER_AXIS = 5, 8
"""Most principal components of the offsets that are compared, and fewest demonstrations for each of
these (docs/decisions/new_people.md)."""
MOST_PEOPLE, MOST_COMPARED = 12, 1000
"""Most people who are told apart, and most demonstrations in which they are. They bound computing
time."""
CLEAR = 0.5
"""Gain in the criterion over one person that shows several, in nats per demonstration
(docs/decisions/new_people.md)."""
STARTS, STEPS, CONVERGED, PATIENCE = 10, 30, 1e-2, 2
"""Starts of the mixture, its most steps, the gain in nats at which they end, and how many larger
numbers of clusters are tried in vain. They bound computing time."""


def told_apart(tasks: Mapping[str, TaskStatistics]) -> bool:
    """Whether people whom no recording names were told apart."""
    return any(one.group.startswith(UNNAMED) for task in tasks.values() for one in task.examples)


def with_people(tasks: Mapping[str, TaskStatistics], n_observed: int) -> dict[str, TaskStatistics]:
    """Name the people in the examples of all tasks, if none is named and they differ clearly.

    People who were told apart before are told apart anew. Where a recording names one, those who
    were told apart are unknown, since each may be the one who is named.
    """
    examples = [one for task in tasks.values() for one in task.examples]
    names = ["" if one.group.startswith(UNNAMED) else one.group for one in examples]
    if examples and not any(names):
        labels = [label for label, task in tasks.items() for _ in task.examples]
        weights = np.array([one.weights[:n_observed] for one in examples])
        offsets = weights - np.array([tasks[label].mean[:n_observed] for label in labels])
        size = np.sqrt(np.mean(offsets**2, axis=(0, 2), keepdims=True))
        offsets = (offsets / np.where(size > 0.0, size, 1.0)).reshape(len(labels), -1)
        if (found := tell_apart(offsets, labels)).any():
            names = [f"{UNNAMED}{k + 1}" for k in found]
    rest = iter(names)
    return {
        label: _named(task, [*islice(rest, len(task.examples))]) for label, task in tasks.items()
    }


def _named(task: TaskStatistics, names: Sequence[str]) -> TaskStatistics:
    """The statistics with names of the people, also in the aligned examples."""
    aligned = None if task.aligned is None else _named(task.aligned, names)
    over_reference = [one.aligned for one in task.examples] if aligned is None else aligned.examples
    parts = zip(task.examples, names, over_reference, strict=True)
    named = tuple(one._replace(group=name, aligned=other) for one, name, other in parts)
    return replace(task, examples=named, aligned=aligned)


def tell_apart(offsets: Floats, tasks: Sequence[str]) -> Integers:
    """Who showed each demonstration, (n,): numbers from zero, all zero if nobody differs clearly.

    Args:
        offsets: of n demonstrations from the means of their tasks, in comparable units, (n, d).
        tasks: task of each demonstration, (n,).
    """
    n, kinds = len(tasks), set(tasks)
    nobody = np.zeros(n, dtype=np.int64)
    n_axes = min(MOST_AXES, n // PER_AXIS)
    if len(kinds) < 2 or not n_axes or n > MOST_COMPARED or not offsets.any():
        return nobody
    left, size, _ = np.linalg.svd(offsets, full_matrices=False)
    points = left[:, :n_axes][:, size[:n_axes] > 1e-9 * size[0]] * np.sqrt(n)
    rng, one = np.random.default_rng(0), _fit(points, nobody, 1)
    reached, at = one.criterion, 1  # by any clusters, people or not
    best = one._replace(criterion=one.criterion + CLEAR * n)
    for count in range(2, min(MOST_PEOPLE, n // (2 * len(kinds))) + 1):
        starts = np.unique(kmeans_starts(points, count, STARTS, rng), axis=0)
        for fit in (_fit(points, labels, count) for labels in starts):
            if fit.criterion > reached:
                reached, at = fit.criterion, count
            if fit.criterion > best.criterion and _are_people(fit.labels, tasks):
                best = fit
        if count >= at + PATIENCE:
            break
    return best.labels


def _are_people(labels: Integers, tasks: Sequence[str]) -> bool:
    """Whether each cluster shows every task, and together they show how people differ."""
    shown: dict[str, list[str]] = {task: [] for task in sorted(set(tasks))}
    for label, task in zip(labels, tasks, strict=True):
        shown[task].append(str(label))
    whole = all(len(set(own)) == labels.max() + 1 for own in shown.values())
    return whole and compares_people([*shown.values()])


class _Fit(NamedTuple):
    criterion: float  # integrated completed likelihood, in nats
    labels: Integers


def _fit(points: Floats, labels: Integers, count: int) -> _Fit:
    """Expectation maximisation from labels (n,), with one covariance for all `count` components."""
    (n, size), value = points.shape, -np.inf
    share = one_hot(labels, count)
    for _ in range(STEPS):
        members = share.sum(axis=0)
        if members.min() < 1.5:
            return _Fit(-np.inf, labels)
        apart = points[:, None] - (share.T @ points) / members[:, None]
        rows = (np.sqrt(share)[..., None] * apart).reshape(-1, size)
        root = cholesky((rows.T @ rows + 1e-3 * np.eye(size)) / n, name="covariance of offsets")
        white = solve_lower(root, apart.reshape(-1, size).T)
        square = np.sum(white**2, axis=0).reshape(n, count)
        joint = np.log(members / n) - 0.5 * square - half_log_det(root)
        total = np.logaddexp.reduce(joint, axis=1)
        share, before, value = np.exp(joint - total[:, None]), value, float(total.sum())
        if value - before < CONVERGED:
            break
    certain = np.sum(share * np.log(np.maximum(share, 1e-300)))
    parameters = count * (size + 1) - 1
    return _Fit(float(value + certain - 0.5 * parameters * np.log(n)), share.argmax(axis=1))
