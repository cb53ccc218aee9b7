# SPDX-License-Identifier: Apache-2.0
"""Sufficient statistics of a task's demonstrations: exact, mergeable and of bounded size.

Means, covariances, noise, timing and the none model are functions of these sums. The sums are taken
about their own means and merged pairwise (Chan, Golub & LeVeque 1983, Eq. 2.1), which loses no
digits where the standard deviation is small compared to the mean. Only the choice of
hyperparameters needs single demonstrations; a bounded sample of them is kept, which does not depend
on their order.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from hashlib import blake2b
from typing import Any

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ShapeError
from intent_recognition.learning.examples import TrainingExample
from intent_recognition.promp import Scatter, weight_floor

MAX_EXAMPLES = 200
"""Most demonstrations of one task that are kept whole, to choose hyperparameters on; bounds the
size of a model file."""


@dataclass(frozen=True)
class TaskStatistics:
    """Sufficient statistics of n demonstrations of one task."""

    n: int  # number of demonstrations
    mean: Floats  # mean weights, (D, N), observed DOFs first
    scatter: Floats  # sum of outer products of the weights' deviations from it, (D N, D N)
    # lowest, highest: smallest and largest weight of each DOF, (D,)
    lowest: Floats
    highest: Floats
    residual_sum: Floats  # sum of the residual variances, (D,)
    log_duration_mean: float  # mean of the logarithms of the durations in seconds
    log_duration_scatter: float  # sum of squared deviations from that mean
    duration_sum_s: float
    context_mean: Floats  # mean context, (M,)
    context_scatter: Floats  # sum of outer products of the contexts' deviations from it, (M, M)
    context_cross: Floats  # sum of outer products of weights' and contexts' deviations, (D N, M)
    # all demonstrations, or `MAX_EXAMPLES` of them drawn by a hash of their names
    examples: tuple[TrainingExample, ...]
    # statistics of the aligned examples; None where nothing was aligned
    aligned: "TaskStatistics | None" = None

    @property
    def moments(self) -> Scatter:
        """The scatter with its degrees of freedom."""
        return Scatter(self.scatter, self.n - 1)


def summarize(examples: Sequence[TrainingExample]) -> TaskStatistics:
    """Statistics of one or more demonstrations of one task.

    Raises:
        ShapeError: there is no example.
    """
    if not examples:
        cure = "Leave the task out."
        raise ShapeError.about("examples", "one or more demonstrations", "none", cure)
    weights = np.array([example.weights for example in examples])
    mean = weights.mean(axis=0)
    flat = (weights - mean).reshape(len(weights), -1)
    logs = np.log([example.duration_s for example in examples])
    context = np.array([example.context for example in examples])
    apart = context - context.mean(axis=0)
    aligned = [example.aligned for example in examples if example.aligned is not None]
    return TaskStatistics(
        n=len(examples),
        mean=mean,
        scatter=flat.T @ flat,
        lowest=weights.min(axis=(0, 2)),
        highest=weights.max(axis=(0, 2)),
        residual_sum=np.sum([example.residual_variance for example in examples], axis=0),
        log_duration_mean=float(logs.mean()),
        log_duration_scatter=float(np.sum((logs - logs.mean()) ** 2)),
        duration_sum_s=float(sum(example.duration_s for example in examples)),
        context_mean=context.mean(axis=0),
        context_scatter=apart.T @ apart,
        context_cross=flat.T @ apart,
        examples=_draw(examples),
        aligned=summarize(aligned) if len(aligned) == len(examples) else None,
    )


def merge_statistics(first: TaskStatistics, second: TaskStatistics) -> TaskStatistics:
    """Merge statistics of one task's demonstrations (Chan, Golub & LeVeque 1983, Eq. 2.1)."""
    n = first.n + second.n
    share, pairs = second.n / n, first.n * second.n / n
    step = second.mean - first.mean
    context_step = second.context_mean - first.context_mean
    log_step = second.log_duration_mean - first.log_duration_mean

    def summed(name: str, apart: Floats | float = 0.0) -> Any:
        return getattr(first, name) + getattr(second, name) + apart

    aligned = None
    if first.aligned is not None and second.aligned is not None:
        aligned = merge_statistics(first.aligned, second.aligned)
    return TaskStatistics(
        n=n,
        mean=first.mean + share * step,
        scatter=summed("scatter", pairs * np.outer(step, step)),
        lowest=np.minimum(first.lowest, second.lowest),
        highest=np.maximum(first.highest, second.highest),
        residual_sum=summed("residual_sum"),
        log_duration_mean=first.log_duration_mean + share * log_step,
        log_duration_scatter=summed("log_duration_scatter", pairs * log_step**2),
        duration_sum_s=summed("duration_sum_s"),
        context_mean=first.context_mean + share * context_step,
        context_scatter=summed("context_scatter", pairs * np.outer(context_step, context_step)),
        context_cross=summed("context_cross", pairs * np.outer(step, context_step)),
        examples=_draw((*first.examples, *second.examples)),
        aligned=aligned,
    )


def merge_tasks(
    first: Mapping[str, TaskStatistics], second: Mapping[str, TaskStatistics]
) -> dict[str, TaskStatistics]:
    """Merge statistics by label, sorted."""
    merged = dict(first)
    for label, task in second.items():
        merged[label] = merge_statistics(merged[label], task) if label in merged else task
    return dict(sorted(merged.items()))


def pooled_moments(tasks: Iterable[TaskStatistics]) -> Scatter:
    """Scatter of all demonstrations about the means of their tasks."""
    tasks = list(tasks)
    matrix = reduce(np.add, (task.scatter for task in tasks))
    return Scatter(matrix, sum(task.n - 1 for task in tasks))


def variance_scales(
    tasks: Mapping[str, TaskStatistics], units: Sequence[str]
) -> tuple[Floats, Floats]:
    """Variance floor and noise variance of each DOF over all demonstrations, (D,) each."""
    statistics = tasks.values()
    lowest = np.min([task.lowest for task in statistics], axis=0)
    highest = np.max([task.highest for task in statistics], axis=0)
    floor = weight_floor(np.stack([lowest, highest], axis=1)[None], units)
    residual = np.sum([task.residual_sum for task in statistics], axis=0)
    return floor, np.maximum(residual / sum(task.n for task in statistics), floor)


def _draw(examples: Sequence[TrainingExample]) -> tuple[TrainingExample, ...]:
    """Sample the `MAX_EXAMPLES` with the smallest hash, whatever the order and grouping."""

    def key(example: TrainingExample) -> bytes:
        identity = f"{example.name}\0{example.duration_s!r}"
        return blake2b(identity.encode(), digest_size=8).digest()

    return tuple(sorted(examples, key=key)[:MAX_EXAMPLES])
