# SPDX-License-Identifier: Apache-2.0
"""Hypotheses that are born while a movement is under way: changes of mind, detours, delays.

As in interacting multiple models (Blom and Bar-Shalom 1988), a person may change the course on the
way. Rates are per usual duration of the tasks. A newborn hypothesis receives a share of the
probability of existing ones: a turn to another task from all other tasks, a detour from its own
task. Its pace (the duration in standard deviations of its task's) is as probable as that pace is
for the movement so far. An unknown movement begins at its birth, wherever the hand is. What is
passed on is taken from the hypotheses of the onset.

A hypothesis born at a time t follows the course w that its task would have had from the movement's
start, plus an offset that begins where the hand is at t and fades:

    y(t + s) = psi(z) w + (a (1 + r s) + b s + c s^2 / 2) exp(-r s) + noise.

The offset is a critically damped spring of rate r: a and b are its position and velocity at birth,
c is an initial push that fades at the same rate. a, b and c are weights beside w, so the same
Gaussian update filters them (Maeda et al. 2014, Eq. 6).

A person who turns to another task may also begin a new reach, with duration T, from the present
position of the hand:

    y(t + s) = psi(s / T) w + h(s / R) (a, b R, c R^2),

where h are the quintics of least jerk. The offset ends at rest after R, the part of T in which the
mean course moves.

After a delay a person continues the same movement. Such a hypothesis is a copy of the most probable
one, with its weights as filtered so far and its clock set back; a small offset absorbs the step.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.filtering.grid import PriorGrid, duration_offsets, log_durations
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.prediction import NEGLIGIBLE_SHARE
from intent_recognition.filtering.rates import (
    AFRESH,
    DELAY,
    REACH_UNTIL,
    TURN,
    birth_shares,
    log_stay,
    moving_parts,
)
from intent_recognition.filtering.table import OFFSET_BASIS, HypothesisTable
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement, log_sum
from intent_recognition.promp import TaskLibrary

REACH_PART = 0.87
"""Duration of a new reach relative to its task's: shorter, with a shorter way and no rest."""
REACH_OFFSETS = np.array([-1.0, 0.0, 1.0])
"""Durations of new reaches, in standard deviations of the task's log duration from its mean."""
REACH_SCALE = np.array([1.0, 2.0, 4.0])
"""Prior standard deviations of a, b T and c T^2 of a reach, relative to that of the offset a, for
the usual duration T of the tasks: as in movements of least jerk."""
DELAYS = (0.05, 0.12, 0.25)
"""Lengths of a delay, in usual durations of the tasks (docs/decisions/change_of_mind.md)."""
START_UNTIL = 0.1
"""Time after the first measurement, in usual durations of the tasks, up to which a DOF's first
position is taken for where the movement began: a reach of least jerk has passed 1 % of its way."""
N_DURATIONS = 7
"""Durations per task at each birth; offsets make up for durations in between."""
FADINGS = (12.0, 30.0)
"""Rates at which an offset fades, per usual duration of the tasks: gone after two fifths and a
sixth of it (docs/decisions/change_of_mind.md)."""
PUSH = 0.5
"""Prior standard deviation of the push c, relative to that of the offset a times r^2."""
BIRTHS_EVERY = 2
"""Number of used observations per signal from one birth to the next
(docs/decisions/change_of_mind.md)."""
SETTLING = 2
"""Observations per signal that initialise a newborn hypothesis' offset and its velocity; they do
not count as evidence."""
NEGLIGIBLE = 14.0
"""Nats below the sum of all hypotheses at which a born hypothesis is pruned
(docs/decisions/change_of_mind.md)."""
MAX_HYPOTHESES, LEAST_HYPOTHESES = 150, 60
"""Largest number of born hypotheses, not counting newborn ones; and its lower limit where many DOFs
reduce it (docs/decisions/change_of_mind.md)."""
MAX_FLOATS = 1_500_000
"""Size of all born hypotheses' covariances, in numbers, above which fewer are kept: bounds the time
per observation."""
MAX_TASKS = 8
"""Largest number of tasks per birth, the most probable ones; bounds the time per observation."""


