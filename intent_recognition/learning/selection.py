# SPDX-License-Identifier: Apache-2.0
"""Hyperparameters chosen by held-out validation, with the filter that runs online.

Demonstrations are left out in turn. From samples of the observed agent the filter recognises the
task and predicts the controlled agent. What is chosen is the pace of both agents
(`learning.timing`), the noise of an observation, and of the target of a task's regression: whether
it has a lag or borrows from the other tasks, how strong it is, and how independent the weights are.
The coupling of the residuals is learned beside each (`learning.coupling`). The score of a candidate
is in nats: the log loss of the task, plus that of the controlled agent's Q DOFs
under a normal error whose variance is fitted after each share seen, Q / 2 log(mean squared error).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.coupling import HeldOutResiduals, learn_coupling
from intent_recognition.learning.duration_evidence import (
    EXPONENTS,
    N_DURATIONS,
    choose_duration_evidence,
)
from intent_recognition.learning.examples import TrainingExample, scored_phases
from intent_recognition.learning.held_out import (
    MAX_FLOATS,
    LeftOutExample,
    filter_samples,
    nearest_tasks,
    paired_examples,
    predict_agents,
    samples_at,
)
from intent_recognition.learning.persons import covariance_of_strangers, people, without_group
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.learning.task_evidence import expected_power, log_losses
from intent_recognition.promp import (
    LAGS,
    OTHERS_SAMPLE_SIZE,
    ResidualCoupling,
    Scatter,
    TargetSettings,
    TaskLibrary,
    explained_by_lag,
    observed_block,
    predictive_covariance,
    shared_covariance,
    structured_target,
    without_demonstration,
)
from intent_recognition.signals import is_spatial

STRENGTH = 4.0
"""Equivalent sample size of the target of the shared covariance, in demonstrations
(docs/decisions/one_filter.md)."""
REGRESSION_STRENGTHS = (30.0, 100.0)
"""The same for each task's own covariance, from which the controlled agent's regression comes; the
first where nothing can be left out (docs/decisions/covariance_target.md)."""
INDEPENDENT = (0.0, 0.01)
"""Independent parts of these weights' variance that are tried
(docs/decisions/covariance_target.md)."""
NOISE_SCALES = (1.0, 4.0, 16.0)
"""Factors of the observed DOFs' noise variance that are tried. Convention."""
FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""Shares of the movement after which the rest is predicted. Convention: those of `intent evaluate`.
"""
LEAST_ERROR = 1e-3
"""Relative squared error, the square of 3 % of the standard deviation, below which predictions are
alike: copies of a finished movement (docs/decisions/new_people.md)."""
MAX_VALIDATED = 60
"""Demonstrations left out, evenly drawn from all tasks. Convention: it bounds the time."""


class Hyperparameters(NamedTuple):
    """Hyperparameters and their score on demonstrations left out, lower wins.

    Attributes:
        pace: one of `PACES`.
        noise_scale: factor of the observed DOFs' noise variance.
        duration_evidence: exponent of the evidence in the posterior of the duration.
        borrowed: equivalent sample size of the other tasks in the target of each task's own
            covariance, in demonstrations.
        strength: equivalent sample size of this target, in demonstrations.
        independent: part of a weight's variance in it that no other weight shares.
        lag: how much later in phase the controlled agent follows, in it.
        task_evidence: exponent of the evidence of the tasks against each other.
        log_loss: of the task, mean over the movement, in nats.
        error: mean squared error of the controlled agent, each DOF in parts of its variance.
        score: both together, in nats; NaN where nothing could be left out.
    """

    pace: str = "own"
    noise_scale: float = 4.0
    duration_evidence: float = EXPONENTS[0]
    borrowed: float = OTHERS_SAMPLE_SIZE
    strength: float = REGRESSION_STRENGTHS[0]
    independent: float = INDEPENDENT[0]
    lag: float = 0.0
    task_evidence: float = 1.0
    log_loss: float = float("nan")
    error: float = float("nan")
    score: float = float("nan")

    def target(self, n_observed: int) -> TargetSettings:
        """What the target of a task's own covariance assumes."""
        return TargetSettings(self.borrowed, self.independent, self.lag, n_observed)

    @property
    def aligned(self) -> bool:
        """Whether demonstrations are aligned before their weights are fitted."""
        return self.pace == "aligned"


