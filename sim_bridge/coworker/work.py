# SPDX-License-Identifier: Apache-2.0
"""A worker who follows a work plan: any step may be next whose predecessors are done."""

import numpy as np

from intent_recognition.plans import WorkPlan

REQUIRED = 0.5
"""Probability from which on a relation of the plan is kept. Convention."""


def work_order(plan: WorkPlan, seed: int) -> tuple[str, ...]:
    """The tasks of one assembly, each step once, in an order that the plan allows.

    Of the steps that may be next each is as probable as the others.
    """
    rng = np.random.default_rng([seed, 23])
    before = plan.before > REQUIRED
    left = list(range(len(plan.steps)))
    tasks = []
    while left:
        due = [k for k in left if not before[left, k].any()]
        step = int(rng.choice(due))
        left.remove(step)
        tasks.append(plan.steps[step].task)
    return tuple(tasks)
