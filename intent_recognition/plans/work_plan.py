# SPDX-License-Identifier: Apache-2.0
"""Plan of an assembly: its steps, their partial order, and changes by a person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, nearest
from intent_recognition.untrusted import YamlChecks

CHECKS = YamlChecks("docs/plans.md describes plans.")

SURE = 1.0 - 1e-6
"""Largest probability that a step must come before another; keeps logarithms finite."""
USUAL_SLIP = 0.03
"""Default share of movements that repeat a step, do no step, or do a step before its turn."""
FOLLOWS = 0.05
"""Relations are listed only if their probability is at least this, and exceeds what other relations
imply by at least this: two digits show no smaller difference."""

LIKELY_BEFORE = 0.5
"""Probability above which a step counts as one that must come before another."""

Pair = tuple[str, str]


@dataclass(frozen=True)
class WorkStep:
    """One step of an assembly.

    Attributes:
        name: unique name: the task, with a number if it is repeated ("screw 2").
        share: share of assemblies in which it is done, in (0, 1].
        who: share of each person or robot in the recorded executions of the step.
        objects, duration_s: mean number of objects of each kind, and median time; 0 if unknown.
        after: strength of the preference to choose it right after each named step; 1 is neutral.
    """

    name: str
    task: str
    share: float = 1.0
    who: Mapping[str, float] = field(default_factory=dict)
    objects: Mapping[str, float] = field(default_factory=dict)
    duration_s: float = 0.0
    after: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class WorkPlan:
    """Plan of an assembly: a partial order of steps, each relation with its probability.

    Attributes:
        steps: the steps, in a usual order.
        order: learned probability that the first step of a pair must be done before the second;
            relations implied by others are left out.
        by_hand: relations written by a person: 1 for must, 0 for need not. They override `order`,
            also where it has the two steps the other way round.
        repeated, wrong: probability that a movement repeats a done step, or does no step.

    Raises:
        ArgumentError: two steps have the same name, a relation names no step or closes a cycle, or
            a number is not a probability.
    """

    steps: tuple[WorkStep, ...]
    order: Mapping[Pair, float] = field(default_factory=dict)
    by_hand: Mapping[Pair, float] = field(default_factory=dict)
    repeated: float = USUAL_SLIP
    wrong: float = USUAL_SLIP
    n_assemblies: int = 0

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.steps):
            CHECKS.refuse("steps", "different names", ", ".join(self.names))
        if len(self.steps) > 60:  # the belief and the sampled orders grow with their square
            CHECKS.refuse("steps", "at most 60", len(self.steps))
        named = [(f"step {step.name}, after", ("", *self.names), step.after) for step in self.steps]
        relations = {name for pair in (*self.order, *self.by_hand) for name in pair}
        for argument, known, used in (("order and by_hand", self.names, relations), *named):
            for name in sorted(set(used).difference(known)):
                cure = nearest(name, self.names, CHECKS.cure)
                expected = f"steps of {', '.join(self.names)}"
                raise ArgumentError.about(argument, expected, repr(name), cure)
        if loops := [first for first, then in (*self.order, *self.by_hand) if first == then]:
            CHECKS.refuse("order and by_hand", "relations of two steps", f"{loops[0]} < {loops[0]}")
        for name, p in (
            *((step.name, step.share) for step in self.steps),
            *((" < ".join(pair), p) for pair, p in (*self.order.items(), *self.by_hand.items())),
            ("repeated", self.repeated),
            ("wrong", self.wrong),
            ("repeated and wrong", self.repeated + self.wrong),
        ):
            if not 0.0 <= p <= 1.0:
                CHECKS.refuse(name, "a probability in [0, 1]", p)
        circle = np.argwhere(np.minimum(self.before, self.before.T) > LIKELY_BEFORE)
        if circle.size:
            names = [self.names[k] for k in sorted(set(circle[:, 0]))]
            cure = "Leave out one of the relations between them."
            got = f"one of {', '.join(names)}"
            raise ArgumentError.about("order and by_hand", "no circle", got, cure)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the steps."""
        return tuple(step.name for step in self.steps)

    @cached_property
    def before(self) -> Floats:
        """Probability that step i must be done before step j, (n, n), with implied relations."""
        place = {name: k for k, name in enumerate(self.names)}
        found = np.zeros((len(self.steps), len(self.steps)))
        for (first, then), p in {**self.order, **self.by_hand}.items():
            found[place[first], place[then]] = p
        for j, step in enumerate(self.steps):
            for i in range(j):  # repetitions come in order, unless set by hand
                pair = self.steps[i].name, step.name
                if self.steps[i].task == step.task and pair not in self.by_hand:
                    found[i, j] = 1.0
        for (first, then), p in self.by_hand.items():
            if (then, first) not in self.by_hand:  # of both ways, at most one holds
                i, j = place[then], place[first]
                found[i, j] = min(found[i, j], 1.0 - p)
        found = closure(found)
        for (first, then), p in self.by_hand.items():
            found[place[first], place[then]] = p
        return np.minimum(found, SURE)

    def of(self, labels: Sequence[str]) -> WorkPlan:
        """The plan restricted to steps whose tasks are among the labels."""
        kept = [k for k, step in enumerate(self.steps) if step.task in labels]
        return self if len(kept) == len(self.steps) else self.only(kept)

    def only(self, kept: Sequence[int]) -> WorkPlan:
        """The plan restricted to steps by index, with the order that the others imply."""
        names, before = self.names, self.before
        chosen = {names[k] for k in kept}
        by_hand = {pair: p for pair, p in self.by_hand.items() if chosen.issuperset(pair)}
        order = listed([names[k] for k in kept], before[np.ix_(kept, kept)])
        steps = tuple(
            replace(step, after={k: v for k, v in step.after.items() if k in ("", *chosen)})
            for step in (self.steps[k] for k in kept)
        )
        return replace(self, steps=steps, order=order, by_hand=by_hand)


