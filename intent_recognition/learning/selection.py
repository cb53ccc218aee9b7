# SPDX-License-Identifier: Apache-2.0
"""Choose hyperparameters by held-out validation, with the filter that runs online.

Demonstrations are left out in turn. From samples of the observed agent, the filter recognises the
task and predicts the controlled agent. Validation chooses the pace of both agents
(`learning.timing`), the observation noise, and the covariance target behind a task's regression:
its lag, its strength, how independent its weights are, and whether it borrows from other tasks.
The strength of the target of the observed weights' covariance is larger where left-out movements
are clearly more probable under it.
The coupling of the residuals is learned for each candidate (`learning.coupling`). The score, in
nats, is the log loss of the task plus Q / 2 log(mean squared error), the log loss of the controlled
agent's Q DOFs under a normal error whose variance is fitted after each share seen. Slopes from the
demonstrations alone (`promp.ridge`) must be better by more than the standard error over the
demonstrations, to first order in each one's part of the score. This does not apply where whole
people are left out, since one person's demonstrations are not independent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.learning.coupling import HeldOutResiduals, learn_coupling
from intent_recognition.learning.evidence_exponents import (
    choose_duration_evidence,
    expected_power,
    log_losses,
)
from intent_recognition.learning.examples import scored_phases
from intent_recognition.learning.held_out import (
    batches_of,
    follow_known,
    predict_agents,
    samples_at,
)
from intent_recognition.learning.held_out_examples import LeftOutExample, leave_out
from intent_recognition.learning.hyperparameters import (
    INDEPENDENT,
    REGRESSION_STRENGTHS,
    RIDGES,
    STRONG,
    Hyperparameters,
    is_clear,
)
from intent_recognition.learning.persons import compares_people
from intent_recognition.learning.pose_regression import learn_pose_regression
from intent_recognition.learning.regression_variance import choose_regression_variance
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import LAGS, TaskLibrary, explained_by_lag
from intent_recognition.signals import is_spatial

NOISE_SCALES = (1.0, 4.0, 16.0)
"""Factors of the observed DOFs' noise variance that are tried (docs/decisions/one_filter.md)."""
FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""Shares of the movement after which the rest is predicted, in `intent evaluate`, too."""
LEAST_ERROR = 1e-3
"""Relative squared error below which predictions count as equal, the square of 3 % of the standard
deviation: such predictions copy a finished movement (docs/decisions/new_people.md)."""


class Choice(NamedTuple):
    """The chosen hyperparameters, and what was learned along with them.

    Attributes:
        couplings: `coupling` and `pose_regression` of the library; None if no task has any.
        tried: all hyperparameters that were scored.
    """

    best: Hyperparameters
    couplings: Mapping[str, Any]
    tried: tuple[Hyperparameters, ...]


def choose(
    candidates: Mapping[str, tuple[TaskLibrary, Mapping[str, TaskStatistics]]],
    recorded: Mapping[str, TaskStatistics],
) -> Choice:
    """Choose the best hyperparameters; also return their coupling and all that were tried.

    Args:
        candidates: for each pace, a library and the statistics that it was built from.
        recorded: statistics of the examples as they were recorded.
    """

    @lru_cache(maxsize=2)
    def leaving_out(one: Hyperparameters) -> list[LeftOutExample]:
        library, tasks = candidates[one.pace]
        return leave_out(tasks, recorded, library.units, one)

    def left_out(one: Hyperparameters) -> list[LeftOutExample]:
        return leaving_out(one._replace(noise_scale=0.0))

    def scored(one: Hyperparameters) -> Hyperparameters:
        library, tasks = candidates[one.pace]
        scaled = replace(library, noise_scale=one.noise_scale)
        losses, errors = validate(scaled, left_out(one), tasks)
        mean = errors.mean(axis=1, keepdims=True)
        usual = np.maximum(mean, LEAST_ERROR)
        log_errors = np.mean(np.log(usual) + (errors - mean) / usual, axis=0)
        parts[one] = losses[-1] + 0.5 * library.n_controlled * log_errors
        log_loss, error, score = (float(x.mean()) for x in (losses[-1], mean, parts[one]))
        power = expected_power(losses)
        return one._replace(task_evidence=power, log_loss=log_loss, error=error, score=score)

    def best_with(*more: Hyperparameters) -> Hyperparameters:
        tried.update((one, scored(one)) for one in more if one not in tried)
        return min(tried, key=lambda one: round(tried[one].score, 9))  # ignores rounding

    if not all(left_out(Hyperparameters(pace)) for pace in candidates):
        nothing = {"coupling": None, "pose_regression": None}
        return Choice(Hyperparameters(), nothing, (Hyperparameters(),))
    tried: dict[Hyperparameters, Hyperparameters] = {}
    parts: dict[Hyperparameters, Floats] = {}
    first = Hyperparameters(next(iter(candidates)))
    lags = _lags(*candidates[first.pace])
    lag = best_with(first, *(first._replace(lag=lag) for lag in lags)).lag
    grid = product(candidates, sorted({0.0, lag}), NOISE_SCALES)
    best = best_with(*(Hyperparameters(pace, scale, lag=one) for pace, one, scale in grid))
    best = best_with(best._replace(borrowed=0.0))
    best = best_with(*(best._replace(independent=part) for part in INDEPENDENT[1:]))
    of_people = compares_people([[e.group for e in task.examples] for task in recorded.values()])
    if of_people:
        best = best_with(*(best._replace(ridge=one) for one in RIDGES[:2]))
    best = best_with(*(best._replace(strength=other) for other in REGRESSION_STRENGTHS[1:]))
    if of_people:  # a ridge may predict best at another pace than the target's slopes
        best = best_with(*(best._replace(pace=pace) for pace in candidates))
    for ridge in () if of_people else RIDGES:  # these slopes do not depend on the strength
        alone = best._replace(ridge=ridge, strength=REGRESSION_STRENGTHS[0])
        best_with(alone)
        gained = parts[best] - parts[alone]
        if is_clear(gained):
            best = alone
        elif not best.ridge and gained.mean() <= 0.0:  # other ridges will not be better either
            break
    library = replace(candidates[best.pace][0], noise_scale=best.noise_scale)
    tasks, strong = candidates[best.pace][1], best._replace(shared_strength=STRONG)
    if not of_people:  # a strength of people is another one
        weak, other = (_evidence(library, left_out(one), tasks) for one in (best, strong))
        if is_clear(other - weak, errors=2.0):
            best, tried[strong] = strong, scored(strong)
    of_best = left_out(best)
    variance = _variance(library, of_best)
    exponent, coupling = choose_duration_evidence(library, of_best, FRACTIONS, variance)
    regression = learn_pose_regression(library, of_best, exponent, coupling, variance)
    uncertain = choose_regression_variance(library, of_best, tasks, FRACTIONS)
    chosen = tried[best]._replace(duration_evidence=exponent, regression_variance=uncertain)
    tried[best] = chosen
    found = {"coupling": coupling if np.any(coupling.gain) else None, "pose_regression": regression}
    return Choice(chosen, found, (*tried.values(),))


def _lags(library: TaskLibrary, tasks: Mapping[str, TaskStatistics]) -> list[float]:
    """The lag that explains most of the controlled DOFs, unless it is the first or the last."""
    floor, _ = variance_scales(tasks, library.units)
    explained = explained_by_lag(pooled_moments(tasks.values()), library.n_observed, floor)
    most = int(np.argmax(explained))
    return [float(LAGS[most])] if 0 < most < len(LAGS) - 1 else []


def _variance(library: TaskLibrary, left_out: Sequence[LeftOutExample]) -> Floats:
    """Variance of the controlled DOFs, which divides their squared errors, (Q,)."""
    truth = np.concatenate([one.truth for one in left_out])
    size = np.where(is_spatial(library.controlled_units), 1.0, np.abs(truth).max(axis=0))
    return np.maximum(np.var(truth, axis=0), 1e-12 * np.where(size > 0.0, size, 1.0) ** 2)


def validate(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Floats, Floats]:
    """Log losses of the task and relative errors of the controlled agent, at known duration.

    The losses are those under each exponent of the evidence, (A, n). The errors are those after
    each of `FRACTIONS`, with the coupling of the residuals applied, (f, n).
    """
    variance = _variance(library, left_out)
    parts = [_follow(library, some, tasks) for some in batches_of(library, left_out)]
    loss, observed, controlled = zip(*parts, strict=True)
    residuals = HeldOutResiduals(
        np.array([one.task for one in left_out]),
        scored_phases(),
        np.array(FRACTIONS),
        np.concatenate(observed, axis=1),
        np.concatenate(controlled, axis=1),
    )
    _, left = learn_coupling(residuals, variance, library.durations_s)
    return np.concatenate(loss, axis=1), np.mean(left / variance, axis=2)


def _follow(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Floats, Floats, Floats]:
    """Mean log losses (A, n), and residuals after `FRACTIONS`: (f, n, s, P) and (f, n, s, Q)."""
    truth = np.array([one.truth for one in left_out])
    seen = np.array([one.seen for one in left_out])
    losses, observed, controlled = [], [], []
    for followed in follow_known(library, left_out, tasks):
        losses.append(log_losses(followed.progress.log_evidence, followed.own[:, 0]))
        if followed.progress.n_samples in samples_at(FRACTIONS):
            both = predict_agents(library, left_out, followed)
            observed.append(seen - both[0][:, 0])
            controlled.append(truth - both[1][:, 0])
    return np.mean(losses, axis=0), np.array(observed), np.array(controlled)


def _evidence(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> Floats:
    """Log density of each demonstration's samples under its own task, (n,)."""
    batches = batches_of(library, left_out)
    followed = [[*follow_known(library, some, tasks)][-1] for some in batches]
    return np.concatenate([one.progress.log_evidence[one.own[:, 0]] for one in followed])
