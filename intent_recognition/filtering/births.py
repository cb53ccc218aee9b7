# SPDX-License-Identifier: Apache-2.0
"""What may happen on the way, how often, and the hypotheses that are born of it.

Rates are relative to how long the tasks usually take. A hypothesis that is born on the way takes
its share of what all hypotheses are worth. A new task takes it from all others, and the old task
again, for a detour on its way; its pace, the duration in standard deviations of the task's, is as
probable as the pace of the movement so far. What is none of the tasks begins at its birth, wherever
the hand is. The hypotheses that were there from the onset pay for what they pass on.

A hypothesis born at a time t follows the course w that its task would have had from the movement's
start, plus an offset that begins where the hand is at t and fades:

    y(t + s) = psi(z) w + (a (1 + r s) + b s + c s^2 / 2) exp(-r s) + noise.

This is a critically damped spring of rate r (a and b: the offset and its velocity at birth) with
an initial push that fades as fast (c). a, b and c are weights beside w, so that the same Gaussian
update filters them (Maeda et al. 2014, Eq. 6).

Who is held up goes on with the same movement later. Such a hypothesis is a copy of one that is
there, with all that the path has told of its weights, whose clock is set back; a small offset makes
up for the step.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering.hypotheses import Hypotheses, duration_offsets
from intent_recognition.filtering.observation_model import Measurement
from intent_recognition.gaussian import Gaussian, GaussianBatch, LinearMeasurement
from intent_recognition.promp import TaskLibrary

SWITCHES = 0.04
"""Rate at which a person turns to another task, per usual duration of the tasks
(docs/decisions/change_of_mind.md)."""
DETOURS = 0.03
"""Rate at which a person goes on with the same task in another way, likewise."""
HOLD_UPS = 0.3
"""Rate at which a person is held up, and goes on with the same movement later, likewise."""
STRAYS = 0.3
"""Rate at which a known movement becomes one of no task, likewise; its evidence counts beyond the
library's margin only."""
DELAYS = (0.05, 0.12, 0.25)
"""How long a person is held up, in usual durations of the tasks, likewise."""
N_DURATIONS = 7
"""Durations per task at each birth. Convention: offsets make up for what lies between."""
FADINGS = (12.0, 30.0)
"""Rates at which an offset fades, per usual duration of the tasks: gone after two fifths and a
sixth of it (docs/decisions/change_of_mind.md)."""
PUSH = 0.5
"""Standard deviation of the push c, in standard deviations of the offset a times r^2.
Convention."""
HELD_UP_OFFSET = 0.3
"""Standard deviation of the offset of who is held up, in those of another offset
(docs/decisions/change_of_mind.md)."""
OFFSET_BASIS = 3
"""Weights of an offset: a, b and c."""


class BirthGrid(NamedTuple):
    """What is born at a time: tasks by rates of fading by durations, n hypotheses.

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


def birth_grid(n_tasks: int, n_scales: int) -> BirthGrid:
    """What is born of so many tasks, none among them.

    Args:
        n_tasks: how many.
        n_scales: durations per task of the hypotheses of the onset; no more are born.
    """
    offsets, _ = duration_offsets(min(n_scales, N_DURATIONS))
    n_rates, n_durations = len(FADINGS), len(offsets)
    prior, duration = np.divmod(np.arange(n_tasks * n_rates * n_durations), n_durations)
    return BirthGrid(prior, duration, np.array(FADINGS)[prior % n_rates], offsets)


def log_pace(
    hypotheses: Hypotheses, log_evidence: NDArray[np.float64], offsets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Log probability of the durations of newborn hypotheses of a task, and of none, (2, S').

    Args:
        hypotheses: of the onset.
        log_evidence: density of all observations under them, (B,).
        offsets: of the durations, in standard deviations of their logarithm, (S',).
    """
    at, log_prior = duration_offsets(hypotheses.n_scales)
    joint = (hypotheses.log_prior + log_evidence).reshape(-1, len(at))[:-1]
    own = np.logaddexp.reduce(joint, axis=1)
    tempered = log_prior + hypotheses.duration_evidence * log_evidence.reshape(-1, len(at))[:-1]
    tempered -= np.logaddexp.reduce(tempered, axis=1, keepdims=True)
    so_far = np.logaddexp.reduce(tempered + (own - np.logaddexp.reduce(own))[:, None], axis=0)
    table = np.array([np.interp(offsets, at, row) for row in (so_far, log_prior)])
    return np.asarray(table - np.logaddexp.reduce(table, axis=1, keepdims=True))


def log_staying(library: TaskLibrary, passed: float) -> float:
    """Log probability with which a task of the onset passed nothing on to tasks.

    Args:
        library: the learned tasks.
        passed: time since onset, in usual durations.
    """
    return -(SWITCHES * float(np.exp(-library.switch_margin)) + DETOURS + HOLD_UPS) * passed


