# SPDX-License-Identifier: Apache-2.0
"""A session is scored from its log: interactions, and whether objects were handed over."""

from dataclasses import replace

import numpy as np
import pytest

from intent_recognition.evaluation import ContactLog, SessionLog, summarise
from intent_recognition.kinematics.inverse import inverse_kinematics
from intent_recognition.signals import homogeneous
from sim_bridge.coworker.session import plan_session
from sim_bridge.scenarios.toolbox import Scoring, first_sample_ns, handover_point
from sim_bridge.scenarios.toolbox.scene import HOME, STANDS_M, handover_rotation, stand_pose
from sim_bridge.scenarios.toolbox.session_scoring import score_people, score_session, toolbox_places
from sim_bridge.scenarios.toolbox.transfer_scoring import score_transfer

FIRST_NS = 7_000_000_000
TASK = "plate_handover"


def session(decided_s=1.0, task=TASK, hand_offset_m=(0.0, 0.0, 0.02), first=TASK):
    """A plan of two plates, and what the topics would say of a robot right for the first."""
    plan = plan_session(3, [first, TASK])
    first = plan.interactions[0]
    onset = FIRST_NS + round(first.onset_s * 1e9)
    end = FIRST_NS + round(first.end_s * 1e9)
    target = handover_point(TASK, first.goal_m) + np.array(hand_offset_m)
    arrived = inverse_kinematics(homogeneous(handover_rotation(TASK), target), HOME)
    stamps = np.arange(FIRST_NS, FIRST_NS + 30_000_000_000, 5_000_000)
    share = np.clip((stamps - onset) / (end + 400_000_000 - onset), 0.0, 1.0)
    seen = plan.samples.visible
    wrist_ns = FIRST_NS + np.round(plan.samples.times_s * 1e9).astype(np.int64)
    log = SessionLog(
        labels=(TASK, "none"),
        wrist_ns=wrist_ns[seen][3:],
        wrist_m=plan.samples.positions_m[seen][3:],
        tasks_ns=wrist_ns,
        probabilities=np.tile([0.9, 0.1], (len(wrist_ns), 1)),
        active_ns=np.array([onset + round(decided_s * 1e9), end + 2_000_000_000]),
        active=(task, ""),
        joint_ns=stamps,
        joint_rad=HOME + share[:, None] * (arrived - HOME),
    )
    return plan, log


def score_first(log, plan, **options):
    """The record of the first interaction."""
    return score_session(log, plan, FIRST_NS, Scoring(toolbox_places(plan), **options))[0][0]


def test_numbers_of_an_interaction_are_those_of_the_topics_and_nothing_activated_is_a_miss():
    plan, log = session()
    assert first_sample_ns(log, plan) == FIRST_NS
    (record, missed), traces = score_session(log, plan, FIRST_NS, Scoring(toolbox_places(plan)))
    interaction = plan.interactions[0]
    movement = interaction.end_s - interaction.onset_s
    assert record.recognised == TASK
    assert record.decision_time_s == pytest.approx(1.0, abs=1e-6)
    assert record.decision_share == pytest.approx(1.0 / movement, abs=1e-6)
    seen = (log.wrist_ns >= FIRST_NS + interaction.onset_s * 1e9) & (
        log.wrist_ns <= log.active_ns[0]
    )
    assert record.observations == seen.sum()
    assert record.hand_error_m == pytest.approx(0.02, abs=1e-6)
    assert record.arrival_s == pytest.approx(0.4, abs=0.08)
    assert record.movement_s == pytest.approx(movement, abs=1e-6)
    assert len(traces) == 2
    assert traces[0]["share"].min() >= 0.0
    assert traces[0]["share"].max() <= 1.0
    assert missed.recognised == "none"
    assert missed.hand_error_m is None
    assert not missed.right
    plan, log = session(task="screw_handover")
    record = score_first(log, plan)
    assert record.recognised == "screw_handover"
    assert not record.right
    assert record.hand_error_m is None


