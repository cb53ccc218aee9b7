# SPDX-License-Identifier: Apache-2.0
"""The worker of a plan does each step once, after what it needs."""

from collections import Counter

import pytest

from intent_recognition.plans import WorkProgress, read_plan
from intent_recognition.share import share_path
from sim_bridge.coworker import work_shares


@pytest.fixture(scope="module")
def plan():
    return read_plan(share_path("config/examples/cell_plan.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("seed", range(20))
def test_every_order_is_allowed_and_does_all(plan, seed):
    (tasks,) = work_shares(plan, seed, 1)
    assert Counter(tasks) == Counter(step.task for step in plan.steps)
    done, times = set(), Counter()
    for task in tasks:
        times[task] += 1  # the k-th time that it is done is its k-th step
        names = [step.name for step in plan.steps if step.task == task]
        name = names[times[task] - 1]
        assert {a for (a, b) in plan.by_hand if b == name} <= done, (name, done)
        done.add(name)


def test_the_plan_has_twenty_steps_and_begins_with_a_plate(plan):
    assert len(plan.steps) == 20
    labels = ("plate_handover", "screw_handover", "hold_screwdriver")
    expected = WorkProgress(plan, labels).next_tasks()
    assert expected.argmax() == 0


@pytest.mark.parametrize("seed", range(5))
def test_two_people_do_at_any_time_what_may_be_next(plan, seed):
    shares = work_shares(plan, seed, 2)
    assert sorted(map(len, shares)) == [10, 10]
    together = Counter(task for share in shares for task in share)
    assert together == Counter(step.task for step in plan.steps)
    few = work_shares(plan, seed, 2, 3)
    assert [share[: len(own)] for share, own in zip(shares, few, strict=True)] == list(few)
    assert sum(map(len, few)) == 3
