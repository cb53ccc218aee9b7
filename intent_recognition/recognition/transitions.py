# SPDX-License-Identifier: Apache-2.0
"""Which task follows which: learned from recorded sequences, used as p(s) of the next movement.

A first-order Markov chain over tasks. What is remembered of the past is a belief over the last
task, not a decision: after each movement

    belief'(k) = p(k) + p(none) belief(k)

with the movement's task posterior p, so that a movement that is none of the tasks leaves the
memory as it was, and one that might have been two tasks counts for both. The next movement's prior
is

    p(s) = trust sum_k belief(k) T(k, s) + (1 - trust) p0(s)

with the task prior p0, since habits are broken. The last row of T, and the last entry of the
belief, stand for "no last task": the beginning of a session, after a reset, after a long silence.
Where a plan is followed (`plans`), the first term is what the plan says may come.

An expectation may raise the probability of known tasks together, never lower it: where the movement
is not the expected task, none keeps the probability it has without the habit, so that a task out of
the habit is not taken for none of them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, read_only
from intent_recognition.errors import ArgumentError
from intent_recognition.filtering import TaskPosterior, answered
from intent_recognition.plans import WorkPlan, WorkProgress
from intent_recognition.promp import TaskLibrary

FORGET_AFTER_S = 60.0
"""Time after the end of a movement from which it tells nothing about the next [s]. Convention."""
HABIT_TRUST = 0.8
"""Share of the learned habit in p(s); the rest is the task prior (docs/anticipation.md)."""
COMPLETED_PHASE = 0.9
"""Expected phase before which a movement that ended was broken off: it is no last task. Convention.
"""


class TaskMemory(NamedTuple):
    """What is remembered of the movements before."""

    belief: Floats  # probability that each task was the last, "no last task" at the end, (K + 1,)
    ended_ns: int = 0  # when the last movement ended, 0 when there was none

    @classmethod
    def empty(cls, n_tasks: int) -> "TaskMemory":
        """No last task."""
        belief = np.zeros(n_tasks + 1)
        belief[-1] = 1.0
        return cls(belief)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is remembered."""
        return bool(self.belief[-1] >= 1.0)

    def last_task(self, labels: Sequence[str]) -> str:
        """The most probable last task, empty where "no last task" is more probable."""
        best = int(np.argmax(self.belief))
        return labels[best] if best < len(labels) else ""

    def relabelled(self, before: Sequence[str], after: Sequence[str]) -> "TaskMemory":
        """The same memory over other labels; a task that is no more becomes "no last task"."""
        belief = np.zeros(len(after) + 1)
        for label, p in zip((*before, None), self.belief, strict=True):
            belief[after.index(label) if label in after else -1] += p
        return TaskMemory(belief, self.ended_ns)


def remember(memory: TaskMemory, probabilities: Floats, phase: Floats, ended_ns: int) -> TaskMemory:
    """The memory after a movement; one that was broken off changes only the time.

    Of the K tasks and none at its end, the probabilities and expected phases, (K + 1,) each.
    """
    p = _completed(probabilities, phase)
    belief = p[-1] * memory.belief
    belief[:-1] += p[:-1]
    return TaskMemory(belief / belief.sum(), ended_ns)


def _completed(probabilities: Floats, phase: Floats) -> Floats:
    """The probabilities of a movement, those of tasks that were broken off counting for none."""
    p = np.where(np.asarray(phase) >= COMPLETED_PHASE, probabilities, 0.0)
    p[-1] = 1.0 - p[:-1].sum()
    return p


def next_task_prior(
    transition_prior: Floats, memory: TaskMemory, task_prior: Floats, trust: float = HABIT_TRUST
) -> Floats:
    """p(s) of the next movement, (K,), sums to one.

    From p(next | last) (K + 1, K), whose share, the habit's, is `trust` in [0, 1], and p0(s) (K,).
    """
    possible = np.flatnonzero(memory.belief > 1e-9)  # with thousands of tasks: a few
    prior = memory.belief[possible] @ transition_prior[possible]
    return trust * prior / prior.sum() + (1.0 - trust) * task_prior


def weigh(posterior: TaskPosterior, ratio: Floats) -> TaskPosterior:
    """The posterior, so far under p0(s), under another p(s): `ratio` is p(s) / p0(s), (K,).

    None becomes less probable by it, never more.
    """
    known = posterior.probabilities[:-1] * ratio
    total = known.sum()
    if not total > 0.0:
        return posterior
    shared = posterior.probabilities[:-1].sum()
    p = np.r_[known * max(1.0, shared / total), posterior.probabilities[-1]]
    return posterior._replace(probabilities=p / p.sum())


