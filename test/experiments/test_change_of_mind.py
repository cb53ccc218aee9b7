# SPDX-License-Identifier: Apache-2.0
"""What became of a reach is told from what the decision said, and when."""

import numpy as np
import pytest

from intent_recognition.experiments.change_of_mind import following
from intent_recognition.experiments.change_of_mind.following import Followed, follow_reach
from intent_recognition.experiments.change_of_mind.study import summarise
from intent_recognition.experiments.toolbox.session import Seen
from intent_recognition.promp import NONE
from intent_recognition.recognition import DecisionState, Estimate
from sim_bridge.coworker import TASKS, change_of_mind, draw_reach, draw_rest

OLD, NEW, THIRD = TASKS


def movement():
    rng = np.random.default_rng(1)
    first = draw_reach(rng, OLD, draw_rest(rng), 2.0)
    return change_of_mind(rng, first, NEW, 0.25, 0.25)


@pytest.fixture
def said(monkeypatch):
    """Let the decision say what a test wants: [(share of the movement, active, event)]."""

    def say(*steps):
        def watch(estimator, samples):
            none = np.zeros(4)
            for share, active, event in steps:
                at = following.REST_S + share * movement().duration_s
                estimate = Estimate(0, False, 0, none, none, none, None, (*TASKS, NONE))
                yield Seen(at, estimate, DecisionState(active=active, event=event))

        monkeypatch.setattr(following, "IntentEstimator", lambda library: None)
        monkeypatch.setattr(following, "watch", watch)
        return follow_reach(None, movement(), np.random.default_rng(0))

    return say


def test_a_change_that_is_followed(said):
    one = said((0.1, "", ""), (0.2, OLD, "activated"), (0.4, OLD, ""), (0.6, NEW, "switched"),
               (1.0, NEW, ""))  # fmt: skip
    duration_s = movement().duration_s
    assert one.tasks == (OLD, NEW) and one.final == NEW
    assert one.new_active and not one.old_kept
    assert one.delay_s == pytest.approx((0.6 - 0.25) * duration_s)
    assert one.release_s == pytest.approx((0.4 - 0.25) * duration_s)
    assert (one.switches, one.withdrawals, one.others) == (1, 0, ())


def test_an_old_task_that_is_kept(said):
    one = said((0.2, OLD, "activated"), (1.0, OLD, ""))
    assert one.old_kept and not one.new_active
    assert one.release_s == np.inf and np.isnan(one.delay_s)


def test_a_task_that_is_let_go_of_and_one_that_was_never_meant(said):
    one = said((0.2, OLD, "activated"), (0.3, "", "withdrawn"), (0.5, THIRD, "activated"))
    assert one.others == (THIRD,) and one.withdrawals == 1
    assert not one.new_active and not one.old_kept


def test_what_was_active_when_the_estimator_called_it_over_counts(said):
    one = said((0.2, OLD, "activated"), (0.6, NEW, "switched"), (1.05, "", "over"))
    assert one.new_active


def test_without_any_activity_nothing_is_late(said):
    one = said((0.5, "", ""))
    assert np.isnan(one.release_s) and np.isnan(one.delay_s) and one.final == ""


def test_a_cell_counts_what_was_active_alone():
    def one(final, old_until_s, first_active_s=np.nan):
        return Followed((OLD, NEW), 2.0, 0.5, final, first_active_s, old_until_s, (), 0, 0, np.nan)

    cell = summarise([one(NEW, 0.9, 1.1), one(OLD, np.inf), one("", np.nan), one(NEW, 0.3, 1.5)])
    assert (cell.n, cell.new_active, cell.old_kept) == (4, 0.5, 0.25)
    assert cell.released_in_time == 0.5  # of the two in which it was active after the change
    assert cell.delay_s == pytest.approx(0.8)
