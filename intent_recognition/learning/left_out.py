# SPDX-License-Identifier: Apache-2.0
"""Remove demonstrations from a library without learning it again.

The result follows from the tasks' statistics. Hyperparameters, the timing of the tasks and the
phase deviations stay those of all demonstrations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.examples import TrainingExample
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
    Scatter,
    TaskLibrary,
    observed_block,
    shared_covariance,
    without_demonstration,
)


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
    """Leave demonstrations out of a library."""

    def __init__(self, library: TaskLibrary, tasks: Mapping[str, TaskStatistics]):
        self.library, self.tasks = library, tasks
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
        covariance = covariance_of_strangers(examples, rest, floor, STRENGTH)
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
        covariance = shared_covariance(rest, self._floor, STRENGTH)
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
        covariance = covariance_of_strangers(examples, pooled, self._floor, STRENGTH)
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