def closure(before: Floats) -> Floats:
    """Transitive closure of the probabilities that i must come before j, (n, n).

    An implied relation has the probability of its most probable chain of independent links.
    """
    found = before.copy()
    for k in range(len(found)):  # Floyd-Warshall with products instead of sums
        np.maximum(found, np.outer(found[:, k], found[k]), out=found)
    np.fill_diagonal(found, 0.0)
    return found


def covering(before: Floats, tolerance: float = FOLLOWS) -> Floats:
    """Remove the relations that `closure` recovers from the others, up to a tolerance."""
    kept = before.copy()
    for i, j in sorted(np.argwhere(before > 0.0).tolist(), key=lambda pair: before[tuple(pair)]):
        kept[i, j] = 0.0
        if closure(kept)[i, j] < before[i, j] - tolerance:
            kept[i, j] = before[i, j]
    return kept


def listed(names: Sequence[str], before: Floats) -> dict[Pair, float]:
    """The relations of steps by name, without those that follow from the others."""
    kept = covering(before)
    return {(names[i], names[j]): float(kept[i, j]) for i, j in np.argwhere(kept > 0.0)}


def ordered(plan: WorkPlan, first: str, then: str, must: bool) -> WorkPlan:
    """Require that a step comes before another, or allow any order of both; keep all else.

    Raises:
        ArgumentError: there is no such step, or the order would have a cycle.
    """
    i, j = _place(plan, first), _place(plan, then)
    before = plan.before.copy()
    by_hand = {**plan.by_hand, (first, then): float(must)}
    before[i, j] = must
    if must and before[j, i] > 0.0:
        before[j, i] = by_hand[then, first] = 0.0
    order = {pair: p for pair, p in listed(plan.names, before).items() if pair not in by_hand}
    return replace(plan, order=order, by_hand=by_hand)


def moved(plan: WorkPlan, step: str, places: int) -> WorkPlan:
    """Move a step later by `places`, or earlier if negative; reverse the relations that it passes.

    Raises:
        ArgumentError: there is no such step, or the order would have a cycle.
    """
    k = _place(plan, step)
    to = min(max(k + places, 0), len(plan.steps) - 1)
    passed = range(k - 1, to - 1, -1) if to < k else range(k + 1, to + 1)
    steps = [one for one in plan.steps if one.name != step]
    steps.insert(to, plan.steps[k])
    out = plan
    for other in passed:
        first, then = (step, plan.names[other]) if to < k else (plan.names[other], step)
        if plan.before[_place(plan, then), _place(plan, first)] > LIKELY_BEFORE:
            out = ordered(out, first, then, True)
    return replace(out, steps=tuple(steps))


def required(plan: WorkPlan, step: str) -> WorkPlan:
    """Make a step part of every assembly.

    Raises:
        ArgumentError: there is no such step.
    """
    k = _place(plan, step)
    steps = (*plan.steps[:k], replace(plan.steps[k], share=1.0), *plan.steps[k + 1 :])
    return replace(plan, steps=steps)


def without(plan: WorkPlan, step: str) -> WorkPlan:
    """Remove a step; steps that waited for it wait for its predecessors.

    Raises:
        ArgumentError: there is no such step, or it is the only one.
    """
    k = _place(plan, step)
    if len(plan.steps) == 1:
        raise ArgumentError.about("step", "one of several", step, "Follow no plan instead.")
    return plan.only([n for n in range(len(plan.steps)) if n != k])


def _place(plan: WorkPlan, step: str) -> int:
    if step not in plan.names:
        cure = "Look at the plan again: it has changed."
        raise ArgumentError.about("step", f"one of {', '.join(plan.names)}", repr(step), cure)
    return plan.names.index(step)
