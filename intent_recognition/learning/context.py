# SPDX-License-Identifier: Apache-2.0
"""How the weights of each task depend on the context, from statistics (`promp.context`)."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.learning.hyperparameters import Hyperparameters
from intent_recognition.learning.preprocessing import SignalNames
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import (
    CONTEXT_STRENGTH,
    ContextModel,
    Scatter,
    observed_block,
    predictive_covariance,
    shared_covariance,
)


def fit_context(
    tasks: Mapping[str, TaskStatistics],
    signals: Sequence[SignalNames],
    n_observed: int,
    floor: Floats,
    chosen: Hyperparameters,
) -> tuple[ContextModel, Floats, Floats]:
    """Regress the weights on the context, and shrink the residual covariance as without a context.

    The regression is Bayesian with a prior of CONTEXT_STRENGTH demonstrations, so it is defined
    from the first demonstration on.

    Args:
        tasks: statistics of each label.
        signals: names and unit of each context signal.
        n_observed: number of observed DOFs.
        floor: variance floor per DOF, (D,).
        chosen: hyperparameters of each task's covariance target.

    Returns:
        The context model, and the covariances of all weights (K, D N, D N) and of the observed
        weights (K, P N, P N) when the context is unknown.
    """
    statistics = list(tasks.values())
    spread = np.diag(CONTEXT_STRENGTH * _typical_variance(statistics))
    scatter = [task.context_scatter + spread for task in statistics]
    gain = [np.linalg.solve(s, t.context_cross.T).T for s, t in zip(scatter, statistics)]
    left = [_left(*parts) for parts in zip(statistics, scatter, gain)]
    pooled = Scatter(np.sum([own.matrix for own in left], axis=0), sum(o.freedom for o in left))
    size = n_observed * statistics[0].mean.shape[1]
    of_observed_part = observed_block(pooled, size), floor[:n_observed], chosen.shared_strength
    observed = shared_covariance(*of_observed_part)
    covariance, whole, of_observed = [], [], []
    assumed = chosen.target(n_observed)
    for task, s, g, own in zip(statistics, scatter, gain, left):
        mean_factor = 1.0 + 1.0 / task.n
        of_context = s * (mean_factor / (task.n - 1 + CONTEXT_STRENGTH))
        explained = g @ of_context @ g.T
        rest = predictive_covariance(own, pooled, task.n, floor, chosen.strength, assumed)
        covariance.append(of_context)
        whole.append(rest + explained)
        of_observed.append(mean_factor * observed + explained[:size, :size])
    model = ContextModel(
        tuple(name for signal in signals for name in signal.names),
        tuple(signal.unit for signal in signals for _ in signal.names),
        np.array([task.context_mean for task in statistics]),
        np.array(covariance),
        np.array(gain),
        np.array([task.n - 1 + CONTEXT_STRENGTH for task in statistics]),
        tuple(len(signal.names) for signal in signals),
    )
    return model, np.array(whole), np.array(of_observed)


def _typical_variance(tasks: Iterable[TaskStatistics]) -> Floats:
    """Variance of the context about the tasks' means, (M,); 1e12 where it did not vary."""
    tasks = list(tasks)
    scatter = np.sum([np.diag(task.context_scatter) for task in tasks], axis=0)
    variance = scatter / max(sum(task.n - 1 for task in tasks), 1)
    size = np.max([np.abs(task.context_mean) for task in tasks], axis=0)
    return np.where(variance > (1e-6 * size) ** 2, variance, 1e6**2)


def _left(task: TaskStatistics, scatter: Floats, gain: Floats) -> Scatter:
    """Scatter of the weights that the context does not explain, and its degrees of freedom."""
    explained = np.trace(np.linalg.solve(scatter, task.context_scatter))
    left = task.scatter - gain @ task.context_cross.T
    return Scatter(0.5 * (left + left.T), task.n - 1 - float(explained))
