# SPDX-License-Identifier: Apache-2.0
"""Changes of mind: hypotheses that are born while a movement is under way.

As in interacting multiple models (Blom and Bar-Shalom 1988), the task of a movement may change on
the way, at a rate that is relative to how long the tasks usually take. What a born hypothesis says
of the hand is in `newborn`; the rate at which its offset fades is on a grid, as the duration is.

A born hypothesis takes its share of what all hypotheses are worth at its birth: a new task from all
others, and the old task again, for a hesitation or a detour on its way. Its pace, the duration in
standard deviations of the task's, is as probable as the pace of the movement so far. What is none
of the tasks begins at its birth, wherever the hand is. The hypotheses that were there from the
onset pay for what they pass on.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.hypotheses import (
    N_SCALES,
    Hypotheses,
    duration_offsets,
    make_hypotheses,
)
from intent_recognition.filtering.newborn import (
    FADINGS,
    NewbornStates,
    fading,
    fading_velocity,
)
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.switched_belief import CourseWeights, SwitchedBelief
from intent_recognition.gaussian import GaussianBatch, pending_shape, state_width
from intent_recognition.promp import TaskLibrary

SWITCHES = 0.04
"""Rate at which a person turns to another task, per usual duration of the tasks
(docs/decisions/change_of_mind.md)."""
DETOURS = 0.12
"""Rate at which a person goes on with the same task in another way, likewise."""
STRAYS = 0.3
"""Rate at which a known movement becomes one of no task, likewise; its evidence counts beyond the
library's margin only."""
N_DURATIONS = 7
"""Durations per task at each birth. Convention: offsets make up for what lies between."""
BIRTHS_EVERY = 2
"""Used observations of each signal between births (docs/decisions/change_of_mind.md)."""
SETTLING = 2
"""Observations of each signal that a newborn hypothesis takes its offset and velocity from, and is
not judged by."""
NEGLIGIBLE = 14.0
"""Nats below all others together at which a born hypothesis is given up
(docs/decisions/change_of_mind.md)."""
MAX_HYPOTHESES, LEAST_HYPOTHESES = 150, 60
"""Born hypotheses kept, newborn ones aside; and of many DOFs at least
(docs/decisions/change_of_mind.md)."""
MAX_FLOATS = 1_500_000
"""Numbers in the states of those that are kept. Convention: 12 MB, and the time of an observation.
"""
MAX_TASKS = 8
"""Tasks that hypotheses are born of at a time, the most probable ones. Convention: likewise."""
NEGLIGIBLE_SHARE = 1e-4
"""Probability, as a share of the most probable one's, below which a born hypothesis is left out of
a prediction. Convention."""


class _Grid(NamedTuple):
    """What is born at a time: tasks by rates by durations, n hypotheses.

    Attributes:
        prior: number of the task among those that are born of, times the rates, and of the rate.
        duration: number of the duration.
        rate: at which the offset of the hand fades, per usual duration.
        offsets: of the durations, in standard deviations of their logarithm, (S',).
    """

    prior: NDArray[np.int64]
    duration: NDArray[np.int64]
    rate: NDArray[np.float64]
    offsets: NDArray[np.float64]


