# SPDX-License-Identifier: Apache-2.0
"""Libraries without some demonstrations, and the odds against the true task along these.

Such a library is not learned again: it follows from the tasks' statistics. Hyperparameters, the
timing of the tasks and the phase deviations stay those of all demonstrations.

The largest odds determine from which probability a task may be acted on (`promp.risk_of`,
docs/recognition.md). The odds of hypotheses born during a movement determine the evidence that a
change of mind requires: such hypotheses also fit people who do not move quite as they were taught,
and a change of mind must be more probable than that (docs/decisions/change_of_mind.md).
Demonstrations of a person are left out together, so that the odds hold for a new person; where
nobody else was recorded, they are left out one by one.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.filtering import NEGLIGIBLE, MovementFilter, PriorGrid, make_prior_grid
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.examples import TrainingExample, sample_phases
from intent_recognition.learning.held_out_examples import N_SCALES, paired_examples
from intent_recognition.learning.hyperparameters import STRENGTH
from intent_recognition.learning.none_model import (
    Departure,
    departures,
    none_primitive,
    none_timing,
)
from intent_recognition.learning.persons import covariance_of_strangers, without_group
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import (
    MAX_NONE,
    NO_ODDS,
    LeftOutOdds,
    Scatter,
    TaskLibrary,
    conformal_bound,
    observed_block,
    shared_covariance,
    without_demonstration,
)
from intent_recognition.signals import observations_of

MAX_FOLLOWED = 40
"""Most demonstrations that are filtered. Bounds computing time; 19 suffice for a share of one in
twenty."""


class LeftOut(NamedTuple):
    """Distributions of the observed weights in a library without some demonstrations."""

    library: TaskLibrary  # library of all demonstrations
    mean: Floats  # mean of each task, (K, P N)
    covariance: Floats  # covariance about each task's known mean, (P N, P N)
    n: Integers  # number of demonstrations of each task, (K,)
    none: Gaussian  # weights of an unknown movement
    timing: Floats  # mean and standard deviation of an unknown movement's log duration, (2,)

    def as_library(self) -> TaskLibrary:
        """The whole library with these distributions of the observed weights."""
        weight_mean = self.library.weight_mean.copy()
        weight_mean[:, : self.library.n_observed_weights] = self.mean
        return replace(
            self.library,
            weight_mean=weight_mean,
            observed_weight_covariance=(1.0 + 1.0 / self.n)[:, None, None] * self.covariance,
            none_mean=self.none.mean,
            none_covariance=self.none.covariance,
            none_log_duration=self.timing,
        )


class LeavingOut:
    """Leave demonstrations out of a library.

    Args:
        library: the learned tasks.
        tasks: statistics that the library was built from.
        strength: equivalent sample size of the shared covariance's target, in demonstrations.
    """

    def __init__(
        self, library: TaskLibrary, tasks: Mapping[str, TaskStatistics], strength: float = STRENGTH
    ):
        self.library, self.tasks, self._strength = library, tasks, strength
        self.statistics = list(tasks.values())
        size = library.n_observed_weights
        self._pooled = observed_block(pooled_moments(self.statistics), size)
        self._floor = variance_scales(tasks, library.units)[0][: library.n_observed]
        self._departed = departures(self.statistics, library.observed_units)
        self.group = cache(self._without_group)  # many demonstrations share a group

    def nothing(self) -> LeftOut:
        """Leave nothing out."""
        inflation = 1.0 + 1.0 / self.library.n_demonstrations[0]
        covariance = self.library.observed_covariance[0] / inflation
        return self._left_out(covariance, self._departed)

    def task(self, number: int) -> LeftOut:
        """Leave a whole task out, as in a library of the other tasks."""
        label, n_observed = self.library.labels[number], self.library.n_observed
        own = observed_block(self.tasks[label].moments, self.library.n_observed_weights)
        rest = Scatter(self._pooled.matrix - own.matrix, self._pooled.freedom - own.freedom)
        kept = {other: task for other, task in self.tasks.items() if other != label}
        floor = variance_scales(kept, self.library.units)[0][:n_observed]
        rest = rest if rest.freedom else self._pooled
        examples = [task.examples for task in kept.values()]
        covariance = covariance_of_strangers(examples, rest, floor, self._strength)
        departed = departures(list(kept.values()), self.library.observed_units)
        return self._left_out(covariance, departed, without=number)

    def unseen(self, number: int, example: TrainingExample) -> LeftOut | None:
        """Leave a demonstration out with all of its person's, or alone; None if neither works."""
        found = self.group(example.group)
        something_is_left = self.statistics[number].n > 1 and self._pooled.freedom > 1
        if found is None and something_is_left:
            return self.demonstration(number, example)
        return found

    def demonstration(self, number: int, example: TrainingExample) -> LeftOut:
        """Leave one demonstration of a task out."""
        task, size = self.statistics[number], self.library.n_observed_weights
        deviation = (example.weights - task.mean).ravel()[:size]
        own = observed_block(task.moments, size)
        _, rest = without_demonstration(self._pooled, own, deviation)
        mean, n = self.library.observed_mean[:-1].copy(), self.library.n_demonstrations.copy()
        mean[number] -= deviation / (task.n - 1)
        n[number] -= 1
        covariance = shared_covariance(rest, self._floor, self._strength)
        return self._left_out(covariance, self._departed, mean, n)

    def _without_group(self, name: str) -> LeftOut | None:
        """Leave out all demonstrations of a group; None if `without_group` cannot."""
        size = self.library.n_observed_weights
        kept = without_group(self.statistics, name)
        if kept is None:
            return None
        pooled = observed_block(pooled_moments(kept), size)
        mean = np.array([task.mean.ravel()[:size] for task in kept])
        n, examples = np.array([task.n for task in kept]), [task.examples for task in kept]
        covariance = covariance_of_strangers(examples, pooled, self._floor, self._strength)
        return self._left_out(covariance, self._departed, mean, n)

    def _left_out(
        self,
        covariance: Floats,
        departed: Sequence[Departure],
        mean: Floats | None = None,
        n: Integers | None = None,
        without: int | None = None,
    ) -> LeftOut:
        """`none` comes from all tasks but `without`; `mean` and `n` default to the library's."""
        library = self.library
        mean = library.observed_mean[:-1] if mean is None else mean
        n = library.n_demonstrations if n is None else n
        kept = np.array([k for k in range(library.n_tasks) if k != without])
        inflation = 1.0 + 1.0 / n[kept]
        means = mean[kept].reshape(len(kept), library.n_observed, -1)
        none = none_primitive(means, inflation[:, None, None] * covariance, departed)
        timing = none_timing(library.log_duration_mean[kept], library.log_duration_std[kept])
        return LeftOut(library, mean, covariance, n, none, timing)


