# SPDX-License-Identifier: Apache-2.0
"""Changes of mind: hypotheses that are born while a movement is under way.

As in interacting multiple models (Blom and Bar-Shalom 1988), the task of a movement may change on
the way. What may happen, how often, and what a born hypothesis says of the hand is in `births`.
Here they are filtered, judged, and given up when they explain too little.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.births import (
    DELAYS,
    FADINGS,
    NewbornStates,
    birth_grid,
    fading,
    fading_velocity,
    log_pace,
    log_staying,
    shares,
)
from intent_recognition.filtering.filtered_weights import CourseWeights
from intent_recognition.filtering.hypotheses import N_SCALES, Hypotheses, make_hypotheses
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.gaussian import Gaussian, GaussianBatch, LinearMeasurement
from intent_recognition.promp import TaskLibrary

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


_BORN = np.dtype(
    [
        ("task", np.int64),
        ("kind", np.int64),  # number of what passes to it in `shares`
        ("seen", np.int64),  # observations since birth
        ("duration_s", np.float64),
        ("onset_s", np.float64),  # where its phase begins
        ("birth_s", np.float64),
        ("rate", np.float64),  # at which its offset fades [1/s]
        ("log_part", np.float64),  # of what passes to its kind
        ("log_joint", np.float64),
    ]
)
"""What is known of a born hypothesis beside its state."""


class SwitchedBelief(NamedTuple):
    """What born hypotheses make of a movement's task and timing; zero where there are none.

    Attributes:
        log_joint: log of prior and density of all observations, of the K tasks and none, (K + 1,).
        staying: log probability with which a task of the onset passed nothing on.
        duration_s: expected duration given the task, (K + 1,).
        task: number of the task of each hypothesis, (n,).
        weight: their probabilities given the task, (n,).
        begin_s: when the course of each began, after onset, (n,).
        course_s: how long it takes, (n,).
    """

    log_joint: NDArray[np.float64]
    staying: float
    duration_s: NDArray[np.float64]
    task: NDArray[np.int64]
    weight: NDArray[np.float64]
    begin_s: NDArray[np.float64]
    course_s: NDArray[np.float64]

    def phase(self, elapsed_s: float) -> NDArray[np.float64]:
        """Expected phase given the task, so long after onset, (K + 1,)."""
        phase = np.minimum(np.maximum((elapsed_s - self.begin_s) / self.course_s, 0.0), 1.0)
        expected = np.bincount(self.task, self.weight * phase, len(self.log_joint))
        return expected.astype(np.float64)


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
        self._grid = birth_grid(min(library.n_tasks, MAX_TASKS) + 1, n_scales)
        self._settling = SETTLING * len(library.observed_groups)
        self._births_every = BIRTHS_EVERY * len(library.observed_groups)
        shape = library.n_observed, self._width
        size = shape[0] * shape[1]
        fitting = MAX_FLOATS // (size * (size + 1 + shape[0]))
        self._n_kept = min(max(fitting, LEAST_HYPOTHESES), MAX_HYPOTHESES)
        n_born = len(self._grid.prior) + len(DELAYS) * len(FADINGS)
        room = self._n_kept + n_born * -(-SETTLING // BIRTHS_EVERY)
        self._state = np.full((room, size + size * (size + 1) // 2), 0.0)
        self._born = np.zeros(room, dtype=_BORN)
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
        born = self._born[: self._n]
        np.logaddexp.at(total, born["task"], born["log_joint"])
        return total

    @property
    def staying(self) -> float:
        """Log probability with which a task of the onset passed nothing on to tasks."""
        return log_staying(self.library, self._last_s / self._usual_s)

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

    def observe(
        self, measurement: Measurement, log_evidence: NDArray[np.float64], onset: RunningBank
    ) -> None:
        """Condition on a measurement; give birth to new hypotheses, and give up hopeless ones.

        Args:
            measurement: as the hypotheses of the onset took it.
            log_evidence: see `left`; this measurement is among the observations.
            onset: the hypotheses of the onset.
        """
        self._newborn.remember_start(measurement)
        self._last_s = max(measurement.elapsed_s, self._last_s)
        self._n_used += 1
        born = self._born[: self._n]
        density = self._condition(slice(0, self._n), measurement)
        born["seen"] += 1
        log_joint, judged = born["log_joint"], born["seen"] > self._settling
        log_joint[judged] += density[judged]
        total = np.logaddexp(self.log_joint, self.left(log_evidence))
        settled = born[born["seen"] == self._settling]
        if settled.size:
            passed = self._shares(total)[settled["kind"]] + settled["log_part"]
            log_joint[born["seen"] == self._settling] = passed
        self._forget(self._give_up(float(np.logaddexp.reduce(total))))
        if self._n_used % self._births_every == 0:
            self._give_birth(measurement, log_evidence, onset)

    def belief(self) -> SwitchedBelief:
        """What they make of task and timing."""
        total, born = self.log_joint, self._born[: self._n]
        some = born[np.isfinite(born["log_joint"])]
        task, onset_s, duration_s = some["task"], some["onset_s"], some["duration_s"]
        weight = np.exp(some["log_joint"] - total[task])
        expected_s = np.bincount(task, weight * (onset_s + duration_s), len(total))
        return SwitchedBelief(
            total, self.staying, expected_s.astype(np.float64), task, weight, onset_s, duration_s
        )

    def of_task(self, task: int) -> tuple[CourseWeights, NDArray[np.float64], NDArray[np.float64]]:
        """A task's n born hypotheses: weights without offsets, durations, probabilities, (n,).

        A duration reaches from the movement's onset to its end.
        """
        born = self._born[: self._n]
        log_joint = np.where(born["task"] == task, born["log_joint"], -np.inf)
        weight = np.exp(log_joint - np.max(log_joint))
        index = np.flatnonzero(weight > NEGLIGIBLE_SHARE)
        some = born[index]
        until_s = some["onset_s"] + some["duration_s"]
        return self._courses(index), until_s, weight[index] / weight[index].sum()

    def _courses(self, index: NDArray[np.int64]) -> CourseWeights:
        """The courses of some of them, without their offsets."""
        own = self._width * np.arange(self.library.n_observed)[:, None]
        own = (own + np.arange(self.library.basis.n_basis)).ravel()
        return CourseWeights(
            GaussianBatch(self._state[index], self._width), own, self._born["log_joint"][index]
        )

    def _shares(self, total: NDArray[np.float64]) -> NDArray[np.float64]:
        """What passes to the hypotheses of the last birth."""
        return shares(
            total,
            self._log_task_prior,
            self._between_births_s / self._usual_s,
            none_margin=self._hypotheses.none_margin,
            switch_margin=self.library.switch_margin,
        )

    def _condition(self, some: slice, measurement: Measurement) -> NDArray[np.float64]:
        """Condition some hypotheses: log density of the measurement, (n,)."""
        linear = LinearMeasurement(
            measurement.dofs,
            self._rows(measurement, self._born[some])[:, None],
            measurement.values,
            measurement.noise_covariance,
            degrees_of_freedom=self.library.evidence_freedom,
        )
        return GaussianBatch(self._state[some], self._width).condition(linear)[0]

    def _give_birth(
        self, measurement: Measurement, log_evidence: NDArray[np.float64], onset: RunningBank
    ) -> None:
        """Add newborn hypotheses, and condition them on the measurement of their birth."""
        first = self._n
        self._bear(measurement.elapsed_s, log_evidence)
        new = slice(first, self._n)
        self._condition(new, measurement)
        self._born["seen"][new] += 1
        self._bear_held_up(measurement.elapsed_s, log_evidence, onset)

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
        born = self._add(self._newborn.states(tasks)[prior], birth_s)
        task = tasks[prior // len(FADINGS)]
        pace = log_pace(self._hypotheses, log_evidence, offsets) - np.log(len(FADINGS))
        born["task"] = born["kind"] = task
        born["onset_s"] = np.where(task == n_tasks, birth_s, 0.0)
        born["duration_s"] = np.exp(self._log_mean[task] + self._log_std[task] * offsets[duration])
        born["rate"] = rate / self._usual_s
        born["log_part"] = pace[(task == n_tasks).astype(np.int64), duration]

    def _bear_held_up(
        self, birth_s: float, log_evidence: NDArray[np.float64], onset: RunningBank
    ) -> None:
        """Add copies of the most probable hypothesis of a known task, set back in time."""
        n_tasks, n_scales = self.library.n_tasks, self._hypotheses.n_scales
        joint = (self._hypotheses.log_prior + log_evidence)[: n_tasks * n_scales] + self.staying
        born = self._born[: self._n]
        of_born = np.where(born["task"] < n_tasks, born["log_joint"], -np.inf)
        first, best = int(np.argmax(joint)), int(np.argmax(of_born))
        if of_born[best] > joint[first]:
            task, onset_s, duration_s = born[["task", "onset_s", "duration_s"]][best]
            courses = self._courses(np.array([best]))
            mean, covariance = courses.mean, courses.covariance
        else:
            task, onset_s = first // n_scales, 0.0
            duration_s = self._hypotheses.duration_s[first]
            mean, covariance = onset.distributions(np.array([first]))
        delay, rate = np.divmod(np.arange(len(DELAYS) * len(FADINGS)), len(FADINGS))
        states = self._newborn.held_up(Gaussian(mean[0], covariance[0]))
        born = self._add(states[rate], birth_s)
        born["task"], born["kind"] = task, n_tasks + 1 + task
        born["onset_s"] = onset_s + np.array(DELAYS)[delay] * self._usual_s
        born["duration_s"], born["rate"] = duration_s, np.array(FADINGS)[rate] / self._usual_s
        born["log_part"] = -np.log(len(delay))

    def _add(self, states: NDArray[np.float64], birth_s: float) -> NDArray[np.void]:
        """Add newborn hypotheses; returns what is to be filled in of them."""
        new = slice(self._n, self._n + len(states))
        self._state[new] = states
        self._n = new.stop
        born = self._born[new]
        born["seen"], born["birth_s"], born["log_joint"] = 0, birth_s, -np.inf
        return born

    def _rows(self, measurement: Measurement, born: NDArray[np.void]) -> NDArray[np.float64]:
        """Row of the observation matrix of some hypotheses, (n, N + 3)."""
        basis, duration_s, rate = self.library.basis, born["duration_s"], born["rate"]
        since_s = measurement.elapsed_s - born["birth_s"]
        into_s = measurement.elapsed_s - born["onset_s"]
        phase = np.clip(into_s / duration_s, 0.0, 1.0)
        course, offset = basis.design_matrix(phase), fading(since_s, rate)
        if measurement.derivative:
            moving = into_s <= duration_s
            course = basis.derivative_matrix(phase) * (moving / duration_s)[:, None]
            offset = fading_velocity(since_s, rate)
        return np.concatenate([course, offset], axis=1)

    def _give_up(self, total: float) -> NDArray[np.bool_]:
        """Give up what explains far less than all together, and the worst of too many: which."""
        born = self._born[: self._n]
        settled = born["seen"] >= self._settling
        is_none = born["task"] == self.library.n_tasks
        log_joint = born["log_joint"] + self._hypotheses.none_margin * is_none
        hopeless = settled & (log_joint < total - NEGLIGIBLE)
        kept = np.flatnonzero(settled & ~hopeless)
        if len(kept) > self._n_kept:
            worst = np.argpartition(log_joint[kept], -self._n_kept)[: -self._n_kept]
            hopeless[kept[worst]] = True
        born["log_joint"][hopeless] = -np.inf
        return hopeless

    def _forget(self, hopeless: NDArray[np.bool_]) -> None:
        """Use the memory of hypotheses that were given up for the last of the others."""
        self._n = len(hopeless) - int(np.count_nonzero(hopeless))
        free = np.flatnonzero(hopeless[: self._n])
        moved = self._n + np.flatnonzero(~hopeless[self._n :])
        for array in (self._state, self._born):
            array[free] = array[moved]
