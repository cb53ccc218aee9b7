# SPDX-License-Identifier: Apache-2.0
"""What the page remembers, and the pieces of text that it makes of it."""

import re

import numpy as np
import pytest

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import (
    ASKED,
    FORCES,
    PLOTTED_S,
    PLOTTED_STEP_S,
    SENSOR,
    WRIST_S,
    CellState,
    NodeHealth,
    PersonState,
    Posterior,
    SkillRow,
    TransferState,
)
from intent_recognition.dashboard.skills_tab import skills_table
from intent_recognition.plans import WorkPlan
from intent_recognition.plans.work_plan import WorkStep


def posterior(*labels, best=0):
    probabilities = np.full(len(labels), 0.1)
    probabilities[best] = 1.0 - 0.1 * (len(labels) - 1)
    return Posterior(labels, probabilities, np.zeros(len(labels)))


def test_the_past_is_that_of_the_last_seconds_and_ends_now():
    person = PersonState()
    for k in range(5000):
        person.take_posterior(posterior("a", "none"), k * 0.01)
        person.take_wrist(np.array([k, 0.0, 0.0]), k * 0.01)
    times, a, none = person.past.columns(("a", "none"), 50.0)
    assert times[0] >= -PLOTTED_S
    assert times[-1] <= 0.0
    assert np.all(np.diff(times) >= PLOTTED_STEP_S - 1e-9)
    np.testing.assert_allclose(a + none, 1.0)
    path = person.wrist_path(50.0)
    assert path[0, 0] >= 100 * (50.0 - WRIST_S)
    assert path[-1, 0] == 4999


def test_a_task_that_was_learned_later_has_no_past():
    person = PersonState()
    person.take_posterior(posterior("a", "none"), 0.0)
    person.take_posterior(posterior("a", "b", "none", best=1), 1.0)
    _, b = person.past.columns(("b",), 1.0)
    assert np.isnan(b[0])
    assert b[1] > 0.5
    assert person.posterior.best == "b"


def test_the_person_is_whom_the_arm_helps_or_the_first_one():
    state = CellState()
    only, anna = state.person, PersonState()
    state.people["anna"] = anna
    assert state.person is only
    state.helped = "anna"
    assert state.person is anna
    state.helped = "nobody known"
    assert state.person is only


def test_forces_are_named_while_there_are_any_in_the_plotted_time():
    transfer = TransferState()
    assert transfer.names(0.0) == () and transfer.newest("load") is None
    transfer.take_sensor(5.0, 0.0)
    assert transfer.names(1.0) == (SENSOR,)
    felt = {"load": 4.0, "weight": 3.9, "grip_force": 12.0, "load_share": 0.5, "slip": 0.0}
    transfer.take("offering", felt, 0.5)
    transfer.take("offering", felt, 5.0)  # the sensor is silent since
    times, load, sensor = transfer.forces.columns(("load", SENSOR), 5.0)
    np.testing.assert_array_equal(times, [-5.0, -4.5, 0.0, 0.0])
    np.testing.assert_array_equal(load, [np.nan, 4.0, np.nan, 4.0])  # no curve through the silence
    np.testing.assert_array_equal(sensor, [5.0, 5.0, np.nan, np.nan])
    assert transfer.names(5.0 + PLOTTED_S) == FORCES
    assert transfer.names(6.0 + PLOTTED_S) == ()


def test_joint_states_may_come_in_parts():
    state = CellState()
    state.take_joints(["a", "b"], [1.0, 2.0], 5.0)
    state.take_joints(["b"], [3.0], 6.0)
    assert state.joints == {"a": 1.0, "b": 3.0}
    assert (state.joints_at_s(["a", "b"]), state.joints_at_s(["b"])) == (5.0, 6.0)


def test_somebody_is_asked_once_a_question_has_stood_for_a_while():
    state = CellState()
    assert state.question(10.0) == ()
    state.take_question(("plate", "screw"), 10.0)
    assert state.question(10.4) == () and state.question(10.5) == ("plate", "screw")
    state.take_question((), 10.6)
    assert state.question(20.0) == ()


EVIL = "<script>alert(1)</script>"


def state_with(label):
    state = CellState(active=label, truth=label)
    chances = np.array([0.93, 0.07])
    state.person.take_posterior(Posterior((label, "none"), chances, np.array([0.4, 0.0])), 1.0)
    return state


def bars(state, colours, fresh=True, head=""):
    return markup.bars(state.person, state.active, colours, fresh, head)


def test_bars_show_probability_and_phase_and_old_ones_lose_their_colour():
    text = bars(state_with("give_cup"), {"give_cup": "#0072b2"})
    assert all(said in text for said in ("give cup", "93%", "0.40", "#0072b2"))
    assert text.index("give cup</span>") < text.index("&#9679;"), "no long name hides the mark"
    assert "#0072b2" not in bars(state_with("a"), {"a": "#0072b2"}, fresh=False)


