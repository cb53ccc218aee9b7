# SPDX-License-Identifier: Apache-2.0
"""Hysteresis of the posterior: a recognised task is kept while the hand stays on its course.

A hurry followed by a hesitation is unlikely under any timing model learned from few demonstrations,
and the evidence turns to `none` although the hand moves as predicted. When the evidence turns to
none against a recognised task, the rest of the movement is predicted once, as expected then. While
the hand is near that course or its end, whenever it gets there, none counts no more than before the
movement; off the course it counts in full. The tasks are compared with each other as usual.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.promp import Trajectory
from intent_recognition.recognition.decision import EVEN, DecisionSettings
from intent_recognition.recognition.posterior import TaskPosterior

RECOGNISED_AT, N_RECOGNISED = DecisionSettings().threshold, DecisionSettings().n_observations
"""A task is recognised at this probability for this many consecutive observations: as the decision.
"""
NEAR = 3.0
"""Distance from the course that is near it, in standard deviations of the predicted position.

Convention: 99.7 % of positions on the course are nearer.
"""


class RecognisedTask(NamedTuple):
    """Which task is recognised.

    Attributes:
        task: its number, -1 for none yet; kept until another is recognised.
        candidate: that at or above `RECOGNISED_AT` at the last observation, or -1.
        n_for: for how many consecutive observations.
    """

    task: int = -1
    candidate: int = -1
    n_for: int = 0


def next_recognised(before: RecognisedTask, probabilities: NDArray[np.float64]) -> RecognisedTask:
    """The recognised task after an observation, given probabilities of tasks and none, (K + 1,)."""
    best = int(np.argmax(probabilities))
    if best == len(probabilities) - 1 or probabilities[best] < RECOGNISED_AT:
        return RecognisedTask(before.task)
    n_for = before.n_for + 1 if best == before.candidate else 1
    return RecognisedTask(best if n_for >= N_RECOGNISED else before.task, best, n_for)


def is_near(course: Trajectory, position: NDArray[np.float64], n_std: float) -> bool:
    """Whether a position is within some standard deviations of a point of a course.

    Args:
        course: predicted positions and their standard deviations, (T, P) each.
        position: of the observed DOFs, (P,); NaN where it is unknown. Each other DOF must be near.
        n_std: number of standard deviations.
    """
    seen = np.isfinite(position)
    if not np.any(seen):
        return False
    apart = np.abs(course.positions[:, seen] - position[seen]) / course.std[:, seen]
    return bool(np.min(np.max(apart, axis=1)) <= n_std)


def total_known(log_evidence: NDArray[np.float64], log_prior: NDArray[np.float64]) -> float:
    """Log evidence that the movement is of some known task, from (K + 1,) and (K + 1,)."""
    weight = log_prior[:-1] - np.logaddexp.reduce(log_prior[:-1])
    return float(np.logaddexp.reduce(weight + log_evidence[:-1]))


def without_evidence_for_none(
    posterior: TaskPosterior, log_prior: NDArray[np.float64]
) -> TaskPosterior:
    """The posterior if none explained the movement as well as the tasks do on average.

    Args:
        posterior: over K tasks and none.
        log_prior: theirs, (K + 1,).
    """
    log_evidence = posterior.log_evidence.copy()
    log_evidence[-1] = total_known(log_evidence, log_prior)
    log_joint = log_prior + log_evidence
    probabilities = np.exp(log_joint - np.max(log_joint))
    return posterior._replace(
        probabilities=probabilities / probabilities.sum(), log_evidence=log_evidence
    )


class PosteriorHysteresis:
    """Follows one movement, one observation after the other.

    Args:
        log_prior: of the K tasks and none, (K + 1,).
        n_observed: number of observed DOFs P.
        course_of: the rest of the observed agent's movement under a task.
    """

    def __init__(
        self,
        log_prior: NDArray[np.float64],
        n_observed: int,
        course_of: Callable[[int], Trajectory],
    ):
        self._log_prior, self._course_of = log_prior, course_of
        self._position = np.full(n_observed, np.nan)
        self._course: Trajectory | None = None
        self._recognised = RecognisedTask()

    def observe(self, dofs: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Take the positions (m,) of some DOFs, (m,)."""
        self._position[dofs] = values

    def apply(self, posterior: TaskPosterior) -> TaskPosterior:
        """The posterior, without the evidence for none while a recognised task keeps its course."""
        evidence, task = posterior.log_evidence, self._recognised.task
        none_is_better = total_known(evidence, self._log_prior) < evidence[-1] - EVEN
        if not none_is_better or task != int(np.argmax(self._log_prior[:-1] + evidence[:-1])):
            self._course = None
            return posterior
        if self._course is None:
            self._course = self._course_of(task)
        near = is_near(self._course, self._position, NEAR)
        return without_evidence_for_none(posterior, self._log_prior) if near else posterior

    def update(self, probabilities: NDArray[np.float64]) -> None:
        """Take the probabilities of tasks and none, (K + 1,), after an observation."""
        self._recognised = next_recognised(self._recognised, probabilities)
