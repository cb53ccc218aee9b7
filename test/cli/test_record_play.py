# SPDX-License-Identifier: Apache-2.0
"""`intent record` and `intent play` run the nodes with the parameters their options name."""

import io
import signal
from pathlib import Path

import pytest
import yaml
from bag_builder import raw, write_bag
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from ros_harness import NodeProcess

from intent_recognition.bags.reader import BagReader
from intent_recognition.cli import play, record
from intent_recognition.cli.options import node_arguments
from intent_recognition.nodes import runtime
from intent_recognition.nodes.processes import yaml_value

INTENT = "intent_recognition.cli.main"


def test_record_options_become_parameters(parse, monkeypatch, tmp_path):
    args = parse("record", "a", "b/c", "--output", tmp_path / "new", "--task", "plate")
    expected = {"output": str(tmp_path / "new"), "task": "plate", "topics": ["a", "b/c"]}
    assert record.parameters(args) == expected
    monkeypatch.chdir(tmp_path)
    found = record.parameters(parse("record", "--output", "new"))
    assert "topics" not in found and found["output"] == str(tmp_path / "new")


def test_play_options_become_parameters(parse):
    args = parse("play", "/b", "--rate", "0", "--loop", "--paused", "--wait", "7", "--clock")
    assert play.parameters(args) == {
        "bag": "/b", "rate": 0.0, "loop": True, "start_paused": True,
        "wait_for_subscribers": 7.0, "clock": True, "restamp": False,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("",), "argument TOPIC: expected a topic such as /joint_states"),
        (("/joint states",), "argument TOPIC: expected a topic"),
        (("/a", "--namespace", "cell 1"), "argument --namespace: expected a namespace"),
        (("/a", "--namespace", "1"), "argument --namespace: expected a namespace"),
        *(
            (("/a", "--remap", rule), "argument --remap: expected FROM:=TO")
            for rule in ("/a", "/a:=", "/a:=/b c", "a:=b:=c")
        ),
    ],
)
def test_a_name_that_ros_cannot_have_is_refused(refused, words, message):
    assert message in refused("record", "--output", "new", *words)


@pytest.mark.parametrize("rule", ["a:=b", "/**:=/{node}/x", "recorder:~/in:=~/out", "__node:=r"])
def test_every_kind_of_rule_and_name_passes(parse, rule):
    args = parse("record", "--output", "new", "~/a", "{ns}/b", "/c/_d9", "--remap", rule)
    assert args.remap == [rule]
    for namespace in ("", "/", "cell/", "/a/b_1"):
        assert parse("play", "/b", "--namespace", namespace).namespace == namespace


def test_namespace_and_remapping(parse):
    args = parse("play", "/b", "--namespace", "cell/", "--remap", "x:=y")
    command = node_arguments(args, {"loop": False})
    assert command[:4] == ["intent", "--ros-args", "-p", "loop:=false"]
    assert command[4:] == ["-r", "__ns:=/cell", "-r", "x:=y"]


@settings(deadline=None)
@given(
    st.one_of(
        st.booleans(),
        st.floats(allow_nan=False, allow_infinity=False, min_value=-1e6, max_value=1e6),
        st.text(st.characters(min_codepoint=32, max_codepoint=126)),
        st.lists(st.text(st.characters(min_codepoint=32, max_codepoint=126)), min_size=1),
    )
)
def test_values_keep_their_type_in_yaml(value):
    read = yaml.safe_load(yaml_value(value))
    if not (isinstance(value, float) and "e" in yaml_value(value)):
        assert type(read) is type(value)
    assert type(value)(read) == value
    assert yaml_value(Path("a b")) == yaml_value("a b")


def test_on_a_terminal_a_bar_is_there_before_the_bag_is_opened(parse, tmp_path, monkeypatch):
    console = Console(file=io.StringIO(), force_terminal=True, width=100)
    monkeypatch.setattr(play, "Console", lambda **_: console)
    monkeypatch.setattr(runtime, "run", lambda *_: 0)
    args = parse("play", write_bag(tmp_path / "bag"))
    assert args.run(args) == 0
    assert "seconds played" in console.file.getvalue()


@pytest.mark.slow
def test_what_is_played_is_recorded_until_a_signal_ends_it(tmp_path):
    """Ctrl-C: test/docs/test_run.py."""
    bag = write_bag(tmp_path / "take 1", count=40)
    copy = tmp_path / "copy of 1"
    record_command = ("record", "mocap/wrist/pose", "joint_states", "--output", str(copy))
    with NodeProcess(INTENT, *record_command, "--task", "plate: 1") as recorder:
        with NodeProcess(INTENT, "play", str(bag), "--rate", "0", "--wait", "30") as player:
            assert player.wait() == 0, player.errors
        assert recorder.stop(signal.SIGTERM) == 0, recorder.errors
    assert "Traceback" not in recorder.errors + player.errors
    by_topic = [sorted((m[0], m[4]) for m in raw(path, BagReader)) for path in (bag, copy)]
    assert by_topic[0] == by_topic[1]
    assert BagReader(copy).is_finished and BagReader(copy).custom_data["task"] == "plate: 1"
