# SPDX-License-Identifier: Apache-2.0
"""Learns a plan from a few assemblies: their steps, and the posterior of the steps' partial order.

The model generates an assembly step by step: with probability 1 - e the next step is drawn
uniformly from the steps whose predecessors are done, and with probability e from all remaining
steps (the queue-jumping error of Nicholls and Muir Watt 2011, Jiang, Nicholls and Lee 2023). A
relation that never excluded a possible step gains no likelihood; one that excluded several and was
still kept gains by their number. A priori each further relation makes an order a bit less probable.
Metropolis-Hastings samples the posterior by adding or removing one relation at a time; the result
is the probability of each relation "i must be done before j" (Mannila and Meek 2000 learn one such
order; Beerenwinkel, Eriksson and Sturmfels 2007 learn one with errors).

Preferences for the next step are learned from the choices among the steps that were possible; a
step without alternative says nothing about them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.plans.file import Assembly
from intent_recognition.plans.work_plan import (
    FOLLOWS,
    LIKELY_BEFORE,
    SURE,
    USUAL_SLIP,
    Pair,
    WorkPlan,
    WorkStep,
    listed,
)

JUMPS = USUAL_SLIP
ORDER_ODDS = 0.7
"""Prior odds of each relation in an order (docs/plans.md)."""
N_SAMPLES = 20_000
"""Length of the Markov chain, of which the first fifth is discarded (docs/plans.md)."""
SLIP_WEIGHT = 30.0
"""Number of movements that the prior of USUAL_SLIP is worth: two or three assemblies."""

CHOICES, PREFERRED = 0.25, 1.2
"""Number of choices that the prior of a strength is worth, and strength above which a preference is
stored: the best of the values tried, with a log loss of 0.7 of the table's (docs/plans.md)."""

Occurrence = tuple[str, int]
"""A task and the number of its occurrence in an assembly, from 1."""


def learn_plan(
    assemblies: Sequence[Assembly],
    rng: np.random.Generator,
    by_hand: Mapping[Pair, float] | None = None,
) -> WorkPlan:
    """Learn the plan of an assembly from a few demonstrations.

    A task is a step if at least half of the assemblies contain it, and a further step for each
    repetition that more than half contain. Further occurrences count as slips: a repeated step, or
    one done in vain before its last time.

    Relations written by hand are kept, except those of steps that no longer exist; the others are
    learned given those that must hold.

    Raises:
        ArgumentError: no task is in at least half of the assemblies.
    """
    done = [assembly for assembly in assemblies if assembly]
    found = _occurrences([[one.task for one in assembly] for assembly in done])
    places = _places(found)
    steps = sorted(places, key=lambda step: (places[step], step))
    if not steps:
        cure = "Give whole assemblies of one thing, with labelled tasks (docs/plans.md)."
        got = f"none in {len(done)} assemblies"
        raise ArgumentError.about("assemblies", "a task that half of them hold", got, cure)
    number = {step: k for k, step in enumerate(steps)}
    sequences = [[number[step] for step in one if step is not None] for one in found]
    names = [task if k == 1 else f"{task} {k}" for task, k in steps]
    kept = {pair: p for pair, p in (by_hand or {}).items() if set(pair) <= set(names)}
    must = [(names.index(i), names.index(j)) for (i, j), p in kept.items() if p > LIKELY_BEFORE]
    before = np.minimum(sample_orders(sequences, len(steps), rng, N_SAMPLES, must), SURE)
    liked = habits(sequences, before)
    relations = listed(names, np.where(before < FOLLOWS, 0.0, before))
    total = sum(map(len, found))
    slips = sum(step is None for one in found for step in one) / 2.0
    rate = round((slips + USUAL_SLIP * SLIP_WEIGHT) / (total + SLIP_WEIGHT), 4)
    return WorkPlan(
        tuple(
            replace(_step(name, step, done, found), after=_listed(names, liked[:, k]))
            for k, (name, step) in enumerate(zip(names, steps, strict=True))
        ),
        {pair: float(np.round(p, 3)) for pair, p in relations.items() if pair not in kept},
        kept,
        repeated=rate,
        wrong=rate,
        n_assemblies=len(done),
    )


def habits(sequences: Sequence[Sequence[int]], before: Floats) -> Floats:
    """Preference for each step (columns) after each step or at the start (rows), (n + 1, n).

    By Luce's choice axiom (1959), each possible step is chosen in proportion to its strength. The
    result is the posterior mode under a gamma prior with mode 1 that is worth `CHOICES` choices
    (the minorisation of Hunter 2004, with the prior of Caron and Doucet 2012).
    """
    undone, drawn, previous = _Draws.of(sequences, len(before))
    offered = undone * np.exp(undone @ np.log1p(-before))
    chosen, last = np.eye(len(before))[drawn], np.eye(len(before) + 1)[previous]
    strength = np.ones((len(before) + 1, len(before)))
    for _ in range(50):
        total = np.sum((last @ strength) * offered, axis=1, keepdims=True)
        strength = (CHOICES + last.T @ chosen) / (CHOICES + last.T @ (offered / total))
    return strength


def _listed(names: Sequence[str], strength: Floats) -> dict[str, float]:
    """Strengths (n + 1,) by the previous step, without those below `PREFERRED`."""
    pairs = zip((*names, ""), strength.tolist(), strict=True)
    return {name: round(one, 2) for name, one in pairs if one > PREFERRED}


