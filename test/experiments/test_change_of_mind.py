# SPDX-License-Identifier: Apache-2.0
"""What became of a reach, or a session, is told from what the decision said, and when."""

import json
from functools import partial

import numpy as np
import pytest

from experiments.change_of_mind import experiment, following, report, study
from experiments.change_of_mind.changes import change_of_mind
from experiments.change_of_mind.following import FollowedReach, follow_reach
from experiments.change_of_mind.study import CHANGES, GoalChange, follow_all, summarise
from experiments.change_of_mind.without_pause import score_flowing
from experiments.settings import Settings
from experiments.toolbox.session import SeenEstimate
from intent_recognition.model import load_model
from intent_recognition.promp import NONE
from intent_recognition.recognition import DecisionState, Estimate
from intent_recognition.report.html import ReportPage, Section, render
from sim_bridge.coworker import TASKS, USUAL_BLEND, WITHOUT_PAUSE, draw_rest, plan_session
from sim_bridge.coworker.reach import draw_reach

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
                yield SeenEstimate(at, estimate, DecisionState(active=active, event=event))

        monkeypatch.setattr(following, "IntentEstimator", lambda library: None)
        monkeypatch.setattr(following, "watch", watch)
        return follow_reach(None, movement(), np.random.default_rng(0))

    return say


def test_a_reach_is_what_the_decision_said_of_it(said):
    one = said((0.1, "", ""), (0.2, OLD, "activated"), (0.4, OLD, ""), (0.6, NEW, "switched"),
               (1.0, NEW, ""))  # fmt: skip
    duration_s = movement().duration_s
    assert one.tasks == (OLD, NEW) and one.final == NEW
    assert one.new_active and not one.old_kept
    assert one.delay_s == pytest.approx((0.6 - 0.25) * duration_s)
    assert one.release_s == pytest.approx((0.4 - 0.25) * duration_s)
    assert (one.switches, one.withdrawals, one.others) == (1, 0, ())
    one = said((0.2, OLD, "activated"), (1.0, OLD, ""))
    assert one.old_kept and not one.new_active
    assert one.release_s == np.inf and np.isnan(one.delay_s)
    one = said((0.2, OLD, "activated"), (0.3, "", "withdrawn"), (0.5, THIRD, "activated"))
    assert one.others == (THIRD,) and one.withdrawals == 1
    assert not one.new_active and not one.old_kept
    one = said((0.2, OLD, "activated"), (0.3, "", "over"), (0.6, NEW, "activated"))
    assert one.new_active and not one.old_kept
    one = said((0.2, NEW, "activated"), (0.3, "", "over"), (0.6, "", ""))
    assert not one.new_active


def test_a_cell_counts_what_was_active_alone():
    def one(final, old_until_s, first_active_s=np.nan):
        return FollowedReach(
            (OLD, NEW), 2.0, 0.5, final, first_active_s, old_until_s, (), 0, 0, np.nan
        )

    cell = summarise([one(NEW, 0.9, 1.1), one(OLD, np.inf), one("", np.nan), one(NEW, 0.3, 1.5)])
    assert (cell.n, cell.new_active, cell.old_kept) == (4, 0.5, 0.25)
    assert cell.released_in_time == 0.5  # of the two in which it was active after the change
    assert cell.delay_s == pytest.approx(0.8)


def decided(interactions, *events):
    """(number of the interaction, share of it, active, event) as the decision would say it."""
    none = np.zeros(4)
    estimate = Estimate(0, False, 0, none, none, none, None, (*TASKS, NONE))
    for number, share, active, event in events:
        one = interactions[number]
        at_s = one.onset_s + share * (one.end_s - one.onset_s)
        yield SeenEstimate(at_s, estimate, DecisionState(active=active, event=event))


def test_tasks_without_a_pause_are_recognised_when_each_becomes_active_in_its_turn():
    done = plan_session(1, [OLD, NEW, NEW], WITHOUT_PAUSE).interactions
    right = [(0, 0.3, OLD, "activated"), (1, 0.3, NEW, "switched"), (2, 0.2, NEW, "activated")]
    session = score_flowing(done, list(decided(done, *right)))
    assert session.in_order and session.recognised == (True, True, True)
    kept = score_flowing(done, list(decided(done, *right[:2])))  # the second is not let go of
    assert not kept.in_order and kept.recognised == (True, True, False)
    between = score_flowing(done, list(decided(done, right[0], (0, 2.0, THIRD, "switched"))))
    assert not between.in_order and between.recognised == (True, False, False)


@pytest.mark.slow
def test_the_experiment_takes_every_path_and_reports_it(monkeypatch):
    blends = (0.15, USUAL_BLEND, None)
    unknown = GoalChange(0.25, USUAL_BLEND, "unknown")
    few = [c for c in CHANGES if c.blend in blends and (c.to != "unknown" or c == unknown)]
    monkeypatch.setattr(study, "follow_all", partial(follow_all, changes=few))
    monkeypatch.setattr(report, "BLENDS", blends)
    outcome = experiment.run(Settings(quick=True))
    assert len(outcome.numbers["changes"]) == len(few) == 15
    assert all(
        0.0 <= cell["new_active"] + cell["old_kept"] <= 1.0 for cell in outcome.numbers["changes"]
    )
    assert all(one["final"] == one["tasks"][0] for one in outcome.numbers["unchanged"])
    json.dumps(outcome.numbers, allow_nan=False)
    render(ReportPage(outcome.title, outcome.source, (Section("x", outcome.blocks),)))


@pytest.mark.slow
def test_changes_early_in_a_reach_are_followed_and_unchanged_ones_are_not(toolbox_model):
    """Two reaches of each ordered pair of tasks, changed after a fifth of the movement."""
    library = load_model(toolbox_model).library
    change = GoalChange(0.2, USUAL_BLEND)
    followed = follow_all(library, 11, 2, 6, changes=[change])
    cell = followed.cell(change)
    assert cell.n == 12 and cell.new_active >= 0.75 and cell.old_kept <= 0.1
    assert cell.others == 0.0
    assert all(one.switches == 0 and not one.others for one in followed.unchanged)
    assert sum(one.new_active for one in followed.unchanged) >= 5