def test_an_arm_that_waits_at_a_stand_has_not_arrived():
    plan, log = session()
    end = FIRST_NS + round(plan.interactions[0].end_s * 1e9)
    stand, there = inverse_kinematics(stand_pose(TASK), HOME), log.joint_rad[-1]
    share = np.clip((log.joint_ns - end - 600_000_000) / 800_000_000, 0.0, 1.0)
    fetched = np.clip((log.joint_ns - end + 1_500_000_000) / 1_000_000_000, 0.0, 1.0)
    begun = HOME + fetched[:, None] * (stand - HOME)
    log = replace(log, joint_rad=begun + share[:, None] * (there - begun))
    record = score_first(log, plan, by_force=True, passed_m=np.array([STANDS_M[TASK]]))
    assert record.arrival_s == pytest.approx(1.4, abs=0.08)
    assert record.hand_error_m == pytest.approx(0.02, abs=1e-3)


def test_an_arm_that_still_rests_where_it_helped_somebody_else_has_not_arrived():
    plan, log = session()
    interaction = plan.interactions[0]
    end = FIRST_NS + round(interaction.end_s * 1e9)
    aside = HOME + np.eye(len(HOME))[0]
    decided = end + 500_000_000  # it moves for a little while, and then as the scene says
    share = np.clip((log.joint_ns - end - 900_000_000) / 800_000_000, 0.0, 1.0)
    swing = np.where(abs(log.joint_ns - decided - 50_000_000) < 40_000_000, 0.01, 0.0)
    begun = aside + swing[:, None] * np.eye(len(HOME))[1]
    log = replace(
        log,
        joint_rad=begun + share[:, None] * (log.joint_rad[-1] - begun),
        active_ns=np.array([decided, end + 5_000_000_000]),
    )
    record = score_first(log, plan, by_force=True)
    assert record.arrival_s == pytest.approx(1.7, abs=0.08)
    assert record.hand_error_m == pytest.approx(0.02, abs=1e-3)


def test_an_arm_that_waits_on_the_way_has_not_arrived_where_the_object_changed_hands():
    plan, log = session()
    end = FIRST_NS + round(plan.interactions[0].end_s * 1e9)
    since_s = (log.joint_ns - end) * 1e-9
    share = 0.5 * np.clip((since_s - 0.9) / 0.4, 0.0, 1.0)  # and half a second later the rest
    share += 0.5 * np.clip((since_s - 1.8) / 0.4, 0.0, 1.0)
    before = log.joint_ns < log.active_ns[0]  # the person has the object of the task before
    holders = tuple(np.where(~before & (since_s < 2.5), "robot", "person"))
    log = replace(
        log,
        joint_rad=HOME + share[:, None] * (log.joint_rad[-1] - HOME),
        contacts=ContactLog(log.joint_ns, holders, np.zeros((len(holders), 3))),
        active_ns=np.array([log.active_ns[0], end + 4_000_000_000]),
    )
    record = score_first(log, plan, by_force=True)
    assert record.handed_over
    other = replace(log, active_ns=log.active_ns - 2_000_000_000, active=(TASK, "screw_handover"))
    assert not score_first(other, plan, by_force=True).handed_over  # it was another object
    assert record.arrival_s == pytest.approx(2.2, abs=0.08)
    assert record.hand_error_m == pytest.approx(0.02, abs=1e-3)


@pytest.mark.parametrize(("late_s", "wrong"), [(0.5, 0), (20.0, 1)])
def test_people_are_scored_in_order_of_time_and_help_to_who_has_left_is_wrong(late_s, wrong):
    plan, log = session()
    first = plan.interactions[0]
    helped_s = min(first.end_s + late_s, plan.interactions[1].onset_s - 0.2)
    helped_ns = FIRST_NS + round(helped_s * 1e9)
    busy = replace(log, active_ns=np.array([helped_ns]), active=(TASK,))
    plans, logs = {"anna": plan, "ben": plan}, {"anna": log, "ben": busy}
    scoring = Scoring(toolbox_places(plan), by_force=True)
    records, traces = score_people(logs, plans, FIRST_NS, dict.fromkeys(plans, scoring))
    assert [r.index for r in records] == [t["index"] for t in traces] == [1, 2, 3, 4]
    assert [r.person for r in records] == ["anna", "ben"] * 2
    assert [r.wrong_helps for r in records] == [0, wrong, 0, 0]
    assert {r.believed for r in records} == {TASK}
    assert {r.handed_over for r in records} == {False}
    anna, ben = summarise(records).people
    assert (anna.recognised, anna.helped, anna.wrong_helps) == (2, 1, 0)
    assert (ben.recognised, ben.wrong_helps) == (2, wrong)


