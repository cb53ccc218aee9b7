# SPDX-License-Identifier: Apache-2.0
"""Progress of an assembly: a belief over the sets of done steps, and predictions of the next task.

The belief is a list of sets of done steps with their probabilities. From a set s, the next movement

- does step i with probability proportional to share_i prod_j (1 - before_ji present_j) over the
  undone steps j: each step that must come before i must be done, or omitted in this assembly;
- does no step: it repeats one, or is wrong;
- or begins the next assembly, if the undone steps are usually omitted.

An undone step counts as omitted once a step that needs it is done, and then blocks nothing:
present_j = share_j (1 - p(omitted)). A movement recognised as task k with probability p(k) updates
the belief to sum_k p(k) p(s' | k). Later steps can thus correct a misrecognised one (this is the
filter of a hidden Markov model whose states are sets).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.plans.work_plan import USUAL_SLIP, WorkPlan

MOST_SHARE = 0.995
"""Largest share of assemblies in which a step is done; with 1 it could never count as forgotten.
After two assemblies, with all relations set by hand, 21 of 23 forgotten steps are reported with
learned shares, and none with shares of 1 (`benchmarks/plans.py`, seeds 0 to 14). Learned shares
exceed the limit only after more than eighteen assemblies."""

OPTIONAL = 2.0 / 3.0
"""Share of assemblies below which a step never counts as forgotten: it is left out too often."""


class StepState(NamedTuple):
    """Belief about one step."""

    name: str
    task: str
    done: float  # probability that it is done
    next: float  # probability that the next movement does it
    # probability that it was omitted although a step that needs it is done; 0 if it is optional
    forgotten: float

    def __str__(self) -> str:
        if self.done >= 0.5:
            return "done"
        if self.forgotten >= 0.4:  # docs/plans.md
            return "forgotten"
        return "may come" if self.next >= 0.1 else "later"


class WorkProgress:
    """Follows an assembly from movement to movement; `n_taken` counts the movements so far.

    `plan` lacks the steps whose tasks are not among the K recognised labels.

    Raises:
        ArgumentError: the plan has no step with one of these tasks.
    """

    def __init__(self, plan: WorkPlan, labels: Sequence[str]):
        self.plan, self.labels = plan.of(labels), tuple(labels)
        if not self.plan.steps:
            tasks = ", ".join(sorted({step.task for step in plan.steps}))
            cure = "Learn the plan from sessions with the labels of the model."
            raise ArgumentError.about("plan", f"steps of {', '.join(labels)}", tasks, cure)
        steps = self.plan.steps
        self._task = np.array([self.labels.index(step.task) for step in steps], dtype=np.int64)
        self._of_task = np.eye(len(labels))[self._task]
        self._share = np.minimum([step.share for step in steps], MOST_SHARE)
        names = (*self.plan.names, "")
        self._after = np.array([[step.after.get(name, 1.0) for step in steps] for name in names])
        # Laplace: without a relation, an order not seen in N assemblies has probability 1 / (N + 2)
        q, by_chance = self.plan.before, 1.0 / (self.plan.n_assemblies + 2.0)
        self._log_in_order = np.log1p(-q * USUAL_SLIP / (q * USUAL_SLIP + (1.0 - q) * by_chance))
        self.reset()

    def changed(self, plan: WorkPlan, labels: Sequence[str]) -> WorkProgress:
        """Continue under another plan or other labels; steps of the same name stay done.

        Raises:
            ArgumentError: the plan has no step with one of these tasks.
        """
        out = WorkProgress(plan, labels)
        place = {name: k for k, name in enumerate(self.plan.names)}
        kept = [place.get(name, -1) for name in out.plan.names]
        out.n_taken, last = self.n_taken, np.append(self._last[:-1], 0.0)[kept]
        out._last = np.append(last, 1.0 - last.sum())
        out._keep(np.pad(self._done, ((0, 0), (0, 1)))[:, kept], self._weight)
        return out

    def reset(self) -> None:
        """Start a new assembly, with no step done."""
        self.n_taken = 0
        self._done = np.zeros((1, len(self._task)), dtype=bool)
        self._weight = np.ones(1)
        self._last = np.eye(len(self._after))[-1]  # last step, or none yet, (n + 1,)

    def next_tasks(self) -> Floats:
        """Probability that the next movement does each task, (K,); sums to one."""
        step, anew, idle = self._choice()
        p = self._weight @ (step @ self._of_task + anew @ self._of_task + idle)
        return np.asarray(p / p.sum())

    def take(self, probabilities: Floats) -> None:
        """Update the belief with a completed movement.

        `probabilities` (K + 1,) of the K tasks and none already include the plan's prior.
        """
        self.n_taken += 1
        n = len(self._task)
        step, anew, idle = self._choice()
        gain = probabilities[:-1] / np.maximum(self.next_tasks(), 1e-300)
        single, w = np.eye(n, dtype=bool), self._weight
        sets = (self._done[:, None] | single).reshape(-1, n), single, self._done
        weights = (
            (w[:, None] * step * gain[self._task]).ravel(),
            (w @ anew) * gain[self._task],
            w * (idle @ gain + probabilities[-1]),
        )
        self._keep(np.concatenate(sets), np.concatenate(weights))
        did = weights[0].reshape(-1, n).sum(axis=0) + weights[1]
        last = np.append(did, 0.0) + weights[2].sum() * self._last
        if last.any():
            self._last = last / last.sum()

    def _keep(self, sets: Flags, weights: Floats) -> None:
        done, where = np.unique(sets, axis=0, return_inverse=True)
        weight = np.bincount(where.ravel(), weights, minlength=len(done))
        best = np.argsort(-weight, kind="stable")[:128]
        if weight.any():  # else an impossible movement: keep the belief
            self._done, self._weight = done[best], weight[best] / weight[best].sum()

    def steps(self) -> tuple[StepState, ...]:
        """Belief about each step, in the order of the plan."""
        step, anew, _ = self._choice()
        columns = (
            self._weight @ self._done,
            self._weight @ (step + anew),
            self._weight @ self._left_out(self._done) * (self._share >= OPTIONAL),
        )
        return tuple(
            StepState(one.name, one.task, *map(float, row))
            for one, row in zip(self.plan.steps, zip(*columns, strict=True), strict=True)
        )

    def _left_out(self, done: Flags) -> Floats:
        """Probability that each step was omitted, given sets of done steps, (M, n)."""
        needed = 1.0 - np.exp(done.astype(np.float64) @ self._log_in_order.T)
        return np.asarray(needed * ~done)

    def _due(self, done: Flags, liked: Floats) -> Floats:
        """Probability of each next step, given sets of done steps, (M, n), or all zero."""
        left_out = self._left_out(done)
        present = self._share * (1.0 - left_out) * ~done
        log_free = np.log1p(-self.plan.before * present[:, :, None]).sum(axis=1)
        weight = np.exp(log_free) * self._share * ~done * liked
        return np.asarray(weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-300))

    def _choice(self) -> tuple[Floats, Floats, Floats]:
        """Probabilities of the next movement by set; each row of the three arrays sums to one.

        The movement is a step (M, n), the first step of the next assembly (M, n), or no step, but a
        task (M, K).
        """
        plan, done = self.plan, self._done
        begun = np.any(done, axis=1, keepdims=True)
        absent = 1.0 - self._share * (1.0 - self._left_out(done))
        over = begun * np.prod(np.where(done, 1.0, absent), axis=1, keepdims=True)
        known = 1.0 - plan.wrong - plan.repeated * begun
        again = done @ self._of_task
        again = plan.repeated * again / np.maximum(again.sum(axis=1, keepdims=True), 1.0)
        into = self._due(done, self._last @ self._after)
        fresh = self._due(np.zeros_like(done[:1]), self._after[-1])
        step, anew = known * (1.0 - over) * into, known * over * fresh
        rest = np.maximum(1.0 - (step + anew).sum(axis=1) - again.sum(axis=1), 0.0)
        undone = (~done).astype(np.float64) @ self._of_task
        vain = np.where(undone > 0.0, 0.1, 1.0)  # undone tasks are seldom done in vain
        return step, anew, again + rest[:, None] * vain / vain.sum(axis=1, keepdims=True)
