# SPDX-License-Identifier: Apache-2.0
"""A task once believed in is not let go for how its movement goes on, as long as it goes there.

A hurry with a hesitation in it is unlikely under any model of timing that few demonstrations
give, and the evidence turns to `none` while the hand is on its way as predicted. So when it turns
to none against a task that was believed, the rest of the movement is predicted once, as it was
expected then. While the hand stays near that course or its end, whenever it gets there, none
counts no more than before the movement; off the course it counts in full. Tasks are weighed
against each other as ever.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from intent_recognition.promp import Trajectory
from intent_recognition.recognition.decision import EVEN, DecisionSettings
from intent_recognition.recognition.posterior import TaskPosterior

BELIEVED, N_BELIEVED = DecisionSettings().threshold, DecisionSettings().n_observations
"""A task is believed at this probability for so many observations on end, as it is acted on."""
NEAR = 3.0
"""Standard deviations of the predicted position that are near the course."""


class Belief(NamedTuple):
    """Which task is believed.

    Attributes:
        task: its number, -1 for none yet; kept until another is believed.
        candidate: that at or above `BELIEVED` at the last observation, or -1.
        n_for: for how many observations on end.
    """

    task: int = -1
    candidate: int = -1
    n_for: int = 0


def believe(belief: Belief, probabilities: np.ndarray) -> Belief:
    """The belief after one more observation, from the probabilities of tasks and none, (K + 1,)."""
    best = int(np.argmax(probabilities))
    if best == len(probabilities) - 1 or probabilities[best] < BELIEVED:
        return Belief(belief.task)
    n_for = belief.n_for + 1 if best == belief.candidate else 1
    return Belief(best if n_for >= N_BELIEVED else belief.task, best, n_for)


def is_near(course: Trajectory, place: np.ndarray, spread: float) -> bool:
    """Whether a place lies within so many standard deviations of some point of a course.

    Args:
        course: predicted positions and their standard deviations, (T, P) each.
        place: of the observed DOFs, (P,); NaN where it is not known. Each other DOF must be near.
        spread: how many.
    """
    seen = np.isfinite(place)
    if not np.any(seen):
        return False
    apart = np.abs(course.positions[:, seen] - place[seen]) / course.std[:, seen]
    return bool(np.min(np.max(apart, axis=1)) <= spread)


def total_known(log_evidence: np.ndarray, log_prior: np.ndarray) -> float:
    """Log evidence that the movement is of some known task, from (K + 1,) and (K + 1,)."""
    weight = log_prior[:-1] - np.logaddexp.reduce(log_prior[:-1])
    return float(np.logaddexp.reduce(weight + log_evidence[:-1]))


def without_objection(posterior: TaskPosterior, log_prior: np.ndarray) -> TaskPosterior:
    """The posterior if none explained the movement as well as the tasks do in the mean.

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
        self, log_prior: np.ndarray, n_observed: int, course_of: Callable[[int], Trajectory]
    ):
        self._log_prior, self._course_of = log_prior, course_of
        self._place = np.full(n_observed, np.nan)
        self._course: Trajectory | None = None
        self._belief = Belief()

    def see(self, dofs: np.ndarray, values: np.ndarray) -> None:
        """Where some DOFs (m,) are, (m,)."""
        self._place[dofs] = values

    def hold(self, posterior: TaskPosterior) -> TaskPosterior:
        """The posterior, without the objection of none while a believed task keeps its course."""
        evidence, task = posterior.log_evidence, self._belief.task
        objects = total_known(evidence, self._log_prior) < evidence[-1] - EVEN
        if not objects or task != int(np.argmax(self._log_prior[:-1] + evidence[:-1])):
            self._course = None
            return posterior
        if self._course is None:
            self._course = self._course_of(task)
        near = is_near(self._course, self._place, NEAR)
        return without_objection(posterior, self._log_prior) if near else posterior

    def believe(self, probabilities: np.ndarray) -> None:
        """Take note of the probabilities of tasks and none, (K + 1,), after an observation."""
        self._belief = believe(self._belief, probabilities)
