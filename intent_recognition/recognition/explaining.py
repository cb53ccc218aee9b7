# SPDX-License-Identifier: Apache-2.0
"""Why one task is more probable than another: evidence by observation and by observed DOF.

The log odds of two tasks are the prior log odds plus, by the chain rule, the sum over observations
of the log ratio of their predictive densities p(y_t | y_1 .. y_t-1, task) (Maeda et al. 2014,
Eq. 9-11). The chain rule also holds over the DOFs of an observation. The movement is therefore
filtered with the first DOF alone, then with the first two, and so on. Each further DOF adds its
density given the DOFs before it, in the order of the library. There is no approximation beyond the
filter's own: the parts sum to the log odds that the estimator reports. Another order of the DOFs
would divide the same sum differently.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, brief
from intent_recognition.errors import ArgumentError
from intent_recognition.filtering import MovementFilter, TaskPosterior
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.signals import Observation


@brief
class Evidence(NamedTuple):
    """Evidence for a task against a rival."""

    task: str  # label of the task
    rival: str  # label of the other task
    names: tuple[str, ...]  # names of the P observed DOFs
    times_s: Floats  # times of the n observations, after onset, (n,)
    # log odds [nats] that each observation adds, by DOF, (n, P); zero for observations that the
    # filter leaves out because they follow too closely on another
    by_dof: Floats
    expected: float  # log odds before the movement, plus those from a person's answer

    @property
    def log_odds(self) -> float:
        """log (p(task) / p(rival)) after all observations, as the estimator reports it."""
        return self.expected + float(self.by_dof.sum())


def explain_movement(
    run: MovementFilter, posterior: TaskPosterior, task: str | None = None, rival: str | None = None
) -> Evidence:
    """Evidence for a task against a rival in a movement under way.

    The movement is filtered once more for each observed DOF.

    Args:
        run: filter of the movement, which is not changed.
        posterior: posterior of the movement.
        task: label of the task; None for the most probable known task.
        rival: label of the rival; None for the most probable other task, or for none if it is more
            probable than the task.
    """
    labels = (*run.library.labels, NONE)
    p = posterior.probabilities
    best = int(np.argmax(p[:-1])) if task is None else _place("task", labels, task)
    other = _runner_up(p, best) if rival is None else _place("rival", labels, rival)
    if best == other:
        cure = "Leave it out for the runner-up."
        raise ArgumentError.about("rival", "another label than that of the task", rival, cure)
    n_observed = run.library.n_observed
    sums = [_evidence_over_time(run, n, best, other) for n in range(1, n_observed + 1)]
    by_dof = np.diff(np.diff([np.zeros_like(sums[0]), *sums], axis=0).T, axis=0, prepend=0.0)
    stamps_ns = np.array([one.stamp_ns for one in run.observations], dtype=np.int64)
    times_s = 1e-9 * np.asarray(stamps_ns - run.onset_ns, dtype=np.float64)
    with np.errstate(divide="ignore"):
        odds = float(np.log(p[best]) - np.log(p[other]))
    evidence = run.posterior(int(stamps_ns[-1])).log_evidence
    return Evidence(
        labels[best],
        labels[other],
        run.library.observed_names,
        times_s,
        by_dof,
        odds - float(evidence[best] - evidence[other]),
    )


def without_dofs(
    observation: Observation, library: TaskLibrary, dropped: frozenset[int]
) -> Observation | None:
    """An observation without some DOFs; None if nothing is left.

    `dropped` are indices of observed DOFs of the library.
    """
    dofs = library.observed_dofs(observation.group, observation.dofs)
    lost = [dof in dropped for dof in dofs.tolist()]
    if not any(lost):
        return observation
    return observation._replace(values=np.where(lost, np.nan, observation.values)).measured()


def _evidence_over_time(like: MovementFilter, n_dofs: int, task: int, rival: int) -> Floats:
    """Log evidence for a task against a rival after each observation, from `n_dofs` DOFs, (n,)."""
    library, found = like.library, []
    dropped = frozenset(range(n_dofs, library.n_observed))
    switching = like.births is not None
    run = MovementFilter(library, like.grid, like.onset_ns, prune=True, switching=switching)
    run.restart(like.onset_ns, like.task_weight)
    for observation in like.observations:
        seen = without_dofs(observation, library, dropped)
        if seen is not None:
            run.observe(seen)
        evidence = run.posterior(observation.stamp_ns).log_evidence
        found.append(evidence[task] - evidence[rival])
    return np.array(found)


def _runner_up(p: Floats, task: int) -> int:
    """Most probable other task; none if it is more probable than the task."""
    none = len(p) - 1
    if p[none] > p[task] or len(p) < 3:
        return none if task != none else int(np.argmax(p[:-1]))
    return int(np.argmax(np.where(np.arange(none) == task, -1.0, p[:-1])))


def _place(argument: str, labels: tuple[str, ...], label: str) -> int:
    if label not in labels:
        cure = "Name a task of the model, or none."
        raise ArgumentError.about(argument, f"one of {', '.join(labels)}", repr(label), cure)
    return labels.index(label)