def shares(
    total: NDArray[np.float64],
    log_prior: NDArray[np.float64],
    passed: float,
    *,
    none_margin: float = 0.0,
    switch_margin: float = 0.0,
) -> NDArray[np.float64]:
    """Log of what passes to newborn hypotheses in a time, (2 K + 1,).

    First what passes to each task and to none, then to each task whose movement is held up.

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
        stray, held_up = everything + np.log(STRAYS) - none_margin, known + np.log(HOLD_UPS)
        return np.r_[own, stray, held_up] + np.log(passed)


class NewbornStates:
    """States of newborn hypotheses of one movement after the other.

    Args:
        library: the learned tasks.

    Attributes:
        width: weights of a DOF, those of its offset among them.
        usual_s: how long the tasks usually take.
    """

    def __init__(self, library: TaskLibrary):
        self.library = library
        self.width = library.basis.n_basis + OFFSET_BASIS
        self.usual_s = float(np.exp(np.mean(library.log_duration_mean)))
        none_variance = np.diag(library.none_covariance).reshape(library.n_observed, -1)
        std = np.sqrt(none_variance.mean(axis=1))[:, None]
        rates = np.array(FADINGS)[:, None, None] / self.usual_s
        self._offset_variance = (std * rates ** np.arange(OFFSET_BASIS)) ** 2  # (R, P, 3)
        self._offset_variance[..., -1] *= PUSH**2
        self.start()

    def start(self) -> None:
        """Begin with a movement: nothing of it is seen yet."""
        self._first: list[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]] = []
        self._made: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self._started = np.zeros(self.library.n_observed, dtype=bool)

    def remember_start(self, measurement: Measurement) -> None:
        """Keep where the movement began: the course of another task would have begun there, too."""
        new = ~self._started[measurement.dofs]
        if measurement.derivative or not new.any():
            return
        dofs = measurement.dofs[new]
        self._started[dofs] = True
        noise = measurement.noise_covariance[np.ix_(new, new)]
        self._first.append((dofs, measurement.values[new], noise))
        self._made.clear()

    def states(self, tasks: NDArray[np.int64]) -> NDArray[np.float64]:
        """States of some tasks by the rates of fading, before anything is seen of the offset."""
        key = tuple(tasks)
        if key not in self._made:
            self._made = {key: self._make(tasks)}
        return self._made[key]

    def held_up(self, course: Gaussian) -> NDArray[np.float64]:
        """States of who goes on with a known course later, by the rates of fading.

        Args:
            course: its weights without an offset, (P N,).
        """
        n_basis = self.library.basis.n_basis
        state = GaussianBatch.of(course.mean[None], course.covariance[None], n_basis)
        return self._with_offset(state, HELD_UP_OFFSET)

    def _make(self, tasks: NDArray[np.int64]) -> NDArray[np.float64]:
        library, n_basis = self.library, self.library.basis.n_basis
        mean, covariance = library.observed_mean[tasks], library.observed_covariance[tasks]
        courses = GaussianBatch.of(mean, covariance, n_basis)
        known = GaussianBatch(courses.state[:-1], n_basis)
        row = library.basis.design_matrix(np.zeros(len(tasks) - 1))[:, None]
        for dofs, values, noise in self._first:
            known.condition(LinearMeasurement(dofs, row, values, noise))
        return self._with_offset(courses)

    def _with_offset(self, courses: GaussianBatch, scale: float = 1.0) -> NDArray[np.float64]:
        """States of courses by the rates of fading, with weights of an offset beside theirs."""
        n_basis, p = self.library.basis.n_basis, self.library.n_observed
        means, covariances = courses.moments()
        shape = len(means), len(FADINGS)
        mean = np.zeros((*shape, p, self.width))
        mean[..., :n_basis] = means.reshape(shape[0], 1, p, n_basis)
        covariance = np.zeros((*shape, p, self.width, p, self.width))
        own = covariances.reshape(shape[0], 1, p, n_basis, p, n_basis)
        covariance[:, :, :, :n_basis, :, :n_basis] = own
        dof, offset = np.arange(p)[:, None], n_basis + np.arange(OFFSET_BASIS)
        covariance[:, :, dof, offset, dof, offset] = scale**2 * self._offset_variance
        size = p * self.width
        flat = covariance.reshape(-1, size, size)
        return GaussianBatch.of(mean.reshape(-1, size), flat, self.width).state


def fading(since_s: NDArray[np.float64], rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """What remains of an offset of one, of its velocity and of its push, (n, 3).

    Args:
        since_s: time since birth, (n,); less than zero counts as zero.
        rate: of a critically damped spring [1/s], (n,).
    """
    s = np.maximum(since_s, 0.0)
    shapes = np.stack([1.0 + rate * s, s, 0.5 * s**2], axis=1)
    return shapes * np.exp(-rate * s)[:, None]


def fading_velocity(since_s: NDArray[np.float64], rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of `fading` by the time [1/s], (n, 3)."""
    s = np.maximum(since_s, 0.0)
    shapes = np.stack([-(rate**2) * s, 1.0 - rate * s, s - 0.5 * rate * s**2], axis=1)
    return shapes * np.exp(-rate * s)[:, None]