class Choice(NamedTuple):
    """What was chosen.

    Attributes:
        coupling: of the residuals, learned with them; None where there is none in any task.
        tried: all hyperparameters that were scored.
    """

    best: Hyperparameters
    coupling: ResidualCoupling | None
    tried: tuple[Hyperparameters, ...]


def choose(
    candidates: Mapping[str, tuple[TaskLibrary, Mapping[str, TaskStatistics]]],
    recorded: Mapping[str, TaskStatistics],
) -> Choice:
    """The best hyperparameters, their coupling, and all that were tried.

    Args:
        candidates: by pace a library, with the statistics that it was built from.
        recorded: statistics of the examples as they were recorded.
    """
    known: dict[Hyperparameters, list[LeftOutExample]] = {}

    def left_out(one: Hyperparameters) -> list[LeftOutExample]:
        key = one._replace(noise_scale=0.0)
        if key not in known:
            library, tasks = candidates[one.pace]
            known[key] = _leave_out(tasks, recorded, library.units, one)
        return known[key]

    def scored(one: Hyperparameters) -> Hyperparameters:
        library, tasks = candidates[one.pace]
        scaled = replace(library, noise_scale=one.noise_scale)
        losses, errors = validate(scaled, left_out(one), tasks)
        log_loss, power = float(losses[-1].mean()), expected_power(losses)
        log_error, error = np.log(np.maximum(errors, LEAST_ERROR)).mean(), float(errors.mean())
        score = log_loss + 0.5 * library.n_controlled * float(log_error)
        return one._replace(task_evidence=power, log_loss=log_loss, error=error, score=score)

    def best_with(*more: Hyperparameters) -> Hyperparameters:
        tried.update((one, scored(one)) for one in more if one not in tried)
        return min(tried, key=lambda one: round(tried[one].score, 9))  # whatever rounding adds

    if not all(left_out(Hyperparameters(pace)) for pace in candidates):
        return Choice(Hyperparameters(), None, (Hyperparameters(),))
    tried: dict[Hyperparameters, Hyperparameters] = {}
    first = Hyperparameters(next(iter(candidates)))
    lags = _lags(*candidates[first.pace])
    lag = best_with(first, *(first._replace(lag=lag) for lag in lags)).lag
    best = best_with(
        *(
            Hyperparameters(pace, scale, lag=one)
            for pace in candidates
            for scale in NOISE_SCALES
            for one in sorted({0.0, lag})
        )
    )
    best = best_with(best._replace(borrowed=0.0))
    best = best_with(*(best._replace(independent=part) for part in INDEPENDENT[1:]))
    best = best_with(*(best._replace(strength=other) for other in REGRESSION_STRENGTHS[1:]))
    library = replace(candidates[best.pace][0], noise_scale=best.noise_scale)
    at_once, of_best = _at_once(library, N_DURATIONS), left_out(best)
    variance = _variance(library, of_best)
    exponent, coupling = choose_duration_evidence(library, of_best, FRACTIONS, variance, at_once)
    chosen = tried[best] = tried[best]._replace(duration_evidence=exponent)
    return Choice(chosen, coupling if np.any(coupling.gain) else None, (*tried.values(),))


def _lags(library: TaskLibrary, tasks: Mapping[str, TaskStatistics]) -> list[float]:
    """The lag after which the observed DOFs explain most of the controlled ones.

    None where that is at once, or the longest of those compared: then nothing is a peak.
    """
    floor, _ = variance_scales(tasks, library.units)
    explained = explained_by_lag(pooled_moments(tasks.values()), library.n_observed, floor)
    most = int(np.argmax(explained))
    return [float(LAGS[most])] if 0 < most < len(LAGS) - 1 else []


def _variance(library: TaskLibrary, left_out: Sequence[LeftOutExample]) -> Floats:
    """Variance of the controlled DOFs, by which their squared errors are divided, (Q,)."""
    truth = np.concatenate([one.truth for one in left_out])
    size = np.where(is_spatial(library.controlled_units), 1.0, np.abs(truth).max(axis=0))
    return np.maximum(np.var(truth, axis=0), 1e-12 * np.where(size > 0.0, size, 1.0) ** 2)


