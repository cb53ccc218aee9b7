# SPDX-License-Identifier: Apache-2.0
"""Learning a plan: the sampled orders against all orders, and steps against slips."""

from itertools import product

import numpy as np
import pytest
from assemblies import build, make_job

from intent_recognition.errors import ArgumentError
from intent_recognition.plans import DoneTask, learn_plan
from intent_recognition.plans.learning import CHOICES, JUMPS, ORDER_ODDS, habits, sample_orders


def assemblies(*texts):
    return [tuple(map(DoneTask, text.split())) for text in texts]


def exact(sequences, n, must):
    """Posterior of all partial orders of n steps with these pairs, by enumeration and loops."""
    total, weights = np.zeros((n, n)), 0.0
    cells = [(i, j) for i in range(n) for j in range(n) if i != j]
    for bits in product((0, 1), repeat=len(cells)):
        order = {cell for cell, bit in zip(cells, bits, strict=True) if bit}
        if any((j, i) in order for i, j in order) or not order.issuperset(must):
            continue
        if any((i, m) not in order for i, j in order for k, m in order if j == k):
            continue
        weight = ORDER_ODDS ** len(order)
        for one in sequences:
            for t, step in enumerate(one):
                undone = one[t:]
                free = [j for j in undone if not any((i, j) in order for i in undone)]
                weight *= (1 - JUMPS) * (step in free) / len(free) + JUMPS / len(undone)
        weights += weight
        for i, j in order:
            total[i, j] += weight
    return total / weights


@pytest.mark.parametrize(
    ("sequences", "must"),
    [
        ([[0, 1, 2]], ()),
        ([[0, 1, 2], [1, 0, 2]], ()),
        ([[0, 1, 2]] * 3, ()),
        ([[2, 0], [0, 1, 2]], ()),
        ([[3, 1, 0], [1, 2]], ()),
        ([[0, 1, 2]] * 3, ((2, 1), (1, 0))),
    ],
)
def test_sampled_relations_are_those_of_all_orders(sequences, must):
    n = 1 + max(map(max, sequences))
    sampled = sample_orders(sequences, n, np.random.default_rng(0), 60_000, must)
    np.testing.assert_allclose(sampled, exact(sequences, n, must), atol=0.05)


def test_steps_are_what_most_assemblies_hold(rng):
    plan = learn_plan(assemblies("a b b c", "a b b c x", "a b c b", "a a b b c"), rng)
    assert sorted(plan.names) == ["a", "b", "b 2", "c"]
    assert plan.n_assemblies == 4 and plan.repeated > learn_plan(assemblies("a b"), rng).repeated


def test_who_and_what_and_how_long(rng):
    done = [
        (DoneTask("a", "anna", {"screw": 2.0}, 1.0), DoneTask("b", "robot")),
        (DoneTask("a"), DoneTask("b")),  # nobody wrote who, what, or how long
        (DoneTask("a", "ben", {"screw": 1.0}, 3.0), DoneTask("b", "robot")),
    ]
    a, b = learn_plan(done, rng).steps
    assert (a.who, a.objects, a.duration_s) == ({"anna": 0.5, "ben": 0.5}, {"screw": 1.5}, 2.0)
    assert (b.who, b.objects, b.duration_s) == ({"robot": 1.0}, {}, 0.0)


def test_a_habit_is_what_was_chosen_of_several_not_what_had_to_come(rng):
    """After b either c or d could come, and after a only b: the mode is known."""
    before = np.zeros((4, 4))
    before[0, 1:] = before[1, 2:] = 1.0 - 1e-9
    found = habits([[0, 1, 2, 3]] * 8, before)
    np.testing.assert_allclose([found[-1, 0], found[0, 1]], 1.0, rtol=1e-6)
    c, d = found[1, 2], found[1, 3]
    np.testing.assert_allclose(
        [c, d], np.array([CHOICES + 8.0, CHOICES]) / (CHOICES + 8.0 / (c + d)), rtol=1e-6
    )
    plan = learn_plan(assemblies(*["a b c d", "a b d c", "a b c d"] * 3), rng)
    after = {step.name: step.after for step in plan.steps}
    assert after["c"]["b"] > 1.2 and "a" not in after["b"] and "b" not in after["d"]


def test_relations_by_hand_are_kept_where_their_steps_are(rng):
    plan = learn_plan(assemblies("a b"), rng, {("b", "a"): 0.0, ("a", "z"): 1.0})
    assert plan.by_hand == {("b", "a"): 0.0}
    plan = learn_plan(assemblies("a b c", "a b c"), rng, {("c", "a"): 1.0})
    assert plan.by_hand == {("c", "a"): 1.0} and plan.before[2, 0] > 0.99
    assert plan.before[0, 2] < 0.01 and ("c", "a") not in plan.order


@pytest.mark.parametrize("done", [(), ("",), ("a", "b", "c")])
def test_assemblies_without_a_task_in_half_of_them_are_refused(done, rng):
    with pytest.raises(ArgumentError, match="assemblies: expected a task"):
        learn_plan(assemblies(*done), rng)


def test_relations_of_simulated_assemblies_are_found():
    found, wrong = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        job = make_job(rng, twice=False)
        plan = learn_plan(
            [tuple(DoneTask(a.label) for a in build(rng, job)) for _ in range(10)], rng
        )
        at = [plan.names.index(label) for label in job.labels]
        for i, j in product(range(len(at)), repeat=2):
            if i != j:
                (found if i in job.needs[j] else wrong).append(plan.before[at[i], at[j]])
    assert np.mean(found) > 0.9 and np.mean(wrong) < 0.05
