# SPDX-License-Identifier: Apache-2.0
"""Simulated assemblies: branches of steps that people do in any order that parts allow.

It knows nothing of `intent_recognition.plans`: a person stays in a branch or turns to another one,
and now and then leaves a step out, does one twice, or does what is of no use.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

FOREIGN = "tidy_up"
"""A task that belongs to no assembly."""


class Job(NamedTuple):
    """What is to be built.

    Attributes:
        labels: task of each step; some tasks are done twice.
        needs: which steps must be done before each.
        branch: number of the branch of each.
    """

    labels: tuple[str, ...]
    needs: tuple[frozenset[int], ...]
    branch: tuple[int, ...]


class Act(NamedTuple):
    """What a person does.

    Attributes:
        label: the task.
        step: number of the step that it does; -1 where it does none.
        allowed: labels of the steps that could have come, as far as anybody can see: also of those
            that were left out and may be made up for.
        missing: steps that are needed for it, and were left out.
    """

    label: str
    step: int
    allowed: frozenset[str]
    missing: frozenset[int]


def make_job(rng: np.random.Generator, twice: bool = True) -> Job:
    """A base, three or four branches of 8 to 12 steps in all, and often a lid that closes them."""
    n, n_branches = int(rng.integers(8, 13)), int(rng.integers(3, 5))
    lid = bool(rng.random() < 0.7)
    branch = [
        0,
        *(1 + rng.permutation(np.arange(n - 1 - lid) % n_branches)),
        *[n_branches + 1] * lid,
    ]
    labels = [f"task_{k:02d}" for k in rng.permutation(n)]
    needs: list[set[int]] = []
    for k in range(n):
        before = [j for j in range(k) if branch[j] == branch[k]]
        needs.append(set(range(k)) if branch[k] > n_branches else {0} - {k} | set(before))
    j, k = sorted(rng.choice(np.arange(1, n - lid), 2, replace=False))
    needs[k] |= {int(j), *needs[j]}  # one branch waits for another
    for k in range(1, n):
        needs[k] |= set().union(*(needs[j] for j in needs[k]))
    if twice:
        pairs = [(j, k) for k in range(n) for j in needs[k] if j]
        j, k = pairs[int(rng.integers(len(pairs)))]
        labels[k] = labels[j]
    return Job(tuple(labels), tuple(map(frozenset, needs)), tuple(int(b) for b in branch))


def build(
    rng: np.random.Generator, job: Job, slips: float = 0.02, stay: float = 0.5
) -> Iterator[Act]:
    """One assembly.

    Args:
        rng: random numbers.
        job: what is built.
        slips: probability, at each step, of leaving it out; of doing the last one again; and of
            doing something of no use.
        stay: probability of going on in the branch of the step before, where that can be.
    """
    done: set[int] = set()
    left_out: set[int] = set()
    last = -1
    steps = set(range(len(job.labels)))
    while steps - done - left_out:
        allowed = [k for k in steps - done - left_out if job.needs[k] <= done | left_out]
        names = frozenset(job.labels[k] for k in {*allowed, *left_out})
        if left_out and rng.random() < 0.15:  # remembered: done after all
            step = left_out.pop()
            done.add(step)
            yield Act(job.labels[step], step, names, frozenset())
            continue
        near = [k for k in allowed if last >= 0 and job.branch[k] == job.branch[last]]
        some = near if near and rng.random() < stay else allowed
        step = int(rng.choice(some))
        slip = rng.random() / slips if slips else 9.0
        if slip < 1.0:
            left_out.add(step)
            continue
        if slip < 2.0 and last >= 0:
            yield Act(job.labels[last], -1, names, frozenset())
            continue
        if slip < 3.0:
            useless = [job.labels[k] for k in steps - done - left_out if k not in allowed]
            yield Act(str(rng.choice([*useless, FOREIGN])), -1, names, frozenset())
            continue
        done.add(step)
        last = step
        yield Act(job.labels[step], step, names, frozenset(job.needs[step] & left_out))
