# SPDX-License-Identifier: Apache-2.0
"""A label that cannot name a task is refused where it is given."""

import pytest
from rclpy.parameter import Parameter

from intent_recognition.errors import BagError
from intent_recognition.nodes.bag_recorder import BagRecorder
from intent_recognition.nodes.task_teacher import TaskTeacher

BAD = ("bad/label", "x" * 300, "a\x1b[2J", "..")


def make(kind, folder):
    values = {"library": str(folder)} if kind is TaskTeacher else {}
    return kind(parameter_overrides=[Parameter(name, value=v) for name, v in values.items()])


@pytest.mark.parametrize("kind", [BagRecorder, TaskTeacher])
def test_param_set_refuses_a_label(harness, tmp_path, kind):
    node = harness.add(make(kind, tmp_path / "tasks"))
    for label in BAD:
        (result,) = node.set_parameters([Parameter("task", value=label)])
        assert not result.successful
        assert "label" in result.reason
        assert "\x1b" not in result.reason
    (result,) = node.set_parameters([Parameter("task", value="give_cup")])
    assert result.successful


def test_a_recorder_does_not_start_with_such_a_label(harness):
    with pytest.raises(BagError, match="label"):
        BagRecorder(parameter_overrides=[Parameter("task", value="bad/label")])
