# SPDX-License-Identifier: Apache-2.0
"""Hypotheses that are born while a movement is under way: changes of mind, detours, delays.

As in interacting multiple models (Blom and Bar-Shalom 1988), what a person does may change on the
way. Rates are relative to how long the tasks usually take. A newborn hypothesis takes its share of
what all hypotheses are worth. A new task takes it from all others, and the old task again, for a
detour on its way; its pace, the duration in standard deviations of the task's, is as probable as
the pace of the movement so far. What is none of the tasks begins at its birth, wherever the hand
is. The hypotheses that were there from the onset pay for what they pass on.

A hypothesis born at a time t follows the course w that its task would have had from the movement's
start, plus an offset that begins where the hand is at t and fades:

    y(t + s) = psi(z) w + (a (1 + r s) + b s + c s^2 / 2) exp(-r s) + noise.

This is a critically damped spring of rate r (a and b: the offset and its velocity at birth) with
an initial push that fades as fast (c). a, b and c are weights beside w, so that the same Gaussian
update filters them (Maeda et al. 2014, Eq. 6).

Who turns may also begin anew, and reach for another task's goal as for any, by a fresh course
within the time T of a reach:

    y(t + s) = psi(s / T) w + h(s / R) (a, b R, c R^2),

with the quintics h of least jerk, that end at rest with the course, after the part R of T in which
it moves.

After a delay a person goes on with the same movement. Such a hypothesis is a copy of the most
probable one, with all that the path has told of its weights, whose clock is set back; a small
offset makes up for the step.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.filtering.grid import PriorGrid, duration_offsets, log_durations, log_pace
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.filtering.prediction import NEGLIGIBLE_SHARE
from intent_recognition.filtering.rates import (
    AFRESH,
    DELAY,
    TURN,
    birth_shares,
    log_stay,
    may_begin_anew,
    moving_parts,
)
from intent_recognition.filtering.table import OFFSET_BASIS, HypothesisTable
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement
from intent_recognition.promp import TaskLibrary

REACH_PART = 0.87
"""Part of its task's duration that a course afresh takes. Convention: no rest, a shorter way."""
REACH_OFFSETS = np.array([-1.0, 0.0, 1.0])
"""Durations of these, in standard deviations of the task's log duration. Convention."""
REACH_SCALE = np.array([1.0, 2.0, 4.0])
"""Standard deviations of a, b T and c T^2, in those of the offset a. Convention: as of least jerk.
"""
DELAYS = (0.05, 0.12, 0.25)
"""Lengths of a delay, in usual durations of the tasks (docs/decisions/change_of_mind.md)."""
N_DURATIONS = 7
"""Durations per task at each birth. Convention: offsets make up for what lies between."""
FADINGS = (12.0, 30.0)
"""Rates at which an offset fades, per usual duration of the tasks: gone after two fifths and a
sixth of it (docs/decisions/change_of_mind.md)."""
PUSH = 0.5
"""Standard deviation of the push c, in standard deviations of the offset a times r^2.
Convention."""
BIRTHS_EVERY = 2
"""Used observations of each signal between births (docs/decisions/change_of_mind.md)."""
SETTLING = 2
"""Observations of each signal that a newborn hypothesis takes its offset and velocity from, and is
not judged by."""
NEGLIGIBLE = 14.0
"""Nats below all others together at which a born hypothesis is pruned
(docs/decisions/change_of_mind.md)."""
MAX_HYPOTHESES, LEAST_HYPOTHESES = 150, 60
"""Born hypotheses kept, newborn ones aside; and of many DOFs at least
(docs/decisions/change_of_mind.md)."""
MAX_FLOATS = 1_500_000
"""Numbers in the covariances of those that are kept. Convention: it bounds the time of an
observation."""
MAX_TASKS = 8
"""Tasks that hypotheses are born of at a time, the most probable ones. Convention: likewise."""