def learn_left_out_odds(
    leaving_out: LeavingOut, recorded: Mapping[str, TaskStatistics]
) -> LeftOutOdds:
    """Largest odds against its own task while the robot may act, in each left-out demonstration.

    The library has all margins; `recorded` are statistics of the examples as they were recorded.
    """
    odds, groups = _of_left_out(leaving_out, recorded, largest_odds_against)
    return LeftOutOdds(tuple(odds), tuple(groups)) if len(odds) > 1 else NO_ODDS


def _of_left_out(
    leaving_out: LeavingOut,
    recorded: Mapping[str, TaskStatistics],
    largest: Callable[[TaskLibrary, int, TrainingExample], float],
) -> tuple[list[float], list[str]]:
    """`largest` of each left-out demonstration; the group left out with it, or "" if alone."""
    odds, groups = list[float](), list[str]()
    for k, example, as_recorded in paired_examples(leaving_out.tasks, recorded, MAX_FOLLOWED):
        several = leaving_out.library.n_tasks > 1
        without = leaving_out.unseen(k, example) if several else None
        if without is not None:
            odds.append(largest(without.as_library(), k, as_recorded))
            groups.append(example.group if leaving_out.group(example.group) else "")
    return odds, groups


def largest_odds_against(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds of the other tasks against the true one while `none` permits acting.

    The durations are as many as online. At least zero: nothing is acted on at even odds.
    """
    largest = 0.0
    for run in follow(library, recorded, make_prior_grid(library)):
        posterior = run.posterior(0)
        if posterior.probabilities[-1] <= MAX_NONE:
            known = (posterior.log_evidence + run.grid.log_task_prior)[:-1]
            others = np.logaddexp.reduce(np.delete(known, task))
            largest = max(largest, float(others - known[task]))
    return largest


def learn_switch_margin(leaving_out: LeavingOut, recorded: Mapping[str, TaskStatistics]) -> float:
    """Learn the evidence that a change to another task must overcome, in nats, zero or more.

    The arguments are those of `learn_left_out_odds`; the library's own switch margin is not used.
    """
    odds, _ = _of_left_out(leaving_out, recorded, largest_odds)
    # another task becomes more probable than the true one in one movement of twenty
    return max(conformal_bound(np.array(odds), 0.05), 0.0) if len(odds) > 1 else 0.0


def largest_odds(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds of other tasks that were born during a movement.

    They are at least `-NEGLIGIBLE`, since less probable hypotheses are pruned. The evidence is not
    raised to a power here as it is online (`filtering.posterior.counted_joint`), which makes the
    margin cautious.
    """
    largest = -NEGLIGIBLE
    library = replace(library, switch_margin=0.0)
    for run in follow(library, recorded, make_prior_grid(library, n_scales=N_SCALES)):
        assert run.births is not None
        left, born = run.births.onset_log_joint(run.log_evidence)[:-1], run.births.log_joint[:-1]
        others = np.logaddexp.reduce(np.delete(born, task))
        largest = max(largest, float(others - np.logaddexp.reduce(np.r_[left, born[task]])))
    return largest


def follow(
    library: TaskLibrary, recorded: TrainingExample, grid: PriorGrid
) -> Iterator[MovementFilter]:
    """Filter a movement; yield the filter after each sample."""
    run = MovementFilter(library, grid, 0, switching=True)
    stamps_ns = np.round(sample_phases() * recorded.duration_s * 1e9).astype(np.int64)
    for observation in observations_of(library.observed_groups, stamps_ns, recorded.observed):
        run.observe(observation)
        yield run
