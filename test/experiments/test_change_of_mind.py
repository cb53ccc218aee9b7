# SPDX-License-Identifier: Apache-2.0
"""Reaches that are changed on the way, and what the decision made of them."""

import json
from functools import partial

import numpy as np
import pytest

from experiments.change_of_mind import experiment, following, report, study
from experiments.change_of_mind.changes import APART_M, change_of_mind, depart, draw_elsewhere
from experiments.change_of_mind.following import FollowedReach, follow_reach
from experiments.change_of_mind.study import CHANGES, GoalChange, follow_all, summarise
from experiments.change_of_mind.without_pause import score_flowing
from experiments.settings import Settings
from experiments.toolbox.session import SeenEstimate
from intent_recognition.model import load_model
from intent_recognition.promp import NONE
from intent_recognition.recognition import DecisionState, Estimate
from intent_recognition.report.html import ReportPage, Section, render
from sim_bridge.coworker import (
    STYLES,
    TASKS,
    USUAL_BLEND,
    WITHOUT_PAUSE,
    Reach,
    draw_reach,
    draw_rest,
    last_reach,
    plan_session,
)

OLD, NEW, THIRD = TASKS


def movement():
    rng = np.random.default_rng(1)
    first = draw_reach(rng, OLD, draw_rest(rng), 2.0)
    return change_of_mind(rng, first, NEW, 0.25, 0.25)


def seen(at_s, active, event):
    """What a decision said at a time, beside an estimate of nothing."""
    none = np.zeros(4)
    estimate = Estimate(0, False, 0, none, none, none, None, (*TASKS, NONE))
    return SeenEstimate(at_s, estimate, DecisionState(active=active, event=event))


@pytest.fixture
def said(monkeypatch):
    """Let the decision say what a test wants: [(share of the movement, active, event)]."""

    def say(*steps):
        def watch(estimator, samples):
            for share, *decision in steps:
                yield seen(following.REST_S + share * movement().duration_s, *decision)

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
    for number, share, *decision in events:
        one = interactions[number]
        yield seen(one.onset_s + share * (one.end_s - one.onset_s), *decision)


def test_tasks_without_a_pause_are_recognised_when_each_becomes_active_in_its_turn():
    done = plan_session(1, [OLD, NEW, NEW], WITHOUT_PAUSE).interactions
    right = [(0, 0.3, OLD, "activated"), (1, 0.3, NEW, "switched"), (2, 0.2, NEW, "activated")]
    session = score_flowing(done, list(decided(done, *right)))
    assert session.in_order and session.recognised == (True, True, True)
    kept = score_flowing(done, list(decided(done, *right[:2])))  # the second is not let go of
    assert not kept.in_order and kept.recognised == (True, True, False)
    between = score_flowing(done, list(decided(done, right[0], (0, 2.0, THIRD, "switched"))))
    assert not between.in_order and between.recognised == (True, False, False)


def test_a_share_of_no_reach_is_neither_met_nor_missed():
    assert report._at_least("let go", 0.9, float("nan")).holds is None
    assert [report._at_least("let go", 0.9, share).holds for share in (0.9, 0.8)] == [True, False]


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


SHARES, BLENDS = (0.15, 0.25, 0.4, 0.6), (0.15, 0.25, 0.4, None)
STEP_S = 1e-3


def drawn(seed, share, blend, task=TASKS[1]):
    rng = np.random.default_rng(seed)
    first = draw_reach(rng, TASKS[0], draw_rest(rng))
    return first, change_of_mind(rng, first, task, share, blend)