class Births:
    """The born hypotheses of a movement; the memory is reused for the next movement.

    Args:
        library: the learned tasks.
        grid: prior grid of the hypotheses of the onset.
        prior: prior of the observed weights under each task and none.

    Attributes:
        usual_s: geometric mean of the tasks' median durations [s].
        table: table of the born hypotheses.
    """

    def __init__(self, library: TaskLibrary, grid: PriorGrid, prior: GaussianBatch):
        self._library, self._grid, self._prior = library, grid, prior
        n_dofs, n_signals = library.n_observed, len(library.observed_groups)
        self.usual_s = float(np.exp(np.mean(library.log_duration_mean)))
        self._rates = np.array(FADINGS) / self.usual_s
        self._offsets, _ = duration_offsets(min(grid.n_scales, N_DURATIONS))
        self._settling, self._every = SETTLING * n_signals, BIRTHS_EVERY * n_signals
        self._width = library.basis.n_basis + OFFSET_BASIS
        size, n_tasks = n_dofs * self._width, min(library.n_tasks, MAX_TASKS)
        fitting = MAX_FLOATS // (size * (size + 1 + n_dofs))
        self._n_kept = min(max(fitting, LEAST_HYPOTHESES), MAX_HYPOTHESES)
        n_born = ((n_tasks + 1) * len(self._offsets) + len(DELAYS)) * len(FADINGS)
        n_born += n_tasks * len(REACH_OFFSETS)
        room = self._n_kept + n_born * -(-SETTLING // BIRTHS_EVERY)
        self.table = HypothesisTable(room, library, self._settling)
        none_variance = np.diag(library.none_covariance).reshape(n_dofs, -1)
        std, powers = np.sqrt(none_variance.mean(axis=1))[:, None], np.arange(OFFSET_BASIS)
        self._fading = (std * self._rates[:, None, None] ** powers * [1.0, 1.0, PUSH]) ** 2
        self._ending = (std * REACH_SCALE / self.usual_s**powers)[None] ** 2
        self._log_mean, self._log_std = log_durations(library)
        self._moving = moving_parts(library, std[:, 0])
        known = grid.log_task_prior[:-1]
        self._log_prior = known - np.logaddexp.reduce(known)

    def clear(self, log_weight: Floats) -> None:
        """Remove all born hypotheses: another movement begins. Call it before `observe`.

        Args:
            log_weight: log of the factors by which the posterior of the known tasks will be
                multiplied, (K,). A hypothesis that turns keeps the factor of its first task.
        """
        self.table.clear()
        # Finite, because the difference of two infinite ones would be NaN.
        self._log_weight = np.append(np.maximum(log_weight, -700.0), 0.0)
        self._first: list[tuple[NDArray, NDArray, NDArray]] = []  # DOFs, values and noise
        self._tasks: Integers | None = None  # those of `_newborn`; None if they have to be made
        self._newborn: list[tuple[Floats, Floats, dict[str, Any]]] = []
        self._n_used, self._first_s, self._last_s = 0, np.inf, 0.0
        self._last_birth_s, self._between_s = 0.0, 0.0

    @property
    def log_joint(self) -> Floats:
        """Log joint of the born hypotheses of each task and of none, (K + 1,)."""
        total = np.full(self._library.n_tasks + 1, -np.inf)
        np.logaddexp.at(total, self.table.rows["task"], self.table.log_joint)
        return total

    @property
    def log_stay(self) -> float:
        """Log of the share of a task's probability left to its hypotheses of the onset."""
        return log_stay(self._last_s / self.usual_s, self._library.switch_margin)

    def onset_log_joint(self, log_evidence: Floats) -> Floats:
        """Log joint of the hypotheses of the onset, less what they passed on, (K + 1,).

        A movement that was unknown from the onset stays unknown.

        Args:
            log_evidence: log density of all observations under each of them, (B,).
        """
        left = self._grid.log_task_joint(log_evidence)
        left[:-1] += self.log_stay
        return left

    def observe(
        self, measurement: Measurement, onset: HypothesisTable, log_evidence: Floats
    ) -> None:
        """Condition on a measurement, prune, and give birth to new hypotheses.

        Args:
            measurement: the measurement on which `onset` was conditioned last.
            onset: the hypotheses of the onset.
            log_evidence: as for `onset_log_joint`, with this measurement included.
        """
        self._remember_start(measurement)
        now_s, table = measurement.elapsed_s, self.table
        self._last_s = max(now_s, self._last_s)
        self._n_used += 1
        if table.n:
            table.condition(measurement)
        left = self.onset_log_joint(log_evidence)
        total = np.logaddexp(self.log_joint, left)
        self._settle(total)
        table.drop(self._hopeless(float(np.logaddexp.reduce(total))))
        if self._n_used % self._every == 0:
            self._between_s = max(now_s - self._last_birth_s, 0.0)
            self._last_birth_s = max(now_s, self._last_birth_s)
            first = table.n
            self._give_birth(now_s, log_evidence, left)
            table.condition(measurement, np.arange(first, table.n))
            self._give_birth_to_delays(now_s, log_evidence, onset)

    def outweighs(self, task: int, log_evidence: Floats) -> bool:
        """Whether a task's born hypotheses are together more probable than those of the onset."""
        return bool(self.log_joint[task] > self.onset_log_joint(log_evidence)[task])

    def of_task(self, task: int) -> tuple[Integers, Floats]:
        """Rows of a task's born hypotheses, except negligible ones; their probabilities, (n,)."""
        joint = np.where(self.table.rows["task"] == task, self.table.log_joint, -np.inf)
        weight = np.exp(joint - np.max(joint))
        index = np.flatnonzero(weight > NEGLIGIBLE_SHARE)
        return index, weight[index] / weight[index].sum()

    def _settle(self, total: Floats) -> None:
        """Give hypotheses that have just settled a prior: a share of the log joint, (K + 1,)."""
        rows = self.table.rows
        settled = np.flatnonzero(rows["seen"] == self._settling)
        if len(settled):
            shares = birth_shares(
                total + self._log_weight,
                self._log_prior,
                self._between_s / self.usual_s,
                none_margin=self._grid.none_margin,
                switch_margin=self._library.switch_margin,
            )
            kind, task, share = (rows[name][settled] for name in ("kind", "task", "log_share"))
            passed = shares[kind, task] + share - self._log_weight[task]
            rows["log_prior"][settled] = passed
            rows["log_birth"][settled] = passed - np.logaddexp.reduce(total[:-1])

    def _hopeless(self, total: float) -> Flags:
        """Hypotheses to prune, (n,): negligible ones, and the least probable of too many."""
        rows, joint = self.table.rows, self.table.log_joint
        settled = rows["seen"] >= self._settling
        joint += self._grid.none_margin * (rows["task"] == self._library.n_tasks)
        hopeless = settled & (joint < total - NEGLIGIBLE)
        kept = np.flatnonzero(settled & ~hopeless)
        if len(kept) > self._n_kept:
            hopeless[kept[np.argsort(joint[kept])[: -self._n_kept]]] = True
        return hopeless

    def _give_birth(self, birth_s: float, log_evidence: Floats, left: Floats) -> None:
        """Add turns to the most probable tasks and to none, and new reaches of these tasks.

        New reaches and unknown movements begin at their birth.
        """
        n_tasks, grid = self._library.n_tasks, self._grid
        tasks = np.arange(n_tasks)
        if n_tasks > MAX_TASKS:
            joint = np.logaddexp(self.log_joint, left)[:-1]
            tasks = np.sort(np.argsort(joint)[-MAX_TASKS:])
        if self._tasks is None or not np.array_equal(tasks, self._tasks):
            self._tasks, self._newborn = tasks, self._make_newborn(tasks)
        at, log_prior = duration_offsets(grid.n_scales)
        of_tasks = log_prior + grid.duration_evidence * log_evidence.reshape(-1, len(at))[:-1]
        so_far = log_sum((of_tasks + (left[:-1] - log_sum(of_tasks))[:, None]).T)
        for state, offset, columns in self._newborn:
            is_none, afresh = columns["task"] == n_tasks, columns["kind"] == AFRESH
            if afresh and birth_s > REACH_UNTIL * self.usual_s:
                break
            pace = [np.interp(offset, at, log_p) for log_p in (log_prior, so_far)]
            share = np.where(is_none, *pace).reshape(len(state), -1)
            share -= log_sum(share)[:, None] + (0.0 if afresh else np.log(len(FADINGS)))
            self.table.add(
                state,
                share.shape[1],
                **columns,
                onset_s=np.where(is_none | afresh, birth_s, 0.0),
                birth_s=birth_s,
                log_share=share.ravel(),
            )

    def _make_newborn(self, tasks: Integers) -> list[tuple[Floats, Floats, dict[str, Any]]]:
        """Newborn turns to some tasks and to none, and newborn reaches of the tasks.

        Courses of known tasks are conditioned on where the movement began. All this stays the same
        from birth to birth once each DOF's start is known.

        Returns:
            For each kind, the states, the durations in standard deviations of log duration, and
            the columns of `HypothesisTable` that do not depend on the time of birth.
        """
        basis, known, found = self._library.basis, np.arange(len(tasks)), []
        tasks = np.append(tasks, self._library.n_tasks)
        courses = self._prior.resized(tasks, basis.n_basis)
        start = basis.design_matrix(np.zeros((len(known), 1)))
        for dofs, values, noise in self._first:
            courses.condition(LinearMeasurement(dofs, start, values, noise), index=known)
        for kind, n, variance, offsets in (
            (TURN, len(tasks), self._fading, self._offsets),
            (AFRESH, len(known), self._ending, REACH_OFFSETS),
        ):
            which, rate, at = np.indices((n, len(variance), len(offsets))).reshape(3, -1)
            task, offset = tasks[which], offsets[at]
            duration_s = np.exp(self._log_mean[task] + self._log_std[task] * offset)
            rates = self._rates[rate]
            if kind == AFRESH:
                duration_s *= REACH_PART
                rates = 1.0 / (self._moving[task] * duration_s)
            columns = {"kind": kind, "task": task, "duration_s": duration_s, "rate": rates}
            state = courses.resized(np.arange(n), self._width, variance).state
            found.append((state, offset, columns))
        return found

    def _give_birth_to_delays(
        self, birth_s: float, log_evidence: Floats, onset: HypothesisTable
    ) -> None:
        """Add delayed copies of the most probable hypothesis of the known tasks."""
        n_tasks, table, grid = self._library.n_tasks, self.table, self._grid
        of_onset = (grid.log_prior + log_evidence)[: -grid.n_scales] + self.log_stay
        of_born = np.where(table.rows["task"] < n_tasks, table.log_joint, -np.inf)
        later = of_born.max() > of_onset.max()
        parents, best = (table, of_born.argmax()) if later else (onset, of_onset.argmax())
        row, course = parents.rows[best].copy(), parents.courses(np.array([best]))
        table.add(
            course.resized(slice(None), self._width, self._fading).state,
            len(DELAYS),
            kind=DELAY,
            task=row["task"],
            onset_s=row["onset_s"] + np.tile(DELAYS, len(FADINGS)) * self.usual_s,
            duration_s=row["duration_s"],
            birth_s=birth_s,
            rate=np.repeat(self._rates, len(DELAYS)),
            log_share=-np.log(len(FADINGS) * len(DELAYS)),
        )

    def _remember_start(self, measurement: Measurement) -> None:
        """Keep each DOF's position at the start, where every task's course is taken to begin."""
        known = [dof for dofs, _, _ in self._first for dof in dofs]
        new = np.array([dof not in known for dof in measurement.dofs])
        self._first_s = min(self._first_s, measurement.elapsed_s)
        early = measurement.elapsed_s <= self._first_s + START_UNTIL * self.usual_s
        early = early or self._n_used < len(self._library.observed_groups)  # sparse samples
        if early and new.any() and not measurement.derivative:
            dofs, values, noise = measurement[2:5]
            self._first.append((dofs[new], values[new], noise[new][:, new]))
            self._tasks = None