class Expectation:
    """What the next task will be, kept up to date from one movement to the next.

    Args:
        library: the learned tasks, with their transition prior.
        fixed_prior: p(s), (K,), whatever went before; None: as learned.
        transitions: use the transition prior; else p(s) is the library's task prior.
        forget_after_s: see FORGET_AFTER_S.

    Attributes:
        memory: of the movements before.
        prior: p(s) of the next movement, (K,).
        ratio: what `weigh` multiplies the known tasks' posterior by, (K,); None when by nothing.
        progress: how far the assembly is, where a plan is followed; None without one.
    """

    progress: WorkProgress | None = None
    _plan: WorkPlan | None = None
    _step, _answer = "", ""

    def __init__(
        self,
        library: TaskLibrary,
        fixed_prior: Floats | None = None,
        transitions: bool = True,
        forget_after_s: float = FORGET_AFTER_S,
    ):
        self._library, self._fixed_prior = library, fixed_prior
        self._transitions, self._forget_after_s = transitions, forget_after_s
        self.reset()

    def follow(self, plan: WorkPlan | None) -> None:
        """Expect what a plan says may come; None: follow no plan.

        Steps of the plan before stay done, by name. Time does not end an assembly.

        Raises:
            ArgumentError: no step of the plan is a task of the library.
        """
        labels, before = self._library.labels, self.progress
        if plan is None:
            self.progress = None
        else:
            self.progress = before.changed(plan, labels) if before else WorkProgress(plan, labels)
        self._plan = plan
        self._set(self.memory)

    def share(self, progress: WorkProgress) -> None:
        """Go by how far the assembly is that several people work on, who all share this."""
        self.progress = progress
        self._set(self.memory)

    def expect(self, task: str, *, at_once: bool) -> None:
        """Let a task be that of the next movement, as sure as a habit; empty: as it was learned.

        One that was not learned is as none. It counts at once where no movement is under way, else
        when that has ended.
        """
        self._step = task
        if at_once:
            self._set(self.memory)

    def answer(self, task: str) -> None:
        """Count what a person says the movement under way is, until it ends.

        Raises:
            ArgumentError: there is no such task.
        """
        if task not in self._library.labels:
            cure = "Name a task of the model."
            raise ArgumentError.about("answer", f"one of {self._library.labels}", repr(task), cure)
        self._answer = task

    @property
    def last_task(self) -> str:
        """Label of the most probable last task, empty when there is none."""
        return self.memory.last_task(self._library.labels)

    def reset(self) -> None:
        """No last task, and nothing of the plan done."""
        if self.progress is not None and self._plan is not None:  # others may share the one before
            self.progress = WorkProgress(self._plan, self._library.labels)
        self._answer = ""
        self._set(TaskMemory.empty(self._library.n_tasks))

    def remember(self, ended_ns: int, posterior: TaskPosterior) -> None:
        """Take note of a movement that has ended."""
        self._answer = ""
        if self.progress is not None:
            self.progress.take(_completed(posterior.probabilities, posterior.phase))
        self._set(remember(self.memory, posterior.probabilities, posterior.phase, ended_ns))

    def forget_if_long_ago(self, now_ns: int) -> None:
        """Forget the last task when it is too long ago."""
        since_s = (now_ns - self.memory.ended_ns) * 1e-9
        if not self.memory.is_empty and since_s > self._forget_after_s:
            self._set(TaskMemory.empty(self._library.n_tasks))

    def swap(self, library: TaskLibrary, fixed_prior: Floats | None) -> None:
        """Go on with another library."""
        if self.progress is not None and self._plan is not None:
            self.progress = self.progress.changed(self._plan, library.labels)
        memory = self.memory.relabelled(self._library.labels, library.labels)
        self._library, self._fixed_prior = library, fixed_prior
        self._set(memory)

    def change(self, transitions: bool, forget_after_s: float) -> None:
        """Expect in another way from now on; see the arguments of the class."""
        self._transitions, self._forget_after_s = transitions, forget_after_s
        self._set(self.memory)

    def weigh(self, posterior: TaskPosterior) -> TaskPosterior:
        """The posterior of the movement under way, given what was expected and answered."""
        if self.ratio is not None:
            posterior = weigh(posterior, self.ratio)
        if self._answer in self._library.labels:
            posterior = answered(posterior, self._library.labels.index(self._answer))
        return read_only(posterior)

    def _set(self, memory: TaskMemory) -> None:
        self.memory = memory
        self.ratio: Floats | None = None
        library = self._library
        if self._fixed_prior is not None:
            self.prior = self._fixed_prior
            return
        self.prior = library.task_prior
        if self.progress is not None:
            planned = self.progress.next_tasks()
            self.prior = HABIT_TRUST * planned + (1.0 - HABIT_TRUST) * library.task_prior
        elif self._transitions:
            self.prior = next_task_prior(library.transition_prior, memory, library.task_prior)
        if self._step in library.labels:
            step = np.eye(library.n_tasks)[library.labels.index(self._step)]
            self.prior = HABIT_TRUST * step + (1.0 - HABIT_TRUST) * self.prior
        if not np.allclose(self.prior, library.task_prior, rtol=1e-12, atol=0.0):
            self.ratio = self.prior / np.maximum(library.task_prior, 1e-300)
