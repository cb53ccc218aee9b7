# SPDX-License-Identifier: Apache-2.0
"""What a session of the demo minds before it begins, and says when it has failed."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

from intent_recognition.cli import demo_session
from intent_recognition.cli.demo_session import begin_library
from intent_recognition.errors import IntentError, ResourceBusyError
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
    first = library.with_name("tasks_1")
    said = begin(library, library.with_name("model.npz"))
    assert said == (
        f"what the page was taught before is kept in {first}; --model {first}/model.npz has it\n"
    )
    assert not library.exists() and (first / "model.npz").read_text() == "taught"
    library.mkdir()
    assert "tasks_2;" in begin(library, first / "model.npz")
    assert begin(library, first / "model.npz") == ""  # there is none to keep


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
