# SPDX-License-Identifier: Apache-2.0
"""The transition prior: p(s) of the next movement, learned from recorded sequences of tasks.

It is a first-order Markov chain over tasks. The memory is a belief over the last task, not a
decision. After each movement,

    belief'(k) = p(k) + p(none) belief(k)

with the task posterior p of the movement: an unknown movement leaves the memory unchanged, and an
ambiguous one counts for several tasks. The prior of the next movement is

    p(s) = trust sum_k belief(k) T(k, s) + (1 - trust) p0(s)

with the task prior p0, since people do not always follow habits. The last row of T, and the last
entry of the belief, stand for "no last task": at the beginning of a session, after a reset, or
after a long silence. If a plan is followed (`plans`), it determines the first term.

An expectation may raise the total probability of the known tasks, but never lower it. If the
movement is not the expected task, none keeps the probability that it has without the habit, so that
an unexpected task is not taken for an unknown movement.
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
"""Time after the end of a movement at which the last task is forgotten [s]."""
HABIT_TRUST = 0.8
"""Share of the learned habit in p(s); the rest is the task prior (docs/anticipation.md)."""
COMPLETED_PHASE = 0.9
"""Least expected phase at the end of a completed movement; an incomplete one is no last task."""


class TaskMemory(NamedTuple):
    """Memory of past movements."""

    belief: Floats  # probabilities of the last task, and of "no last task" at the end, (K + 1,)
    ended_ns: int = 0  # stamp at which the last movement ended; 0 if there was none

    @classmethod
    def empty(cls, n_tasks: int) -> "TaskMemory":
        """Memory of no last task."""
        belief = np.zeros(n_tasks + 1)
        belief[-1] = 1.0
        return cls(belief)

    @property
    def is_empty(self) -> bool:
        """Whether nothing is remembered."""
        return bool(self.belief[-1] >= 1.0)

    def last_task(self, labels: Sequence[str]) -> str:
        """Label of the most probable last task; empty if "no last task" is more probable."""
        best = int(np.argmax(self.belief))
        return labels[best] if best < len(labels) else ""

    def relabelled(self, before: Sequence[str], after: Sequence[str]) -> "TaskMemory":
        """The memory over other labels; a task that is not among them becomes "no last task"."""
        belief = np.zeros(len(after) + 1)
        for label, p in zip((*before, None), self.belief, strict=True):
            belief[after.index(label) if label in after else -1] += p
        return TaskMemory(belief, self.ended_ns)


def remember(memory: TaskMemory, probabilities: Floats, phase: Floats, ended_ns: int) -> TaskMemory:
    """Memory after a movement; one that was not completed changes only the time.

    `probabilities` and `phase` (expected) are those of the K tasks and none at its end, (K + 1,).
    """
    p = _completed(probabilities, phase)
    belief = p[-1] * memory.belief
    belief[:-1] += p[:-1]
    return TaskMemory(belief / belief.sum(), ended_ns)


def _completed(probabilities: Floats, phase: Floats) -> Floats:
    """Probabilities of a movement, with those of incomplete tasks added to none."""
    p = np.where(np.asarray(phase) >= COMPLETED_PHASE, probabilities, 0.0)
    p[-1] = 1.0 - p[:-1].sum()
    return p


def next_task_prior(
    transition_prior: Floats, memory: TaskMemory, task_prior: Floats, trust: float = HABIT_TRUST
) -> Floats:
    """Probabilities p(s) of the next movement, (K,), which sum to one.

    They mix p(next | last), (K + 1, K), with share `trust` in [0, 1], and p0(s), (K,).
    """
    possible = np.flatnonzero(memory.belief > 1e-9)  # few, even of thousands of tasks
    prior = memory.belief[possible] @ transition_prior[possible]
    return trust * prior / prior.sum() + (1.0 - trust) * task_prior


def weigh(posterior: TaskPosterior, ratio: Floats) -> TaskPosterior:
    """Posterior under another prior p(s), given the one under p0(s); `ratio` is p(s) / p0(s), (K,).

    The probability of none never increases.
    """
    known = posterior.probabilities[:-1] * ratio
    total = known.sum()
    if not total > 0.0:
        return posterior
    shared = posterior.probabilities[:-1].sum()
    p = np.r_[known * max(1.0, shared / total), posterior.probabilities[-1]]
    return posterior._replace(probabilities=p / p.sum())


class Expectation:
    """Prior of the next task, updated from one movement to the next.

    Args:
        library: the learned tasks, with their transition prior.
        fixed_prior: p(s), (K,), for every movement; None for the learned prior.
        transitions: use the transition prior; else p(s) is the library's task prior.
        forget_after_s: see FORGET_AFTER_S.

    Attributes:
        memory: memory of past movements.
        prior: p(s) of the next movement, (K,).
        ratio: factors of the known tasks' posterior in `weigh`, (K,); None if all are one.
        progress: progress of the assembly if a plan is followed; else None.
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
        """Expect the possible next steps of a plan; None to follow no plan.

        Steps of the last plan that are done stay done, by name. Time does not end an assembly.

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

    def share(self, progress: WorkProgress, *, at_once: bool) -> None:
        """Use the progress of an assembly that several people share; `at_once` as in `expect`."""
        self.progress = progress
        if at_once:
            self._set(self.memory)

    def expect(self, task: str, *, at_once: bool) -> None:
        """Expect a task next, with the trust of a habit; empty for the learned prior.

        A task that was not learned has the same effect as an empty one. With `at_once`, the
        expectation holds from now on, else after the movement under way.
        """
        self._step = task
        if at_once:
            self._set(self.memory)

    def answer(self, task: str) -> None:
        """Use a person's answer about the task of the movement under way, until it ends.

        Raises:
            ArgumentError: there is no such task.
        """
        if task not in self._library.labels:
            cure = "Name a task of the model."
            raise ArgumentError.about("answer", f"one of {self._library.labels}", repr(task), cure)
        self._answer = task

    @property
    def last_task(self) -> str:
        """Label of the most probable last task; empty if there is none."""
        return self.memory.last_task(self._library.labels)

    def reset(self) -> None:
        """Forget the last task and the progress in the plan."""
        if self.progress is not None and self._plan is not None:  # a new one: others may share it
            self.progress = WorkProgress(self._plan, self._library.labels)
        self._answer = ""
        self._set(TaskMemory.empty(self._library.n_tasks))

    def remember(self, ended_ns: int, posterior: TaskPosterior) -> None:
        """Update memory and progress after a movement has ended."""
        self._answer = ""
        if self.progress is not None:
            self.progress.take(_completed(posterior.probabilities, posterior.phase))
        self._set(remember(self.memory, posterior.probabilities, posterior.phase, ended_ns))

    def forget_if_long_ago(self, now_ns: int) -> None:
        """Forget the last task if it ended more than `forget_after_s` ago."""
        since_s = (now_ns - self.memory.ended_ns) * 1e-9
        if not self.memory.is_empty and since_s > self._forget_after_s:
            self._set(TaskMemory.empty(self._library.n_tasks))

    def swap(self, library: TaskLibrary, fixed_prior: Floats | None) -> None:
        """Switch to another library."""
        if self.progress is not None and self._plan is not None:
            self.progress = self.progress.changed(self._plan, library.labels)
        memory = self.memory.relabelled(self._library.labels, library.labels)
        self._library, self._fixed_prior = library, fixed_prior
        self._set(memory)

    def change(self, transitions: bool, forget_after_s: float) -> None:
        """Change the settings from now on; see the arguments of the class."""
        self._transitions, self._forget_after_s = transitions, forget_after_s
        self._set(self.memory)

    def weigh(self, posterior: TaskPosterior) -> TaskPosterior:
        """Posterior of the movement under way, given the expectation and a person's answer."""
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