def _occurrences(tasks: Sequence[Sequence[str]]) -> list[list[Occurrence | None]]:
    """Step that each movement does; None if it does none."""
    counts = [Counter(one) for one in tasks]
    n = len(tasks)
    often = {
        task: sum(
            2 * sum(c[task] >= k for c in counts) > n - (k == 1)
            for k in range(1, max(c[task] for c in counts) + 1)
        )
        for task in sorted(set().union(*counts))
    }
    out: list[list[Occurrence | None]] = []
    for one, count in zip(tasks, counts, strict=True):
        seen: Counter[str] = Counter()
        steps: list[Occurrence | None] = []
        for task in one:
            seen[task] += 1
            k = seen[task] - max(count[task] - often[task], 0)
            steps.append((task, k) if k >= 1 else None)
        out.append(steps)
    return out


def _places(found: Sequence[Sequence[Occurrence | None]]) -> dict[Occurrence, float]:
    """Mean position of each step in the assemblies, in [0, 1)."""
    places: dict[Occurrence, list[float]] = {}
    for one in found:
        for at, step in enumerate(one):
            if step is not None:
                places.setdefault(step, []).append(at / len(one))
    return {step: float(np.mean(at)) for step, at in places.items()}


def _step(
    name: str,
    step: Occurrence,
    assemblies: Sequence[Assembly],
    found: Sequence[Sequence[Occurrence | None]],
) -> WorkStep:
    records = [
        assembly[one.index(step)]
        for assembly, one in zip(assemblies, found, strict=True)
        if step in one
    ]
    # Beta prior: one assembly in ten omits a step
    share = (len(records) + 1.0) / (len(assemblies) + 1.0 + 0.1)
    people = Counter(record.who for record in records if record.who)
    used = [record.objects for record in records if record.objects]
    objects: Counter[str] = Counter()
    for one in used:
        objects.update(one)
    durations = [record.duration_s for record in records if record.duration_s > 0.0]
    return WorkStep(
        name,
        step[0],
        round(share, 3),
        {who: round(n / people.total(), 3) for who, n in sorted(people.items())},
        {kind: round(n / len(used), 2) for kind, n in sorted(objects.items())},
        round(float(np.median(durations)), 2) if durations else 0.0,
    )


class _Draws(NamedTuple):
    """Each step of the assemblies as a draw (T,) from the undone steps, marked by 1 in (T, n)."""

    undone: Floats
    drawn: Integers
    previous: Integers  # previous step; -1 at the start of an assembly

    @classmethod
    def of(cls, sequences: Sequence[Sequence[int]], n: int) -> _Draws:
        """Draws of assemblies, given as sequences of step numbers below n."""
        undone = np.zeros((sum(map(len, sequences)), n))
        drawn = np.array([step for one in sequences for step in one], dtype=np.int64)
        t = 0
        for one in sequences:
            for k in range(len(one)):
                undone[t, list(one[k:])] = 1.0
                t += 1
        previous = np.array([step for one in sequences for step in (-1, *one[:-1])], np.int64)
        return cls(undone, drawn, previous)

    def log_posterior(self, order: Floats) -> float:
        """Log probability of a partial order (n, n), 1 where i is before j, up to a constant."""
        possible = self.undone * (self.undone @ order < 0.5)
        in_turn = possible[np.arange(len(self.drawn)), self.drawn] / possible.sum(axis=1)
        p = (1.0 - JUMPS) * in_turn + JUMPS / self.undone.sum(axis=1)
        return float(np.log(p).sum() + np.log(ORDER_ODDS) * order.sum())


def sample_orders(
    sequences: Sequence[Sequence[int]],
    n: int,
    rng: np.random.Generator,
    n_samples: int,
    must: Sequence[tuple[int, int]] = (),
) -> Floats:
    """Posterior probability that step i must be done before step j, (n, n).

    Each sequence holds an assembly's step numbers, below n, each at most once. The pairs of steps
    `must` are known to be in the order. The Markov chain of `n_samples` steps starts with them and
    the relations that every assembly keeps.
    """
    draws = _Draws.of(sequences, n)
    order = _first_order(sequences, n, must)
    now = draws.log_posterior(order)
    total = np.zeros((n, n))
    pairs, limits = rng.integers(n, size=(n_samples, 2)), np.log(rng.random(n_samples))
    for t, (i, j) in enumerate(pairs.tolist()):
        if (i, j) not in must and _may_change(order, i, j):
            order[i, j] = 1.0 - order[i, j]
            then = draws.log_posterior(order)
            if limits[t] < then - now:
                now = then
            else:
                order[i, j] = 1.0 - order[i, j]
        if 5 * t >= n_samples:
            total += order
    return total / max(n_samples - n_samples // 5, 1)


def _may_change(order: Floats, i: int, j: int) -> bool:
    """Whether adding or removing only the relation of i to j leaves a partial order."""
    if i == j or order[j, i]:
        return False
    if order[i, j]:
        return not np.any(order[i] * order[:, j])
    return not (np.any(order[:, i] > order[:, j]) or np.any(order[j] > order[i]))


def _first_order(
    sequences: Sequence[Sequence[int]], n: int, must: Sequence[tuple[int, int]]
) -> Floats:
    """Partial order (n, n) of the pairs `must` and of those that every assembly with both keeps."""
    seen = np.zeros((n, n))
    for one in sequences:
        for k, step in enumerate(one):
            seen[step, list(one[k + 1 :])] += 1.0
    order, single = np.zeros((n, n)), np.eye(n)
    for i, j in (*must, *np.argwhere((seen > 0.0) & (seen.T == 0.0)).tolist()):
        if not order[j, i]:
            np.maximum(order, np.outer(order[:, i] + single[i], order[j] + single[j]), out=order)
    return order
