# SPDX-License-Identifier: Apache-2.0
"""A plan that a person changes: each function returns another plan, or says why there is none."""

from dataclasses import replace

import numpy as np

from intent_recognition.errors import ArgumentError
from intent_recognition.plans.work_plan import LIKELY_BEFORE, WorkPlan, covering


def ordered(plan: WorkPlan, first: str, then: str, must: bool) -> WorkPlan:
    """A step must come before another, or need not; what else is known of the order stays.

    Raises:
        ArgumentError: no such step, or the steps would wait for one another.
    """
    i, j = _place(plan, first), _place(plan, then)
    before = plan.before.copy()
    by_hand = {**plan.by_hand, (first, then): float(must)}
    before[i, j] = must
    if must and before[j, i] > 0.0:
        before[j, i] = by_hand[then, first] = 0.0
    names = plan.names
    order = {
        (names[a], names[b]): float(before[a, b])
        for a, b in np.argwhere(covering(before) > 0.0)
        if (names[a], names[b]) not in by_hand
    }
    return replace(plan, order=order, by_hand=by_hand)


def moved(plan: WorkPlan, step: str, places: int) -> WorkPlan:
    """A step so many places later, or earlier; steps that it passes and that waited for it, or it
    for them, do so the other way round.

    Raises:
        ArgumentError: no such step, or the steps would wait for one another.
    """
    k = _place(plan, step)
    to = min(max(k + places, 0), len(plan.steps) - 1)
    passed = range(k - 1, to - 1, -1) if to < k else range(k + 1, to + 1)
    steps = [one for one in plan.steps if one.name != step]
    steps.insert(to, plan.steps[k])
    out = replace(plan, steps=tuple(steps))
    for other in passed:
        first, then = (step, plan.names[other]) if to < k else (plan.names[other], step)
        if plan.before[_place(plan, then), _place(plan, first)] > LIKELY_BEFORE:
            out = ordered(out, first, then, True)
    return out


def required(plan: WorkPlan, step: str) -> WorkPlan:
    """A step is part of every assembly.

    Raises:
        ArgumentError: no such step.
    """
    k = _place(plan, step)
    steps = (*plan.steps[:k], replace(plan.steps[k], share=1.0), *plan.steps[k + 1 :])
    return replace(plan, steps=steps)


def without(plan: WorkPlan, step: str) -> WorkPlan:
    """A step is part of no assembly; what waited for it waits for what it waited for.

    Raises:
        ArgumentError: no such step, or it is the only one.
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
