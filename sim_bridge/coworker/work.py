# SPDX-License-Identifier: Apache-2.0
"""A worker who follows a work plan: any step may be next whose predecessors are done."""

import numpy as np

from intent_recognition.plans import WorkPlan

REQUIRED = 0.5
"""Probability from which on a relation of the plan is kept. Convention."""


def work_shares(
    plan: WorkPlan, seed: int, n_people: int, n_steps: int = 0
) -> tuple[tuple[str, ...], ...]:
    """The tasks of each of several people who share an assembly, or its first steps.

    At any time each of them does a step that may be next, as long as there are so many; who has
    done the fewest is the first to take one. Each such step is as probable as the others.

    Args:
        plan: of the assembly.
        seed: of the order.
        n_people: who share it.
        n_steps: how many steps; 0: all.
    """
    rng = np.random.default_rng([seed, 23])
    before = plan.before > REQUIRED
    left = list(range(len(plan.steps)))
    most = len(left) - (n_steps or len(left))
    shares: list[list[str]] = [[] for _ in range(n_people)]
    while len(left) > most:
        due = [k for k in left if not before[left, k].any()]
        for share in sorted(shares, key=len)[: len(left) - most]:
            if due:
                step = due.pop(due.index(int(rng.choice(due))))
                left.remove(step)
                share.append(plan.steps[step].task)
    return tuple(map(tuple, shares))