class Births:
    """The born hypotheses of one movement after the other, in memory that is used again.

    Args:
        library: the learned tasks.
        grid: of the hypotheses of the onset.
        prior: weights of the tasks and none before anything is observed.

    Attributes:
        usual_s: how long the tasks usually take.
        table: their rows.
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
        self.clear()

    def clear(self, log_weight: Floats | None = None) -> None:
        """Begin with another movement: nothing is born yet.

        Args:
            log_weight: log of what the posterior of the known tasks will be multiplied by, (K,).
                It is known of the task at the onset: who turns to another one keeps it.
        """
        self.table.clear()
        known = np.zeros(self._library.n_tasks) if log_weight is None else log_weight
        # Two tasks that cannot be may be compared.
        self._log_weight = np.append(np.maximum(known, -700.0), 0.0)
        self._first: list[tuple[NDArray, NDArray, NDArray]] = []  # DOFs, values and noise
        self._states: tuple[Integers, Floats, Floats] | None = None
        self._n_used, self._last_s, self._last_birth_s, self._between_s = 0, 0.0, 0.0, 0.0

    @property
    def log_joint(self) -> Floats:
        """Log of prior and density of all observations, of the K tasks and none, (K + 1,)."""
        total = np.full(self._library.n_tasks + 1, -np.inf)
        np.logaddexp.at(total, self.table.rows["task"], self.table.log_joint)
        return total

    @property
    def log_stay(self) -> float:
        """Log probability with which a task of the onset passed nothing on to tasks."""
        return log_stay(self._last_s / self.usual_s, self._library.switch_margin)

    def onset_log_joint(self, log_evidence: Floats) -> Floats:
        """Log joint of the hypotheses of the onset less what they passed on, (K + 1,).

        What was none of the tasks from the onset stays so.

        Args:
            log_evidence: log density of all observations under them, (B,).
        """
        left = self._grid.log_task_joint(log_evidence)
        left[:-1] += self.log_stay
        return left

    def observe(
        self, measurement: Measurement, onset: HypothesisTable, log_evidence: Floats
    ) -> None:
        """Condition on a measurement; prune what is hopeless, and give birth to new hypotheses.

        Args:
            measurement: as the hypotheses of the onset took it.
            onset: the hypotheses of the onset.
            log_evidence: see `onset_log_joint`; this measurement is among the observations.
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
        """Whether a task is more probable by those born than by those of the onset."""
        return bool(self.log_joint[task] > self.onset_log_joint(log_evidence)[task])

    def of_task(self, task: int) -> tuple[Integers, Floats]:
        """Where the table has n of a task that count, and their probabilities given it, (n,)."""
        joint = np.where(self.table.rows["task"] == task, self.table.log_joint, -np.inf)
        weight = np.exp(joint - np.max(joint))
        index = np.flatnonzero(weight > NEGLIGIBLE_SHARE)
        return index, weight[index] / weight[index].sum()

    def _settle(self, total: Floats) -> None:
        """Give those that are judged from now on their share of what all are worth, (K + 1,)."""
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
        """What explains far less than all together, and the worst of too many."""
        rows, joint = self.table.rows, self.table.log_joint
        settled = rows["seen"] >= self._settling
        joint += self._grid.none_margin * (rows["task"] == self._library.n_tasks)
        hopeless = settled & (joint < total - NEGLIGIBLE)
        kept = np.flatnonzero(settled & ~hopeless)
        if len(kept) > self._n_kept:
            hopeless[kept[np.argsort(joint[kept])[: -self._n_kept]]] = True
        return hopeless

    def _give_birth(self, birth_s: float, log_evidence: Floats, left: Floats) -> None:
        """Add newborn hypotheses of the most probable tasks, and of none."""
        n_tasks = self._library.n_tasks
        tasks = np.arange(n_tasks)
        if n_tasks > MAX_TASKS:
            joint = np.logaddexp(self.log_joint, left)[:-1]
            tasks = np.sort(np.argpartition(joint, -MAX_TASKS)[-MAX_TASKS:])
        fading, ending = self._newborn(tasks)
        self._add(TURN, np.append(tasks, n_tasks), fading, birth_s, log_evidence)
        if may_begin_anew(birth_s / self.usual_s):
            self._add(AFRESH, tasks, ending, birth_s, log_evidence)

    def _add(
        self, kind: int, tasks: Integers, state: Floats, birth_s: float, log_evidence: Floats
    ) -> None:
        """Add a kind of newborn hypotheses of some tasks (k,), with offsets of R rates, (k R, ...).

        Courses afresh begin at their birth, as that of none does.
        """
        afresh = kind == AFRESH
        offsets = REACH_OFFSETS if afresh else self._offsets
        n_rates = len(state) // len(tasks)
        which, rate, at = _combined(len(tasks), n_rates, len(offsets))
        task = tasks[which]
        is_none = task == self._library.n_tasks
        duration_s = np.exp(self._log_mean[task] + self._log_std[task] * offsets[at])
        duration_s *= REACH_PART if afresh else 1.0
        pace = log_pace(self._grid, log_evidence, offsets) - np.log(n_rates)
        self.table.add(
            state,
            len(offsets),
            kind=kind,
            task=task,
            onset_s=np.where(is_none | afresh, birth_s, 0.0),
            duration_s=duration_s,
            birth_s=birth_s,
            rate=1.0 / (self._moving[task] * duration_s) if afresh else self._rates[rate],
            log_share=pace[is_none.astype(np.int64), at],
        )

    def _newborn(self, tasks: Integers) -> tuple[Floats, Floats]:
        """Weights of those born of tasks and none, with offsets that fade, and of tasks, that end.

        The courses begin where the movement began, but for none, which begins at its birth. They
        are the same at each birth until another DOF is seen for the first time.
        """
        if self._states is None or not np.array_equal(tasks, self._states[0]):
            basis, known = self._library.basis, np.arange(len(tasks))
            courses = self._prior.resized(np.append(tasks, self._library.n_tasks), basis.n_basis)
            start = basis.design_matrix(np.zeros((len(known), 1)))
            for dofs, values, noise in self._first:
                courses.condition(LinearMeasurement(dofs, start, values, noise), index=known)
            fading = courses.resized(slice(None), self._width, self._fading).state
            ending = courses.resized(known, self._width, self._ending).state
            self._states = tasks, fading, ending
        return self._states[1:]

    def _give_birth_to_delays(
        self, birth_s: float, log_evidence: Floats, onset: HypothesisTable
    ) -> None:
        """Add copies of the most probable hypothesis of a known task, set back in time."""
        n_tasks, table = self._library.n_tasks, self.table
        joint = self._grid.log_prior + log_evidence + self.log_stay
        joint, of_born = (
            np.where(those.rows["task"] < n_tasks, one, -np.inf)
            for those, one in ((onset, joint), (table, table.log_joint))
        )
        parents, known = (table, of_born) if of_born.max() > joint.max() else (onset, joint)
        best = int(np.argmax(known))
        row, course = parents.rows[best].copy(), parents.courses(np.array([best]))
        rate, delay = _combined(len(FADINGS), len(DELAYS))
        table.add(
            course.resized(slice(None), self._width, self._fading).state,
            len(DELAYS),
            kind=DELAY,
            task=row["task"],
            onset_s=row["onset_s"] + np.array(DELAYS)[delay] * self.usual_s,
            duration_s=row["duration_s"],
            birth_s=birth_s,
            rate=self._rates[rate],
            log_share=-np.log(len(delay)),
        )

    def _remember_start(self, measurement: Measurement) -> None:
        """Keep where the movement began: the course of another task would have begun there, too."""
        known = [dof for dofs, _, _ in self._first for dof in dofs]
        new = np.array([dof not in known for dof in measurement.dofs])
        if new.any() and not measurement.derivative:
            dofs, values, noise = measurement[2:5]
            self._first.append((dofs[new], values[new], noise[new][:, new]))
            self._states = None


def _combined(*sizes: int) -> list[Integers]:
    """Numbers of all combinations of so many things each, the last changing fastest."""
    return [index.ravel() for index in np.indices(sizes)]
