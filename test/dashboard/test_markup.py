# SPDX-License-Identifier: Apache-2.0
"""The pieces of the page say what is known, and nothing of a label becomes markup."""

from types import SimpleNamespace

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState, NodeHealth, Posterior, SkillRow
from intent_recognition.dashboard.skills_tab import skills_table
from intent_recognition.dashboard.subscriptions import CellSubscriptions

EVIL = "<script>alert(1)</script>"


def state_with(label):
    state = CellState(active=label, truth=label)
    chances = np.array([0.93, 0.07])
    state.take_posterior(Posterior((label, "none"), chances, np.array([0.4, 0.0])), 1.0)
    return state


def test_bars_show_probability_and_phase():
    text = markup.bars(state_with("give_cup"), {"give_cup": "#0072b2"}, True)
    assert "give cup" in text
    assert "93%" in text
    assert "0.40" in text
    assert "#0072b2" in text


def test_the_plan_that_is_told_is_listed_by_what_is_done_forgotten_and_due():
    """`intent/plan`, as `PlanFollower` publishes it, and with a hostile name."""
    taken, state = {}, CellState()
    node = SimpleNamespace(
        create_subscription=lambda _, topic, take, __: taken.update({topic: take})
    )
    CellSubscriptions(node, state)
    rows = {
        "bolt": "done 1.00",
        EVIL: "forgotten 0.02",
        "lid 2": "may come 0.00",
        "yaml": "y" * 9999,
    }
    values = [KeyValue(key=key, value=value) for key, value in rows.items()]
    taken["intent/plan"](DiagnosticStatus(name="plan", message="may come: lid 2", values=values))
    text = markup.plan(state.plan)
    places = [text.index(f"{what}:</span> ") for what in ("done", "forgotten", "may come")]
    assert places == sorted(places)
    assert "later" not in text
    assert EVIL not in text
    assert "lid 2" in text
    taken["intent/plan"](DiagnosticStatus(name="plan", message="no plan"))
    assert markup.plan(state.plan) == ""


def test_old_probabilities_lose_their_colour():
    assert "#0072b2" not in markup.bars(state_with("a"), {"a": "#0072b2"}, False)


def test_what_the_robot_did_not_finish_is_told_until_it_begins_again():
    state = CellState()
    state.take_active("give_cup")
    state.take_active("")
    state.take_outcome("give_cup", "stopped: limits")
    assert "stopped: limits" in markup.now_line(state, {})
    state.take_active("give_cup")
    assert "stopped" not in markup.now_line(state, {})
    state.take_active("")
    state.take_outcome("give_cup", "arrived")
    assert "arrived" not in markup.now_line(state, {})


def test_labels_and_messages_are_escaped():
    state = state_with(EVIL)
    nodes = {EVIL: NodeHealth(2, EVIL, {f"rejected {EVIL}": "3"}, 0.0)}
    for text in (
        markup.bars(state, {}, True),
        markup.now_line(state, {}),
        markup.nodes_table(nodes, 1.0),
        markup.banner(EVIL),
        markup.remark(EVIL),
        markup.steps([EVIL]),
        markup.ways(EVIL, [EVIL]),
        markup.table([EVIL], [[EVIL]]),
        skills_table({EVIL: [SkillRow(EVIL, {"since": EVIL, "arrived": EVIL})]}),
    ):
        assert "<script" not in text


def test_a_table_of_skills_is_as_narrow_as_can_be():
    """It does not say what is spilled where nothing is."""
    rows = [SkillRow("kept 0003", {"spilled": "-"}), SkillRow("begun", {"spilled": "-"})]
    text = skills_table({"give_cup": rows})
    assert "kept 0003" in text and text.count("give") == 1
    assert "spilled" not in text
    assert "spilled" in skills_table({"give_cup": [*rows, SkillRow("", {"spilled": "0.1"})]})


def test_a_silent_node_stands_out():
    nodes = {"arm": NodeHealth(0, "running", {}, 0.0), "ear": NodeHealth(0, "running", {}, 9.0)}
    assert markup.silent_nodes(nodes, 10.0) == ["arm"]
    assert "silent for 10 s" in markup.nodes_table(nodes, 10.0)


def test_a_node_that_is_done_raises_no_alarm():
    nodes = {"cell/bag_player": NodeHealth(0, "running", {}, 0.0)}
    assert markup.silent_nodes(nodes, 10.0) == []
    assert markup.BAD not in markup.nodes_table(nodes, 10.0)


def test_a_node_that_said_that_its_work_is_done_has_ended():
    nodes = {"coworker_sim": NodeHealth(0, "session over", {}, 0.0, ended=True)}
    assert "ended: session over" in markup.nodes_table(nodes, 10.0)
    assert "silent" not in markup.nodes_table(nodes, 10.0)
    assert "ended" not in markup.nodes_table(nodes, 1.0), "it still reports"


def test_details_have_rates_latency_and_what_was_rejected():
    values = {"rate human/wrist [Hz]": "99.7", "latency p99 [ms]": "1.92", "rejected jump": "4"}
    text = markup.nodes_table({"n": NodeHealth(0, "moving", values, 0.0)}, 1.0)
    assert "human/wrist 100 Hz" in text
    assert "latency p99 1.9 ms" in text
    assert "rejected jump 4" in text


def test_empty_state_says_what_to_do():
    assert markup.bars(CellState(), {}, False) == ""
    assert "No node" in markup.nodes_table({}, 0.0)


def test_steps_that_are_done_are_ticked_and_the_next_stands_out():
    text = markup.steps(["take", "press `Record`", "learn"], 1)
    ticked, following, last = text.split("display:grid")[1:]
    assert "&#10003;" in ticked and markup.GOOD in ticked
    assert 'font-weight:600">press <code' in following
    assert markup.SOFT in last
    assert markup.SOFT not in markup.steps(["a", "b"])