@pytest.mark.parametrize("late_s", [0.2, 0.4])
def test_a_change_is_followed_if_the_new_task_is_active_soon_after_the_end(late_s):
    plan, log = session(first=f"hold_screwdriver>{TASK}@0.25")
    interaction = plan.interactions[0]
    onset = FIRST_NS + round(interaction.onset_s * 1e9)
    switched = FIRST_NS + round((interaction.end_s + late_s) * 1e9)
    log = replace(
        log,
        active_ns=np.array([onset + 500_000_000, switched, switched + 2_000_000_000]),
        active=("hold_screwdriver", TASK, ""),
    )
    record = score_first(log, plan)
    assert (record.changed_from, record.task) == ("hold_screwdriver", TASK)
    assert record.right == (late_s < 0.3)
    assert record.recognised == (TASK if record.right else "hold_screwdriver")
    if record.right:
        movement = interaction.end_s - interaction.onset_s
        assert record.decision_time_s == pytest.approx(movement + late_s, abs=1e-6)
        assert record.hand_error_m == pytest.approx(0.02, abs=1e-6)


STEP_NS = 10_000_000


def contacts(*held: tuple[str, float], force_n=5.0) -> ContactLog:
    """Holders, each for a time [s]."""
    holders = [holder for holder, length_s in held for _ in range(round(length_s * 1e9 / STEP_NS))]
    stamps = STEP_NS * np.arange(len(holders), dtype=np.int64)
    return ContactLog(stamps, tuple(holders), np.full((len(holders), 3), force_n / np.sqrt(3.0)))


@pytest.mark.parametrize("gives", ["robot", "person"])
def test_what_the_other_one_holds_at_the_end_was_handed_over(gives):
    takes = {"robot": "person", "person": "robot"}[gives]
    log = contacts(("stand", 0.5), (gives, 1.0), ("both", 0.3), (takes, 1.0), ("", 0.5))
    score = score_transfer(log, 0, 10**10)
    assert score.handed_over
    assert score.at_ns == pytest.approx(1.8e9)
    assert score.largest_force_n == pytest.approx(5.0)


@pytest.mark.parametrize(
    "held",
    [
        [("robot", 1.0), ("both", 1.0), ("robot", 1.0)],  # nobody took it in the end
        [("robot", 1.0), ("both", 1.0)],
        [("robot", 1.0), ("both", 0.2), ("nobody", 0.5)],
        [("robot", 1.0), ("nobody", 0.1), ("person", 1.0)],  # caught
        [("stand", 2.0)],
    ],
)
def test_what_was_kept_or_dropped_was_not(held):
    score = score_transfer(contacts(*held), 0, 10**10)
    assert not score.handed_over and score.at_ns is None


def test_what_is_held_for_good_within_the_interaction_counts():
    bounce = [("person", 0.1), ("both", 0.1)]
    held = contacts(("robot", 1.0), ("nobody", 0.03), *bounce, ("robot", 0.2), ("person", 1.0))
    score = score_transfer(held, 0, 10**10)
    assert score.handed_over and score.at_ns == pytest.approx(1.43e9)
    log = contacts(("robot", 1.0), ("person", 1.0), ("person", 1.0), ("robot", 1.0))
    assert not score_transfer(log, 0, 10**10).handed_over
    assert score_transfer(log, 0, 2 * 10**9).handed_over
    assert score_transfer(ContactLog(), 0, 10**10) is None