def _at_once(library: TaskLibrary, n_hypotheses: int) -> int:
    """Demonstrations filtered at a time, each under so many hypotheses."""
    return max(1, MAX_FLOATS // (library.n_observed_weights**2 * n_hypotheses))


def validate(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Floats, Floats]:
    """Log losses of the task and relative errors of the controlled agent, the duration known.

    The losses (A, n) are those under each of the powers of the evidence; the errors are those after
    each of `FRACTIONS` which the coupling of the residuals leaves, (f,).
    """
    variance = _variance(library, left_out)
    most = _at_once(library, 1 + max(len(one.rivals) for one in left_out))
    parts = [
        _follow(library, left_out[start : start + most], tasks)
        for start in range(0, len(left_out), most)
    ]
    loss, observed, controlled = zip(*parts, strict=True)
    residuals = HeldOutResiduals(
        np.array([one.task for one in left_out]),
        scored_phases(),
        np.array(FRACTIONS),
        np.concatenate(observed, axis=1),
        np.concatenate(controlled, axis=1),
    )
    _, left = learn_coupling(residuals, variance, library.durations_s)
    return np.concatenate(loss, axis=1), np.mean(left / variance, axis=(1, 2))


def _follow(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Floats, Floats, Floats]:
    """Log losses of demonstrations (A, n), and residuals of both agents after `FRACTIONS`.

    The losses are means over the movement; the residuals are (f, n, s, P) and (f, n, s, Q).
    """
    prior, own = _priors(library, left_out, tasks)
    sizes = np.diff(np.append(own, len(prior.mean)))
    samples = np.repeat(np.array([one.observed for one in left_out]), sizes, axis=0)
    samples = np.swapaxes(samples, 0, 1)
    truth = np.array([one.truth for one in left_out])
    seen = np.array([one.seen for one in left_out])
    losses, observed, controlled, pace = [], [], [], np.ones(len(prior.mean))
    relative = np.exp(_log_relative(library, left_out))
    for progress in filter_samples(library, prior, pace, relative, samples):
        losses.append(log_losses(progress.log_evidence, own))
        if progress.n_samples in samples_at(FRACTIONS):
            of_own = own[:, None], pace[own, None], relative[own, None]
            both = predict_agents(library, left_out, progress, *of_own)
            observed.append(seen - both[0][:, 0])
            controlled.append(truth - both[1][:, 0])
    return np.mean(losses, axis=0), np.array(observed), np.array(controlled)


def _at_scored_phases(samples: Floats) -> Floats:
    """Samples of the observed agent (m, P) at the scored phases, (s, P)."""
    phases = (np.arange(len(samples)) + 0.5) / len(samples)
    columns = [np.interp(scored_phases(), phases, column) for column in samples.T]
    return np.stack(columns, axis=1)


def _priors(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Gaussian, Integers]:
    """Observed weights under the own task and the rivals of each; where each own task stands."""
    size, count = library.n_observed_weights, np.array([task.n for task in tasks.values()])
    mean, covariance = [], []
    for one in left_out:
        n = np.r_[max(count[one.task] - 1, 1), count[one.rivals]]
        mean.append(np.vstack([one.mean[:size], one.rival_means]))
        covariance.append(one.covariance * (1.0 + 1.0 / n)[:, None, None])
    own = np.cumsum([0, *(len(part) for part in mean[:-1])])
    return Gaussian(np.concatenate(mean), np.concatenate(covariance)), own


def _log_relative(library: TaskLibrary, left_out: Sequence[LeftOutExample]) -> Floats:
    """Log of their durations in parts of the usual ones of own task and rivals, one after another.

    Those of the own task are without the demonstration.
    """
    usual = [np.r_[one.log_duration, library.log_duration_mean[one.rivals]] for one in left_out]
    return np.concatenate(
        [np.log(one.duration_s) - of_one for one, of_one in zip(left_out, usual, strict=True)]
    )


def _leave_out(
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
    gain: Floats
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
        gain = _gain(predictive_covariance(*parts), size)
        found.append(_Rest(task.mean.ravel(), shared, gain, task.log_duration_mean))
    return found


def _gain(covariance: Floats, size: int) -> Floats:
    """Of the controlled weights on the observed ones, of which there are so many."""
    return np.linalg.solve(covariance[:size, :size], covariance[:size, size:]).T


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
    rest_of_task = _Rest(mean, shared, _gain(covariance, size), log_duration)
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
    samples, size = as_recorded.observed, rest.gain.shape[1]
    return LeftOutExample(
        number,
        *rest[:3],
        rivals,
        np.array([means[rival][:size] for rival in rivals]).reshape(-1, size),
        samples,
        _at_scored_phases(samples),
        as_recorded.controlled,
        as_recorded.duration_s,
        rest.log_duration,
    )