def test_the_plan_lists_what_became_of_each_step_and_what_it_waits_for():
    order = {("bolt", EVIL): 0.9, (EVIL, "lid_2"): 0.9}
    plan = WorkPlan(
        (WorkStep("bolt", "a"), WorkStep(EVIL, "b", 0.5), WorkStep("lid_2", "c")), order
    )
    text = markup.plan(plan, {"bolt": "done", EVIL: "forgotten", "lid_2": "may come"})
    bolt, evil, lid = text.split("i-item")[1:]
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
    state.take_outcome("give_cup", "stopped: stream_stopped")
    assert "stopped: stream stopped" in markup.now_line(state, {}, {})
    state.take_active("give_cup")
    assert "stopped" not in markup.now_line(state, {}, {})
    state.take_active("")
    state.take_outcome("give_cup", "arrived")
    assert "arrived" not in markup.now_line(state, {}, {})


def test_the_rows_of_now_stay_when_a_task_begins():
    state = CellState(truth="")
    (robot, coworker) = markup.now_line(state, {}, {}).split("<br>")
    assert "waits" in robot and "coworker: -" in coworker
    state.truth = state.active = "a_task"
    assert ["a task" in row for row in markup.now_line(state, {}, {}).split("<br>")] == [True] * 2


@pytest.mark.parametrize(
    ("message", "waiting", "under_way"),
    [
        ("stopped: limits", "waits stopped: limits", "a task stopped: limits"),
        ("idle; silent: joint_states", "waits silent: joint_states", "a task"),
        ("waits: a_task: the box", "waits a_task: the box", "a task"),
    ],
)
def test_the_reason_why_the_robot_rests_is_beside_it(message, waiting, under_way):
    state = CellState(nodes={"cell/primitive_activation": NodeHealth(1, message, {}, 0.0)})
    for state.active, said in (("", waiting), ("a_task", under_way)):
        shown = re.sub("<[^>]*>", "", markup.now_line(state, {}, {}))
        assert shown.strip() == f"robot: {said}"


def test_labels_and_messages_are_escaped():
    state = state_with(EVIL)
    nodes = {EVIL: NodeHealth(2, EVIL, {f"rejected {EVIL}": "3"}, 0.0)}
    for text in (
        bars(state, {}, head=markup.chip(EVIL, "#0072b2")),
        markup.now_line(state, {}, {}),
        markup.nodes_table(nodes, 1.0),
        markup.notice(EVIL),
        markup.remark(EVIL),
        markup.steps([EVIL]),
        markup.ways(EVIL, [EVIL]),
        markup.table([EVIL], [[EVIL]]),
        skills_table({EVIL: [SkillRow(EVIL, {"since": EVIL, "arrived": EVIL})]}),
    ):
        assert "<script" not in text


def test_a_silent_node_stands_out_unless_it_is_foreign_or_its_work_is_done():
    nodes = {name: NodeHealth(0, "running", {}, 0.0) for name in ("lwr_sim", "cell/bag_player")}
    nodes["camera: driver"] = nodes["cell/bag_player"]
    nodes["ear"] = NodeHealth(0, "running", {}, 9.0)
    nodes["eye"] = NodeHealth(2, "sees nothing", {}, 9.0)
    assert markup.alarms(nodes, 10.0) == ["silent: lwr_sim", "eye: sees nothing"]
    assert "silent for 10 s" in markup.nodes_table(nodes, 10.0)
    for name in ("cell/bag_player", "camera: driver"):
        assert markup.BAD not in markup.nodes_table({name: nodes[name]}, 10.0)
    nodes = {"coworker_sim": NodeHealth(0, "session over", {}, 0.0, ended=True)}
    assert "ended: session over" in markup.nodes_table(nodes, 10.0)
    assert "silent" not in markup.nodes_table(nodes, 10.0)
    assert "ended" not in markup.nodes_table(nodes, 1.0), "it still reports"


def test_details_have_rates_latency_and_what_was_rejected():
    values = {"rate human/wrist [Hz]": "99.7", "latency p99 [ms]": "1.92", "rejected too_old": "4"}
    text = markup.nodes_table({"n": NodeHealth(0, "moving", values, 0.0)}, 1.0)
    for said in ("human/wrist 100 Hz", "latency p99 1.9 ms", "rejected too old 4"):
        assert said in text
    values |= {"rate x [Hz]": "fast"}
    assert "x fast Hz" in markup.nodes_table({"n": NodeHealth(0, "", values, 0.0)}, 1.0)
