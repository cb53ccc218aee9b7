# SPDX-License-Identifier: Apache-2.0
"""Recordings on the page: played, and compared under two models."""

import threading
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from dashboard.browser import free_port
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.bags import BagReader
from intent_recognition.dashboard import compare_tab
from intent_recognition.dashboard.cell import PersonState
from intent_recognition.dashboard.compare_tab import CompareTab, posterior_over
from intent_recognition.dashboard.node import Dashboard, shipped_bags
from intent_recognition.demonstrations import find_bags
from intent_recognition.errors import IntentError
from intent_recognition.evaluation import explain
from intent_recognition.model import load_model
from intent_recognition.nodes import qos
from intent_recognition.promp import NONE
from intent_recognition.report import heading, readable, task_colours
from intent_recognition.share import share_path


def test_a_timer_of_the_player_that_is_due_when_it_ends_does_no_harm(harness):
    player = Node("player")
    harness.executor.add_node(player)
    out = player.create_publisher(String, "played", 10)
    stopped = []

    def stop():
        if not stopped:
            stopped.append(True)
            Dashboard._stop(SimpleNamespace(executor=harness.executor), player)

    first = harness.probe.create_timer(0.1, stop)
    second = player.create_timer(0.2, lambda: out.publish(String()))
    while not (first.is_ready() and second.is_ready()):  # both are queued, in this order
        pass
    harness.spin_until(lambda: stopped)
    again = harness.probe.create_timer(0.01, lambda: stopped.append(True))
    harness.spin_until(lambda: len(stopped) > 3)
    again.cancel()


@pytest.mark.slow
def test_where_people_have_names_the_first_one_moves_as_recorded(harness, repository):
    node = harness.node(Dashboard, port=free_port())
    for name in ("ben", "anna"):
        node.state.people[name] = PersonState()
    moved = harness.collect(PoseStamped, "mocap/anna/wrist/pose", qos.SENSOR)
    player = node._play(repository / "bags/toolbox/test/plate_handover_00", 0.0, 5.0)
    harness.spin_until(lambda: moved, what="the recorded wrist")
    node._stop(player)


def test_those_of_the_demo_that_were_not_learned_come_first():
    bags, tests = shipped_bags(), find_bags(share_path("bags/toolbox/test"))
    assert bags[: len(tests)] == tests
    assert sorted(bags) == sorted(find_bags(share_path("bags")))


@pytest.fixture
def recording(repository):
    return sorted((repository / "bags/toolbox/test").iterdir())[0]


@pytest.fixture
def compare(server, recording, toolbox_model, tmp_path):
    """A tab with one recording, a good and a broken model, run to its end."""
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"no model")
    models = [toolbox_model, broken]
    tab = CompareTab(server, [recording], lambda: models, lambda: task_colours(["taught"]))

    def run(first, second):
        for field, name in zip(tab._chosen, (first, second), strict=True):
            field.value = next(path for path in field.options if path.endswith(name))
        tab._start()
        for thread in threading.enumerate():
            if thread.name == "compare":
                thread.join()
        return tab

    return SimpleNamespace(tab=tab, run=run, models=models)


def test_the_posterior_is_that_of_the_recording(recording, toolbox_model):
    task = BagReader(recording).custom_data["task"]
    times, columns, (acts, after, at_the_end) = posterior_over(recording, toolbox_model)
    assert times[0] == 0.0 and np.all(np.diff(times) > 0.0) and len(times) <= 800
    np.testing.assert_allclose(np.sum(list(columns.values()), axis=0), 1.0, atol=1e-9)
    known = [label for label in columns if label != NONE]
    assert max(known, key=lambda label: columns[label].max()) == task
    assert acts == readable(task)
    assert 0.0 < float(after.removesuffix(" s")) < times[-1]
    assert at_the_end.rsplit(" ", 1)[0] == readable(task)  # of the movement, not of the rest


def test_an_unknown_movement_is_unknown_at_its_end(recording, toolbox_model, monkeypatch):
    seen = ((0.6, 0.1), (0.0, 0.9), (0.0, 0.0))  # probability of a task, and phase; the last rests
    rows = [
        {
            "stamp": k,
            "probabilities": {"task": p, NONE: 1.0 - p},
            "phase": {"task": phase, NONE: 0.0},
            "active_task": "",
        }
        for k, (p, phase) in enumerate(seen)
    ]
    monkeypatch.setattr("intent_recognition.dashboard.compare_tab.replay", lambda *_: rows)
    assert posterior_over(recording, toolbox_model)[2] == ("nothing", "-", f"{NONE} 100%")


def test_a_recording_without_the_topics_of_the_model_is_named(repository, toolbox_model):
    other = sorted((repository / "bags/pole").rglob("metadata.yaml"))[0].parent
    with pytest.raises(IntentError, match="expected observations on mocap/wrist/pose"):
        posterior_over(other, toolbox_model)


def watch_at_once(monkeypatch):
    """From now on nothing is replayed and nothing explained."""
    drawn = np.arange(2.0), {"a": np.ones(2)}, ("a", "1.00 s", "a 100%")
    monkeypatch.setattr(compare_tab, "posterior_over", lambda *_: drawn)
    monkeypatch.setattr(compare_tab, "why_over", lambda *_: "")


def test_two_models_are_drawn_and_their_decision_is_explained_as_by_intent_explain(
    compare, recording, toolbox_model, monkeypatch
):
    tab = compare.run("broken.npz", "toolbox.npz")
    assert "broken.npz" in tab._result.content and not tab._button.disabled
    assert not tab._plots
    compare.run("toolbox.npz", "toolbox.npz")
    assert len(tab._plots) == 2 and tab._place.visible and not tab._button.disabled
    assert tab._result.content.count(readable(BagReader(recording).custom_data["task"])) >= 2
    one, *_ = explain(BagReader(recording), load_model(toolbox_model))
    told = f"model A and B: {heading(one)}"
    assert tab._result.content.count(told) == 1, "equal models are explained once"
    total = one.evidence.by_dof[:, 2].sum()
    assert f"{total:+.1f}" in tab._result.content
    assert tab._result.content.count("&#9632;") == 4  # names of the curves
    watch_at_once(monkeypatch)
    compare.run("toolbox.npz", "toolbox.npz")
    assert len(tab._plots) == 2, "the diagrams before are gone"


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("step", ["why_over", "task_colours"])
def test_whatever_fails_is_said(compare, monkeypatch, step):
    watch_at_once(monkeypatch)
    monkeypatch.setattr(compare_tab, step, Mock(side_effect=RuntimeError("no such luck")))
    tab = compare.run("toolbox.npz", "toolbox.npz")
    assert "no such luck" in tab._result.content and not tab._button.disabled


def test_only_models_that_are_there_are_found(toolbox_model, tmp_path):
    (tmp_path / "gone.npz").symlink_to(tmp_path / "nothing.npz")
    (tmp_path / "other.npz").write_bytes(b"no model")
    for folder in ("a", "b/c"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "model.npz").symlink_to(toolbox_model)
    found = Dashboard._find_models(SimpleNamespace(_models=str(tmp_path)))
    assert found == [tmp_path / "a/model.npz", tmp_path / "b/c/model.npz"]


def test_models_that_come_later_are_offered(compare, toolbox_model):
    compare.models.pop()
    compare.tab.refresh()
    (offered,) = compare.tab._chosen[0].options
    assert offered.endswith("toolbox.npz")
