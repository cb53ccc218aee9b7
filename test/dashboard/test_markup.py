# SPDX-License-Identifier: Apache-2.0
"""The pieces of the page say what is known, and nothing of a label becomes markup."""

import numpy as np

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import (
    ASKED,
    CellState,
    NodeHealth,
    Posterior,
    SkillRow,
    TransferState,
)
from intent_recognition.dashboard.skills_tab import skills_table
from intent_recognition.plans import WorkPlan
from intent_recognition.plans.work_plan import WorkStep

EVIL = "<script>alert(1)</script>"


def state_with(label):
    state = CellState(active=label, truth=label)
    chances = np.array([0.93, 0.07])
    state.person.take_posterior(Posterior((label, "none"), chances, np.array([0.4, 0.0])), 1.0)
    return state


def bars(state, colours, fresh=True, head=""):
    return markup.bars(state.person, state.active, colours, fresh, head)


def test_bars_show_probability_and_phase():
    text = bars(state_with("give_cup"), {"give_cup": "#0072b2"})
    assert "give cup" in text
    assert "93%" in text
    assert "0.40" in text
    assert "#0072b2" in text
    assert text.index("give cup</span>") < text.index("&#9679;"), "no long name hides the mark"


def test_the_plan_lists_what_became_of_each_step_and_what_it_waits_for():
    order = {("bolt", EVIL): 0.9, (EVIL, "lid_2"): 0.9}
    plan = WorkPlan(
        (WorkStep("bolt", "a"), WorkStep(EVIL, "b", 0.5), WorkStep("lid_2", "c")), order
    )
    text = markup.plan(plan, {"bolt": "done", EVIL: "forgotten", "lid_2": "may come"})
    bolt, evil, lid = text.split("display:grid")[1:]
    assert markup.GOOD in bolt and "after" not in bolt
    assert markup.BAD in evil and "forgotten; after bolt; in 50%" in evil
    assert "after &lt;script&gt;" in lid and "bolt" not in lid, "only what it waits for directly"
    assert EVIL not in text
    assert markup.plan(None, {}) == ""


def test_who_is_helped_is_named_with_who_asked():
    state = CellState(active="give_cup", helped=EVIL)
    asked = {ASKED: f"{EVIL} in 0.4 s (97%)"}
    state.nodes["cell/primitive_activation"] = NodeHealth(0, "", asked, 0.0)
    text = markup.now_line(state, {}, {EVIL: "#8c3b57"})
    assert "#8c3b57" in text and "in 0.4 s (97%)" in text and EVIL not in text
    state.helped = ""
    assert "0.4 s" not in markup.now_line(state, {}, {})


def test_a_transfer_is_told_with_its_forces():
    transfer = TransferState()
    assert markup.transfer(transfer, True) == ""
    felt = {"load": 4.0, "weight": 3.9, "grip_force": 12.0, "load_share": 0.5, "slip": 1.0}
    transfer.take(EVIL, felt, 0.0)
    text = markup.transfer(transfer, True)
    for said in ("slips", "load 4.0 N", "weight 3.9 N", "grip force 12.0 N"):
        assert said in text
    assert "sensor" not in text and EVIL not in text
    transfer.take_sensor(4.2, 0.0)
    assert "sensor 4.2 N" in markup.transfer(transfer, True)
    transfer.holding = "offering"
    assert "carries 50%" in markup.transfer(transfer, True) and "carries" not in text
    assert markup.FORCE_COLOURS["load"] not in markup.transfer(transfer, False)


def test_what_the_robot_did_not_finish_is_told_until_it_begins_again():
    state = CellState()
    state.take_active("give_cup")
    state.take_active("")
    state.take_outcome("give_cup", "stopped: limits")
    assert "stopped: limits" in markup.now_line(state, {}, {})
    state.take_active("give_cup")
    assert "stopped" not in markup.now_line(state, {}, {})
    state.take_active("")
    state.take_outcome("give_cup", "arrived")
    assert "arrived" not in markup.now_line(state, {}, {})


def test_labels_and_messages_are_escaped():
    state = state_with(EVIL)
    nodes = {EVIL: NodeHealth(2, EVIL, {f"rejected {EVIL}": "3"}, 0.0)}
    for text in (
        bars(state, {}, head=markup.chip(EVIL, "#0072b2")),
        markup.now_line(state, {}, {}),
        markup.nodes_table(nodes, 1.0),
        markup.banner(EVIL),
        markup.remark(EVIL),
        markup.steps([EVIL]),
        markup.ways(EVIL, [EVIL]),
        markup.table([EVIL], [[EVIL]]),
        skills_table({EVIL: [SkillRow(EVIL, {"since": EVIL, "arrived": EVIL})]}),
    ):
        assert "<script" not in text


def test_a_silent_node_stands_out():
    nodes = {"arm": NodeHealth(0, "running", {}, 0.0), "ear": NodeHealth(0, "running", {}, 9.0)}
    assert markup.silent_nodes(nodes, 10.0) == ["arm"]
    assert "silent for 10 s" in markup.nodes_table(nodes, 10.0)


def test_a_node_that_said_that_its_work_is_done_has_ended():
    nodes = {"coworker_sim": NodeHealth(0, "session over", {}, 0.0, ended=True)}
    assert "ended: session over" in markup.nodes_table(nodes, 10.0)
    assert "silent" not in markup.nodes_table(nodes, 10.0)
    assert "ended" not in markup.nodes_table(nodes, 1.0), "it still reports"


def test_a_node_that_is_done_raises_no_alarm():
    nodes = {"cell/bag_player": NodeHealth(0, "running", {}, 0.0)}
    assert markup.silent_nodes(nodes, 10.0) == []
    assert markup.BAD not in markup.nodes_table(nodes, 10.0)


def test_old_probabilities_lose_their_colour():
    assert "#0072b2" not in bars(state_with("a"), {"a": "#0072b2"}, fresh=False)


def test_details_have_rates_latency_and_what_was_rejected():
    values = {"rate human/wrist [Hz]": "99.7", "latency p99 [ms]": "1.92", "rejected jump": "4"}
    text = markup.nodes_table({"n": NodeHealth(0, "moving", values, 0.0)}, 1.0)
    assert "human/wrist 100 Hz" in text
    assert "latency p99 1.9 ms" in text
    assert "rejected jump 4" in text
