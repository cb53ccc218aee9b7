# SPDX-License-Identifier: Apache-2.0
"""Executions are recorded whole, with what came of them."""

from intent_recognition.bags import BagReader, RawMessage
from intent_recognition.model import Executions, now
from intent_recognition.nodes.execution_recorder import ExecutionRecorder


def test_a_corrected_execution_stays_one_when_its_task_begins_again_at_once(tmp_path):
    """The outcome is that of the last interaction then, which nobody corrected."""
    log = Executions(tmp_path, now)
    recorder = ExecutionRecorder(log, 5, lambda: "", lambda reason, text: None)
    recorder.correct(b"", 1)  # of no execution: it does not count
    for corrected in (True, False):
        recorder.set_task("cup")
        if corrected:
            recorder.correct(b"", 2)
        recorder.add("cup", {"outcome": "arrived", "corrections": "0"})
        recorder.set_task("")
    assert [one.corrected for one in log.all()] == [True, False]


def test_an_execution_holds_one_pass_of_a_recording(tmp_path):
    log = Executions(tmp_path, now)
    recorder = ExecutionRecorder(log, 5, lambda: "", lambda reason, text: None)
    for time_ns, task in ((7_000_000_000, "cup"), (2_000_000_000, ""), (3_000_000_000, "cup")):
        recorder.take(RawMessage("t", "std_msgs/msg/Empty", time_ns, time_ns, bytes(5)))
        if task:
            recorder.set_task(task)
    recorder.close()
    bags = [BagReader(tmp_path / one.bag) for one in log.all()]
    seen = [[message.log_time_ns for message in bag.raw_messages()] for bag in bags]
    assert seen == [[7_000_000_000], [2_000_000_000, 3_000_000_000]]


def test_a_disk_that_is_full_ends_no_teacher(tmp_path):
    (tmp_path / "outcomes.jsonl").symlink_to("/dev/full")
    rejected = []
    recorder = ExecutionRecorder(
        Executions(tmp_path, now), 5, str, lambda *why: rejected.append(why)
    )
    recorder.set_task("cup")
    recorder.set_task("")
    recorder.add("cup", {"outcome": "arrived"})
    assert [reason for reason, _ in rejected] == ["execution_not_recorded"] * 2
    assert "no space left on device. Free space" in rejected[0][1]
