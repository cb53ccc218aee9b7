# SPDX-License-Identifier: Apache-2.0
"""What a demo minds before its session, its model and nodes that hang."""

import io
import os
from functools import partial
from types import SimpleNamespace
from unittest.mock import Mock, patch

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rich.console import Console

from intent_recognition.cli import demo_model as demo
from intent_recognition.cli import demo_session
from intent_recognition.cli import train as training
from intent_recognition.cli.demo_session import begin_library, watched_graph
from intent_recognition.cli.session_watch import HUNG_S, Heartbeats, NodeWatch
from intent_recognition.errors import IntentError, ResourceBusyError
from intent_recognition.nodes.diagnostics import Level
from sim_bridge.scenarios import toolbox


@pytest.fixture
def library(tmp_path):
    """A library that a page was taught tasks in before."""
    path = tmp_path / "tasks"
    path.mkdir()
    (path / "model.npz").write_text("taught")
    return path


def begin(library, model):
    console = Console(file=io.StringIO(), width=40)
    begin_library(library, model, console)
    return console.file.getvalue()


def test_each_session_begins_with_the_estimators_model_and_keeps_what_was_taught(library):
    kept = library.with_name("tasks_1")
    said = begin(library, library.with_name("model.npz"))
    assert said == f"tasks taught on the page before are in {kept}; use --model {kept}/model.npz\n"
    assert not library.exists() and (kept / "model.npz").read_text() == "taught"
    library.mkdir()
    assert "tasks_2;" in begin(library, kept / "model.npz")
    assert begin(library, kept / "model.npz") == ""  # there is none to keep


def test_a_library_goes_on_with_its_own_model(library):
    assert begin(library, library / "model.npz") == "" and library.exists()
    with pytest.raises(ResourceBusyError, match="a model outside of"):
        begin(library, library / "models" / "0001.npz")


@pytest.mark.parametrize("topic", ["mocap/wrist/pose", "joint_states", "/clock"])
def test_foreign_publishers_are_refused(topic, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    watch = SimpleNamespace(for_seconds=lambda _: None)
    published: set[str] = set()
    observer = SimpleNamespace(
        get_node_names=lambda: ["session_observer"], count_publishers=published.__contains__
    )
    demo_session.refuse_busy_domain(observer, watch)
    published.add(topic)
    with pytest.raises(ResourceBusyError, match=f"ROS_DOMAIN_ID 7: .*got publishers of {topic}"):
        demo_session.refuse_busy_domain(observer, watch)


@pytest.mark.parametrize(("n", "got"), [(0, "got none"), (3, "got 3 poses, none of them at a")])
def test_poses_of_strangers_are_not_called_none(n, got, monkeypatch):
    log = SimpleNamespace(wrist_ns=range(n))
    monkeypatch.setattr(demo_session, "_calls", lambda *_: {})
    monkeypatch.setattr(demo_session, "_run_graph", lambda *_: ({"": log}, 1.0))
    monkeypatch.setattr(toolbox, "first_sample_ns", lambda *_: None)
    scene = SimpleNamespace(plans={"": SimpleNamespace(interactions=())})
    with pytest.raises(IntentError, match=got):
        demo_session.run_session(SimpleNamespace(dashboard=False), "m.npz", None, scene)


def test_an_empty_domain_is_none_chosen(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert demo_session._domain() in range(1, 102)


class Watched:
    """Heartbeats looked at every tenth of a second."""

    def __init__(self):
        self.now_s = 100.0
        self.heartbeats = Heartbeats(lambda: self.now_s)

    def run(self, seconds, speaking, running, step_s=0.1):
        for _ in range(round(seconds / step_s)):
            self.now_s += step_s
            for name in speaking:
                self.heartbeats.hear(name)
            self.heartbeats.check(running)


def test_a_node_that_falls_silent_is_named():
    watched = Watched()
    watched.run(60.0, ["arm", "ingest"], ["arm", "ingest", "starting"])
    watched.run(HUNG_S - 1.0, ["ingest"], ["arm", "ingest", "starting"])
    with pytest.raises(IntentError, match=r"node arm: expected reports on /diagnostics"):
        watched.run(2.0, ["ingest"], ["arm", "ingest", "starting"])


def test_a_node_that_has_ended_is_not_missed_and_none_while_the_demo_was_stopped():
    watched = Watched()
    watched.run(1.0, ["coworker", "arm"], ["coworker", "arm"])
    watched.run(60.0, ["arm"], ["arm"])
    watched.run(3600.0, [], ["arm"], step_s=3600.0)
    watched.run(10.0, [], ["arm"])


def test_while_it_waits_for_something_a_node_that_dies_is_noticed():
    """That it is named: test_lifecycle.py."""
    processes = SimpleNamespace(check=Mock(side_effect=IntentError("node arm")))
    watch = NodeWatch(processes, None, Heartbeats(), SimpleNamespace(take=lambda: False))
    with pytest.raises(IntentError, match="node arm"):
        watch.until(lambda: False, 60.0, "the end")
    processes.check.assert_called_once_with(may_end=("coworker_sim", "bag_player"))


def test_who_was_not_waited_for_is_remembered():
    heartbeats = Heartbeats()
    heartbeats.hear("lwr_sim", "intent_estimator")
    heartbeats.hear("mocap_ingest")
    assert heartbeats.unanswered == "intent_estimator"


def test_an_error_that_a_node_reports_is_said_once_until_it_is_over(tmp_path):
    console = Console(file=io.StringIO(), width=40)
    args, make = SimpleNamespace(output=tmp_path), partial(Node, "observer")
    with patch.dict(os.environ), watched_graph(args, console, make) as (observer, watch):
        publisher = observer.create_publisher(DiagnosticArray, "/diagnostics", 10)
        watch.until(lambda: publisher.get_subscription_count() > 0, 60.0, "its own reports")
        for k, level in enumerate((Level.WARN, Level.ERROR, Level.ERROR, Level.OK, Level.ERROR)):
            name, level = str(k), bytes([level])
            own = DiagnosticStatus(name="arm", level=level, message=f"{k} publishes, too")
            publisher.publish(DiagnosticArray(status=[own, DiagnosticStatus(name=name)]))
            watch.until(lambda name=name: name in watch.heartbeats.names, 60.0, "the report")
    assert console.file.getvalue() == "arm: 1 publishes, too\narm: 4 publishes, too\n"


def test_a_second_demo_of_the_same_recordings_does_not_train(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(demo, "save_model", lambda path, model, trained: path.write_text(model))
    monkeypatch.setattr(training, "print_library", lambda *_: None)
    monkeypatch.setattr(demo, "share_path", lambda name: tmp_path / name)
    scene = SimpleNamespace(dofs="", bags="bags", sessions="")
    (tmp_path / "bags").mkdir()
    trained = []

    def train(bags, *_):
        trained.append((tmp_path / "bags" / "one").read_text())
        return Model(trained[-1]), SimpleNamespace(trained=None)

    class Model(str):
        library = None

    monkeypatch.setattr(training, "train", train)
    for content in ("a", "a", "b", "a"):
        (tmp_path / "bags" / "one").write_text(content)
        found = demo.trained_model(tmp_path / "model.npz", Console(quiet=True), scene)
        assert found.read_text() == content
    assert trained == ["a", "b"]


def test_the_key_is_of_names_too(tmp_path):
    (tmp_path / "one").write_text("a")
    before = demo.content_key([tmp_path])
    (tmp_path / "one").rename(tmp_path / "two")
    assert demo.content_key([tmp_path]) != before
