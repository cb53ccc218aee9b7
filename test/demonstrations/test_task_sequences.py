# SPDX-License-Identifier: Apache-2.0
"""Reading from session bags which task followed which."""

import pytest
from bag_builder import write_bag

from intent_recognition.bags.writer import BagWriter
from intent_recognition.demonstrations import read_task_sequences
from intent_recognition.errors import BagError
from intent_recognition.recognition import FORGET_AFTER_S

STRING = "std_msgs/msg/String"
START_NS = 1_700_000_000_000_000_000


def session(path, events, topic="demonstration"):
    """A bag of labels: (seconds, text)."""
    with BagWriter(path) as writer:
        for seconds, text in events:
            at_ns = START_NS + round(seconds * 1e9)
            writer.write_message(topic, STRING, {"data": text}, at_ns)
    return path


def tasks(*paths, **options):
    sequences, rejections = read_task_sequences(
        paths, **{"forget_after_s": FORGET_AFTER_S} | options
    )
    assert rejections == []
    return [sequence.tasks for sequence in sequences]


@pytest.mark.parametrize(
    ("events", "topic", "expected"),
    [
        ([(1, "plate"), (3, ""), (5, "screw"), (7, "")], "demonstration", [("plate", "screw")]),
        # an end that is missing
        ([(1, "plate"), (5, "screw"), (7, "")], "demonstration", [("plate", "screw")]),
        # where there are no markers; a switch is one movement
        (
            [(0, ""), (1, "plate"), (2, "screw"), (3, ""), (5, "plate"), (6, "")],
            "/cell1/intent/active_task",
            [("screw", "plate")],
        ),
    ],
)
def test_markers_or_active_tasks_give_the_order(tmp_path, events, topic, expected):
    assert tasks(session(tmp_path / "s", events, topic)) == expected


def test_a_long_silence_ends_a_sequence(tmp_path):
    path = session(
        tmp_path / "s", [(1, "plate"), (3, ""), (63.5, "screw"), (200, ""), (210, "plate")]
    )
    assert tasks(path) == [("plate",), ("screw", "plate")]
    assert tasks(path, forget_after_s=100.0) == [("plate", "screw", "plate")]


def test_a_folder_with_bags_that_are_no_sessions(tmp_path):
    session(tmp_path / "bags" / "good", [(1, "plate"), (3, "")])
    write_bag(tmp_path / "bags" / "single")
    (tmp_path / "bags" / "void").mkdir()
    (tmp_path / "bags" / "void" / "void_0.mcap").write_bytes(b"")
    sequences, rejections = read_task_sequences([tmp_path / "bags"], FORGET_AFTER_S)
    assert [s.tasks for s in sequences] == [("plate",)]
    assert "no session" in str(rejections[0]) and len(rejections) == 2
    (tmp_path / "nothing").mkdir()
    _, rejections = read_task_sequences([tmp_path / "nothing"], FORGET_AFTER_S)
    assert "no bag" in str(rejections[0])
    with pytest.raises(BagError):
        read_task_sequences([tmp_path / "elsewhere"], FORGET_AFTER_S)