class SwitchedHypotheses:
    """The born hypotheses of one movement after the other, in memory that is used again.

    Args:
        library: the learned tasks.
        n_scales: durations per task of the hypotheses of the onset.
    """

    def __init__(self, library: TaskLibrary, n_scales: int = N_SCALES):
        self.library = library
        self._newborn = NewbornStates(library)
        self._width, self._usual_s = self._newborn.width, self._newborn.usual_s
        self._grid = _grid(min(library.n_tasks, MAX_TASKS) + 1, min(n_scales, N_DURATIONS))
        self._settling = SETTLING * len(library.observed_groups)
        self._births_every = BIRTHS_EVERY * len(library.observed_groups)
        shape = library.n_observed, self._width
        fitting = MAX_FLOATS // (shape[0] * shape[1] * state_width(*shape))
        self._n_kept = min(max(fitting, LEAST_HYPOTHESES), MAX_HYPOTHESES)
        room = self._n_kept + len(self._grid.prior) * -(-SETTLING // BIRTHS_EVERY)
        self._state = np.zeros((room, shape[0] * shape[1], state_width(*shape)))
        self._pending = np.zeros((room, *pending_shape(*shape)))
        self._task, self._seen, self._duration = np.zeros((3, room), dtype=np.int64)
        self._duration_s, self._rate, self._birth_s, self._onset_s = np.zeros((4, room))
        self._log_joint = np.zeros(room)
        self._log_mean = np.r_[library.log_duration_mean, library.none_log_duration[0]]
        self._log_std = np.r_[library.log_duration_std, library.none_log_duration[1]]
        self.start(make_hypotheses(library, n_scales=n_scales))

    def start(self, hypotheses: Hypotheses) -> None:
        """Begin with a movement: nothing is born yet.

        Args:
            hypotheses: those of the onset.
        """
        self._hypotheses = hypotheses
        known = hypotheses.log_task_prior[:-1]
        self._log_task_prior = known - np.logaddexp.reduce(known)
        self._n = 0
        self._batch = self._batch_of(0, 0)
        self._due: list[Callable[[], object]] = []
        self._newborn.start()
        self._last_s, self._n_used = 0.0, 0
        self._last_birth_s, self._between_births_s = 0.0, 0.0

    @property
    def n_hypotheses(self) -> int:
        """How many there are."""
        return self._n

    @property
    def log_joint(self) -> NDArray[np.float64]:
        """Log of prior and density of all observations, of the K tasks and none, (K + 1,)."""
        total = np.full(self.library.n_tasks + 1, -np.inf)
        np.logaddexp.at(total, self._task[: self._n], self._log_joint[: self._n])
        return total

    @property
    def staying(self) -> float:
        """Log probability with which a task of the onset passed nothing on to tasks."""
        rate = SWITCHES * np.exp(-self.library.switch_margin) + DETOURS
        return float(-rate * self._last_s / self._usual_s)

    def left(self, log_evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log joint of the hypotheses of the onset less what they passed on, (K + 1,).

        What was none of the tasks from the onset stays so.

        Args:
            log_evidence: log density of all observations under them, (B,).
        """
        joint = self._hypotheses.log_prior + log_evidence
        left = np.logaddexp.reduce(joint.reshape(-1, self._hypotheses.n_scales), axis=1)
        left[:-1] += self.staying
        return left

    def observe(self, measurement: Measurement, log_evidence: NDArray[np.float64]) -> None:
        """Condition on a measurement; give birth to new hypotheses, and give up hopeless ones.

        Births and what else no estimate needs before the next measurement are left to `catch_up`.

        Args:
            measurement: as the hypotheses of the onset took it.
            log_evidence: see `left`; this measurement is among the observations.
        """
        while self._due:
            self._due.pop(0)()
        self._newborn.remember_start(measurement)
        self._last_s = max(measurement.elapsed_s, self._last_s)
        self._n_used += 1
        density = self._condition(self._batch, measurement, slice(0, self._n))
        seen, log_joint = self._seen[: self._n], self._log_joint[: self._n]
        seen += 1
        log_joint[seen > self._settling] += density[seen > self._settling]
        total = np.logaddexp(self.log_joint, self.left(log_evidence))
        settled = np.flatnonzero(seen == self._settling)
        if settled.size:
            share = self._shares(total)
            task, pace = self._task[settled], self._log_pace(log_evidence)
            which = (task == self.library.n_tasks).astype(np.int64)
            log_joint[settled] = share[task] + pace[which, self._duration[settled]]
        self._due.append(partial(self._forget, self._give_up(float(np.logaddexp.reduce(total)))))
        if self._n_used % self._births_every == 0:
            self._due.append(partial(self._give_birth, measurement, log_evidence))

    def catch_up(self) -> bool:
        """Do a part of what is due before the next measurement; whether there was something to do.

        It makes no difference to what they say, only to when the time is spent.
        """
        if self._due:
            self._due.pop(0)()
            return True
        return self._batch.catch_up()

    def belief(self) -> SwitchedBelief:
        """What they make of task and timing."""
        total = self.log_joint
        some = np.flatnonzero(np.isfinite(self._log_joint[: self._n]))
        task, duration_s, onset_s = self._task[some], self._duration_s[some], self._onset_s[some]
        weight = np.exp(self._log_joint[some] - total[task])
        expected_s = np.bincount(task, weight * (onset_s + duration_s), len(total))
        return SwitchedBelief(
            total, self.staying, expected_s.astype(np.float64), task, weight, onset_s, duration_s
        )

    def of_task(self, task: int) -> tuple[CourseWeights, NDArray[np.float64], NDArray[np.float64]]:
        """A task's n born hypotheses: weights without offsets, durations, probabilities, (n,)."""
        log_joint = np.where(self._task[: self._n] == task, self._log_joint[: self._n], -np.inf)
        weight = np.exp(log_joint - np.max(log_joint))
        index = np.flatnonzero(weight > NEGLIGIBLE_SHARE)
        own = self._width * np.arange(self.library.n_observed)[:, None]
        own = (own + np.arange(self.library.basis.n_basis)).ravel()
        courses = CourseWeights(self._batch.part(index), own, self._log_joint[index])
        return courses, self._duration_s[index], weight[index] / weight[index].sum()

    def _shares(self, total: NDArray[np.float64]) -> NDArray[np.float64]:
        """What passes to the hypotheses of the last birth."""
        return shares(
            total,
            self._log_task_prior,
            self._between_births_s / self._usual_s,
            none_margin=self._hypotheses.none_margin,
            switch_margin=self.library.switch_margin,
        )

    def _batch_of(self, n: int, n_pending: int) -> GaussianBatch:
        return GaussianBatch(self._state[:n], self._width, self._pending[:n], n_pending)

    def _log_pace(self, log_evidence: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log probability of duration and rate of newborn hypotheses of a task, and of none."""
        offsets, hypotheses = self._grid.offsets, self._hypotheses
        at, log_prior = duration_offsets(hypotheses.n_scales)
        joint = (hypotheses.log_prior + log_evidence).reshape(-1, len(at))[:-1]
        own = np.logaddexp.reduce(joint, axis=1)
        tempered = log_prior + hypotheses.duration_evidence * log_evidence.reshape(-1, len(at))[:-1]
        tempered -= np.logaddexp.reduce(tempered, axis=1, keepdims=True)
        so_far = np.logaddexp.reduce(tempered + (own - np.logaddexp.reduce(own))[:, None], axis=0)
        table = np.array([np.interp(offsets, at, row) for row in (so_far, log_prior)])
        table -= np.logaddexp.reduce(table, axis=1, keepdims=True)
        return np.asarray(table - np.log(len(FADINGS)), dtype=np.float64)

    def _condition(
        self, batch: GaussianBatch, measurement: Measurement, some: slice
    ) -> NDArray[np.float64]:
        """Condition some hypotheses, those of a batch: log density of the measurement, (n,)."""
        return batch.condition(
            measurement.dofs,
            self._rows(measurement, some)[:, None],
            measurement.values,
            measurement.noise_covariance,
            self.library.evidence_freedom,
        )

    def _give_birth(self, measurement: Measurement, log_evidence: NDArray[np.float64]) -> None:
        """Add newborn hypotheses, and condition them on the measurement of their birth."""
        first = self._n
        self._bear(measurement.elapsed_s, log_evidence)
        born, n_pending = slice(first, self._n), self._batch.n_pending - len(measurement.dofs)
        state, pending = self._state[born], self._pending[born]
        newborn = GaussianBatch(state, self._width, pending, n_pending)
        self._condition(newborn, measurement, born)
        self._seen[born] += 1

    def _bear(self, birth_s: float, log_evidence: NDArray[np.float64]) -> None:
        """Add newborn hypotheses of the most probable tasks, and of none."""
        self._between_births_s = max(birth_s - self._last_birth_s, 0.0)
        self._last_birth_s = max(birth_s, self._last_birth_s)
        n_tasks = self.library.n_tasks
        tasks = np.arange(n_tasks)
        if n_tasks > MAX_TASKS:
            known = np.logaddexp(self.log_joint, self.left(log_evidence))[:-1]
            tasks = np.sort(np.argpartition(known, -MAX_TASKS)[-MAX_TASKS:])
        tasks = np.r_[tasks, n_tasks]
        prior, duration, rate, offsets = self._grid
        born = slice(self._n, self._n + len(prior))
        self._state[born] = self._newborn.states(tasks)[prior]
        self._pending[born] = 0.0  # what is pending for the others is nothing to these
        task = tasks[prior // len(FADINGS)]
        self._task[born], self._seen[born], self._birth_s[born] = task, 0, birth_s
        self._onset_s[born] = np.where(task == n_tasks, birth_s, 0.0)
        log_duration = self._log_mean[task] + self._log_std[task] * offsets[duration]
        self._duration[born], self._duration_s[born] = duration, np.exp(log_duration)
        self._rate[born], self._log_joint[born] = rate / self._usual_s, -np.inf
        self._n = born.stop
        self._batch = self._batch_of(self._n, self._batch.n_pending)

    def _rows(self, measurement: Measurement, some: slice) -> NDArray[np.float64]:
        """Row of the observation matrix of some hypotheses, (n, N + 3)."""
        basis = self.library.basis
        duration_s, since_s = self._duration_s[some], measurement.elapsed_s - self._birth_s[some]
        into_s = measurement.elapsed_s - self._onset_s[some]
        phase = np.clip(into_s / duration_s, 0.0, 1.0)
        course, offset = basis.design_matrix(phase), fading(since_s, self._rate[some])
        if measurement.derivative:
            moving = into_s <= duration_s
            course = basis.derivative_matrix(phase) * (moving / duration_s)[:, None]
            offset = fading_velocity(since_s, self._rate[some])
        return np.concatenate([course, offset], axis=1)

    def _give_up(self, total: float) -> NDArray[np.bool_]:
        """Give up what explains far less than all together, and the worst of too many: which."""
        n = self._n
        log_joint = self._log_joint[:n]
        settled = self._seen[:n] >= self._settling
        is_none = self._task[:n] == self.library.n_tasks
        log_joint = log_joint + self._hypotheses.none_margin * is_none
        hopeless = settled & (log_joint < total - NEGLIGIBLE)
        kept = np.flatnonzero(settled & ~hopeless)
        if len(kept) > self._n_kept:
            worst = np.argpartition(log_joint[kept], -self._n_kept)[: -self._n_kept]
            hopeless[kept[worst]] = True
        self._log_joint[:n][hopeless] = -np.inf
        return hopeless

    def _forget(self, hopeless: NDArray[np.bool_]) -> None:
        """Use the memory of hypotheses that were given up for the last of the others."""
        self._n = len(hopeless) - int(np.count_nonzero(hopeless))
        free = np.flatnonzero(hopeless[: self._n])
        moved = self._n + np.flatnonzero(~hopeless[self._n :])
        for array in (
            self._state,
            self._pending,
            self._task,
            self._seen,
            self._duration_s,
            self._rate,
            self._birth_s,
            self._onset_s,
            self._duration,
            self._log_joint,
        ):
            array[free] = array[moved]
        self._batch = self._batch_of(self._n, self._batch.n_pending)


def _grid(n_tasks: int, n_durations: int) -> _Grid:
    """What is born of so many tasks, none among them."""
    offsets, _ = duration_offsets(n_durations)
    n_rates = len(FADINGS)
    prior, duration = np.divmod(np.arange(n_tasks * n_rates * n_durations), n_durations)
    return _Grid(prior, duration, np.array(FADINGS)[prior % n_rates], offsets)


def shares(
    total: NDArray[np.float64],
    log_prior: NDArray[np.float64],
    passed: float,
    *,
    none_margin: float = 0.0,
    switch_margin: float = 0.0,
) -> NDArray[np.float64]:
    """Log of what passes to newborn hypotheses of each task and none in a time, (K + 1,).

    Args:
        total: log joint of the tasks and none, everything together, (K + 1,).
        log_prior: of the tasks, (K,).
        passed: the time, in usual durations.
        none_margin: evidence that a known task must have over none before it counts, in nats.
        switch_margin: evidence that another task must have over the old one, likewise.
    """
    known, n_tasks = total[:-1], len(total) - 1
    everything = np.logaddexp.reduce(known)
    with np.errstate(divide="ignore"):
        others = everything + np.log(-np.expm1(np.minimum(known - everything, 0.0)))
        turning = others + log_prior + np.log(SWITCHES * n_tasks / max(n_tasks - 1, 1))
        own = np.logaddexp(known + np.log(DETOURS), turning - switch_margin)
        return np.r_[own, everything + np.log(STRAYS) - none_margin] + np.log(passed)