@pytest.mark.parametrize("blend", BLENDS)
@pytest.mark.parametrize("share", SHARES)
def test_a_changed_reach_goes_from_the_first_to_the_second_goal_without_a_jump(share, blend):
    for seed in range(5):
        first, changed = drawn(seed, share, blend)
        before = np.linspace(0.0, changed.change_s, 50)
        np.testing.assert_allclose(
            changed.positions(before), first.positions(before), rtol=0, atol=1e-12
        )
        end = changed.positions(np.array([changed.duration_s, changed.duration_s + 1.0]))
        np.testing.assert_allclose(end, [changed.second.goal_m] * 2, atol=1e-12)
        assert changed.task == changed.second.task == TASKS[1]
        assert changed.change_s == pytest.approx(share * first.duration_s)
        at = changed.change_s + STEP_S * np.arange(-3.0, 4.0)
        x = changed.positions(at)
        velocity = np.diff(x, axis=0) / STEP_S
        acceleration = np.diff(velocity, axis=0) / STEP_S
        assert np.abs(np.diff(velocity, axis=0)).max() < 0.01  # m/s within a millisecond
        assert np.abs(acceleration[-1] - acceleration[0]).max() < 1.0  # m/s^2, of up to 10


def test_a_blend_reaches_the_second_course_and_turns_the_wrist_without_a_jump():
    _, changed = drawn(3, 0.25, 0.25)
    after = np.linspace(0.5 * changed.duration_s + 1e-6, changed.duration_s, 50)
    np.testing.assert_allclose(changed.positions(after), changed.second.positions(after))
    assert changed.duration_s == changed.first.duration_s
    for blend in BLENDS:
        _, changed = drawn(6, 0.25, blend)
        turned = changed.rotations(np.linspace(0.0, changed.duration_s, 2000), np.zeros(3))
        assert np.abs(np.diff(turned, axis=0)).max() < 0.01
        np.testing.assert_allclose(turned[-1], last_reach(changed).turn_rad, atol=1e-12)


def test_a_replanned_straight_reach_is_the_fifth_order_polynomial_of_its_ends():
    first = Reach("", np.zeros(3), np.array([0.4, 0, 0]), 2.0, np.zeros(3), 1.0, np.zeros(3))
    tau = 0.4  # of minimum jerk from 0 to 0.4 m in 2 s: its state by its own derivatives
    s = 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    v = (30 * tau**2 - 60 * tau**3 + 30 * tau**4) / 2.0
    a = (60 * tau - 180 * tau**2 + 120 * tau**3) / 4.0
    state = [0.4 * np.array([value, 0, 0]) for value in (s, v, a)]
    reach = Reach("", state[0], np.array([0.2, 0.1, 0]), 1.2, np.zeros(3), 1.0, np.zeros(3))
    second = depart(reach, *state[1:])
    times = np.linspace(0.0, 1.2, 7)
    rows = np.array(
        [[t**k for k in range(6)] for t in (0.0, 1.2)]
        + [[k * t ** max(k - 1, 0) for k in range(6)] for t in (0.0, 1.2)]
        + [[k * (k - 1) * t ** max(k - 2, 0) for k in range(6)] for t in (0.0, 1.2)]
    )
    ends = np.array([state[0], second.goal_m, state[1], np.zeros(3), state[2], np.zeros(3)])
    polynomial = np.vander(times, 6, increasing=True) @ np.linalg.solve(rows, ends)
    np.testing.assert_allclose(second.positions(times), polynomial, atol=1e-12)
    at = np.array([0.8 - STEP_S, 0.8, 0.8 + STEP_S])
    np.testing.assert_allclose(
        np.diff(first.positions(at), axis=0).sum(axis=0) / (2 * STEP_S), state[1], atol=1e-5
    )


def test_a_movement_to_no_task_ends_far_from_every_goal():
    rng = np.random.default_rng(5)
    for _ in range(200):
        goal = draw_elsewhere(rng, draw_rest(rng), 2.0).goal_m
        for style in STYLES.values():
            nearest = np.clip(
                goal,
                style.goal_centre_m - style.goal_half_width_m,
                style.goal_centre_m + style.goal_half_width_m,
            )
            assert np.linalg.norm(goal - nearest) >= APART_M
    _, changed = drawn(7, 0.4, 0.25, task="")
    assert changed.task == ""
