# SPDX-License-Identifier: Apache-2.0
"""What observers keep: the demo's log of a session, and executions of tasks."""

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.bags import BagReader, RawMessage
from intent_recognition.model import Executions, now
from intent_recognition.nodes.execution_recorder import ExecutionRecorder
from intent_recognition.nodes.session_observer import SessionObserver
from sim_bridge.arm.lock_step import EDGES


def test_a_task_taught_meanwhile_is_left_out(harness):
    observer = harness.add(SessionObserver(print, print))
    for labels, p in (
        (["plate", "none"], [0.25, 0.75]),
        (["plate", "wave", "none"], [0.25, 0.5, 0.25]),
        (["none"], [1.0]),
    ):
        harness.hear(observer, "intent/tasks", JointState(name=labels, position=p))
    log = observer.log()
    assert log.labels == ("plate", "none")
    np.testing.assert_array_equal(log.probabilities, [[0.25, 0.75], [0.25, 0.25], [0.0, 1.0]])


def test_it_takes_all_that_the_clock_waits_for(harness):
    observer = harness.add(SessionObserver(print, print, namespace="awaited"))
    taken = {subscription.topic_name for subscription in observer._inputs}
    awaited = {f"/awaited/{edge.topic}" for edge in EDGES if edge.taker == "session_observer"}
    assert len(awaited) > 3 and awaited <= taken


def test_closed_it_hears_no_more(harness):
    observer = harness.add(SessionObserver(print, print, namespace="closing"))
    answers = harness.said(observer, "clock_answers")
    tasks = next(s for s in observer._inputs if s.topic_name == "/closing/intent/tasks")
    observer.close()
    tasks.callback(JointState(name=["plate"], position=[1.0]))  # was queued
    observer.close()
    assert [answer.name for answer in answers] == [[], []]
    assert observer.log().probabilities.size == 0
    assert tasks not in [*observer.subscriptions]


def test_of_several_people_each_log_holds_what_was_done_for_that_one(harness):
    observer = harness.add(SessionObserver(print, print, ("anna", "ben"), namespace="several"))
    said = [("person", "anna"), ("task", "plate"), ("person", "ben"), ("person", ""), ("task", "")]
    for what, text in said:
        harness.hear(observer, f"intent/active_{what}", String(data=text))
        message = JointState(position=[0.0, 0.0, 1.0])
        message.header.stamp = observer.get_clock().now().to_msg()
        message.header.frame_id = text
        harness.hear(observer, "coworker/hand", message)
    anna, ben = observer.log("anna"), observer.log("ben")
    assert anna.active == ben.active == ("plate", "")
    assert anna.active_ns[-1] == ben.active_ns[0]
    assert anna.contacts.holders == ("plate",) and ben.contacts.holders == ("ben",)


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
