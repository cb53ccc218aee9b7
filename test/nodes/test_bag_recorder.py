# SPDX-License-Identifier: Apache-2.0
"""What the recorder writes is what was sent: bit for bit, with its stamps, for any type."""

import threading
from collections.abc import Sequence

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from ros_harness import Harness
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty, String
from visualization_msgs.msg import MarkerArray

from intent_recognition.bags.reader import BagReader
from intent_recognition.errors import BagError
from intent_recognition.nodes import topic_recorder
from intent_recognition.nodes.bag_recorder import BagRecorder
from intent_recognition.nodes.qos import LATCHED, SENSOR, STATE


def recorder(namespace: str = "", words: Sequence[str] = (), **values) -> BagRecorder:
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return BagRecorder(namespace=namespace, cli_args=[*words], parameter_overrides=overrides)


def pose(index: int) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = "world"
    message.header.stamp.sec, message.header.stamp.nanosec = 7, index
    message.pose.position.x = 0.1 * index
    return message


def record_between(harness: Harness, node: BagRecorder, publishers: dict, messages: dict) -> None:
    """Publish `messages` by topic once the recorder listens, and stop when all have arrived."""
    harness.spin_until(lambda: all(f"/{t}" in node.listening for t in publishers))
    harness.connect(*publishers.values())
    for topic, items in messages.items():
        for item in items:
            publishers[topic].publish(item)
    total = sum(map(len, messages.values()))
    harness.spin_until(lambda: node._writer.message_count >= total, what="all messages written")
    node.stop()


def test_bytes_and_order_are_those_sent(harness, tmp_path):
    sent = {
        "mocap/wrist/pose": [pose(i) for i in range(8)],
        "joint_states": [JointState(name=["a", "b"], position=[0.1 * i, -1.0]) for i in range(8)],
        "nothing": [Empty()],
        "markers": [MarkerArray()],
    }
    publishers = {t: harness.publisher(type(items[0]), t, STATE) for t, items in sent.items()}
    wire = {topic: [] for topic in sent}
    for topic, (item, *_) in sent.items():
        hear = harness.probe.create_subscription
        hear(type(item), topic, lambda d, t=topic: wire[t].append(bytes(d)), 10, raw=True)
    node = harness.add(recorder(output=str(tmp_path / "bag"), topics=list(sent), task="handing"))
    record_between(harness, node, publishers, sent)
    harness.spin_until(lambda: all(len(wire[t]) == len(items) for t, items in sent.items()))
    with AnyReader([tmp_path / "bag"]) as independent:
        for connection in independent.connections:
            topic = connection.topic.lstrip("/")
            raw = [data for _, _, data in independent.messages([connection])]
            assert [bytes(r) for r in raw] == wire[topic]
        assert independent.message_count == sum(map(len, sent.values()))
    assert BagReader(tmp_path / "bag").custom_data["task"] == "handing"


def test_a_burst_that_was_received_before_the_stop_is_in_the_bag(harness, tmp_path):
    publisher = harness.publisher(PoseStamped, "mocap/wrist/pose", 2000)
    node = harness.add(recorder(output=str(tmp_path / "bag"), topics=["mocap/wrist/pose"]))
    harness.connect(publisher)
    for index in range(1000):
        publisher.publish(pose(index))
    assert publisher.wait_for_all_acked(Duration(seconds=30))
    node.stop()
    stamps = [m.stamp_ns for m in BagReader(tmp_path / "bag").messages()]
    assert stamps == [7_000_000_000 + i for i in range(1000)]


def test_services_start_and_stop_with_the_parameters_of_the_moment(harness, tmp_path):
    """A latched message from before the start is recorded, too."""
    publisher = harness.publisher(PoseStamped, "p", STATE)
    harness.publisher(String, "latched", LATCHED).publish(String(data="<robot/>"))
    node = harness.add(recorder(topics=["p", "latched"]))
    refused = harness.trigger("bag_recorder/start")
    assert not refused.success and "output" in refused.message
    harness.spin_until(lambda: any(s.last is not None for s in node._sources.values()))
    for task in ("one", "two"):
        values = {"output": str(tmp_path / task), "task": task}
        node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
        assert harness.trigger("bag_recorder/start").success
        record_between(harness, node, {"p": publisher}, {"p": [pose(0)] * 2})
        bag = BagReader(tmp_path / task)
        assert bag.custom_data["task"] == task
        assert [m.message.data for m in bag.messages(["latched"])] == ["<robot/>"]
        (profile,) = bag.topics["/latched"].offered_qos_profiles
        assert profile["durability"] == "transient_local"
    again = harness.trigger("bag_recorder/start")
    assert not again.success and "never overwritten" in again.message
    assert not harness.trigger("bag_recorder/stop").success


def test_full_disk_is_reported_and_ends_the_recording_whole(harness, tmp_path, monkeypatch):
    publisher = harness.publisher(PoseStamped, "p", STATE)
    node = harness.add(recorder(output=str(tmp_path / "bag"), topics=["p"]))
    reports = harness.collect(DiagnosticArray, "/diagnostics")
    harness.connect(publisher)
    publisher.publish(pose(0))
    harness.spin_until(lambda: node._writer.message_count)
    monkeypatch.setattr(node._writer, "_disk_usage", lambda _: type("U", (), {"free": 0}))
    harness.spin_until(lambda: node.done, what="the recorder to give up")
    assert node.exit_code == 1
    assert len(list(BagReader(tmp_path / "bag").messages())) == 1
    harness.spin_until(
        lambda: any("MiB" in s.message for r in reports for s in r.status if s.level == b"\x02")
    )


@pytest.mark.parametrize(
    ("namespace", "in_graph"), [("lab", "/lab/mocap/wrist/pose"), ("", "/tracker/wrist")]
)
def test_neither_namespace_nor_remapping_is_in_the_bag(harness, tmp_path, namespace, in_graph):
    """That every node of a graph is told of the arm's topics: test_launch.py."""
    topic = "mocap/wrist/pose"
    words = [] if namespace else ["--ros-args", "-r", f"{topic}:={in_graph}"]
    publisher = harness.publisher(PoseStamped, in_graph, STATE)
    output = str(tmp_path / "bag")
    node = harness.add(recorder(namespace, words, output=output, topics=[topic]))
    harness.connect(publisher)
    publisher.publish(pose(0))
    harness.spin_until(lambda: node._writer.message_count)
    node.stop()
    assert list(BagReader(tmp_path / "bag").topics) == [f"/{topic}"]


def test_all_there_are_in_a_namespace_leave_other_cells_out(harness, tmp_path):
    """A topic of the same name elsewhere would become the same topic of the bag."""
    node = harness.add(recorder("lab", output=str(tmp_path / "bag")))
    publishers = [
        harness.publisher(PoseStamped, topic, STATE)
        for topic in ("/p", "/lab/p", "/lab2/p", "/diagnostics_of_others")
    ]
    harness.connect(publishers[1])
    harness.spin_until(lambda: {"/lab/p", "/diagnostics"} <= set(node.listening))
    harness.spin_until(lambda: all(node.count_publishers(p.topic_name) for p in publishers))
    node.discover()
    assert not {"/p", "/lab2/p", "/diagnostics_of_others", "/rosout"} & set(node.listening)
    publishers[1].publish(pose(3))
    harness.spin_until(lambda: node._writer._counts.get("/p"), what="the message written")
    node.stop()
    assert BagReader(tmp_path / "bag").topics["/p"].message_count == 1


def test_topics_that_would_be_one_in_the_bag_are_refused(harness, tmp_path):
    with pytest.raises(BagError, match="differ in the bag"):
        recorder("lab", topics=["p", "/p"])
    assert "bag_listener" not in {thread.name for thread in threading.enumerate()}


def test_simulated_time_is_what_is_logged_and_a_bag_begins_with_it(harness, tmp_path):
    """Only what was latched before is kept: the arm, the plan and what is expected first."""
    clock = harness.publisher(Clock, "/clock", STATE)
    publisher = harness.publisher(PoseStamped, "p", STATE)
    latched = harness.publisher(String, "plan", LATCHED)
    parameters = {"output": str(tmp_path / "bag"), "topics": ["p", "plan"], "use_sim_time": True}
    node = harness.add(recorder(**parameters))
    harness.spin_until(lambda: {"/p", "/plan"} <= set(node.listening))
    harness.connect(publisher, clock, latched)
    publisher.publish(pose(0))
    harness.spin_until(lambda: node.diagnostics.rejected("no_clock"), what="refusal")
    for text in ("old", "first"):
        latched.publish(String(data=text))
    plan = node._sources["/plan"]
    harness.spin_until(lambda: plan.last is not None and b"first" in plan.last.data)
    for second in (5, 6):
        clock.publish(Clock(clock=Time(sec=second)))
        now = node.get_clock().now
        harness.spin_until(lambda n=now, s=second: n().nanoseconds == s * 1_000_000_000)
        publisher.publish(pose(second))
        written = second - 3
        harness.spin_until(lambda n=written: node._writer.message_count == n)
    latched.publish(String(data="second"))
    harness.spin_until(lambda: node._writer.message_count == 4)
    node.stop()
    bag = BagReader(tmp_path / "bag")
    assert [m.message.data for m in bag.messages(["plan"])] == ["first", "second"]
    times_ns = [5_000_000_000, 5_000_000_000, 6_000_000_000, 6_000_000_000]
    assert [m.log_time_ns for m in bag.raw_messages()] == times_ns
    assert [m.publish_time_ns for m in bag.raw_messages()] == times_ns


def test_a_bag_in_which_nothing_came_once_the_clock_ran_has_what_was_latched(harness, tmp_path):
    clock, latched = (
        harness.publisher(Clock, "/clock", STATE),
        harness.publisher(String, "plan", LATCHED),
    )
    parameters = {"output": str(tmp_path / "bag"), "topics": ["plan"], "use_sim_time": True}
    node = harness.add(recorder(**parameters))
    harness.spin_until(lambda: "/plan" in node.listening)
    harness.connect(clock, latched)
    latched.publish(String(data="first"))
    harness.spin_until(lambda: node._sources["/plan"].last is not None)
    clock.publish(Clock(clock=Time(sec=5)))
    harness.spin_until(lambda: node.get_clock().now().nanoseconds == 5_000_000_000)
    node.stop()
    (message,) = BagReader(tmp_path / "bag").messages(["plan"])
    assert (message.message.data, message.log_time_ns) == ("first", 5_000_000_000)


@pytest.mark.parametrize("topics", [{}, {"topics": ["late", "early"]}])
def test_topics_that_nobody_publishes_are_named_once(harness, tmp_path, monkeypatch, topics):
    monkeypatch.setattr(topic_recorder, "PATIENCE_S", 0.5)
    early = harness.publisher(PoseStamped, "alone/early", SENSOR) if topics else None
    node = harness.add(recorder("alone", output=str(tmp_path / "new"), **topics))
    said = []
    monkeypatch.setattr(node.get_logger(), "warning", said.append)
    harness.spin_until(lambda: said)
    named = "to /alone/late" if early else "anything"
    assert said == [f"nobody publishes {named} yet; what comes is recorded"]


def test_a_best_effort_publisher_joining_later_is_heard(harness, tmp_path):
    node = harness.add(recorder(output=str(tmp_path / "bag"), topics=["p"]))
    first = harness.publisher(PoseStamped, "p", STATE)
    harness.connect(first)
    second = harness.publisher(PoseStamped, "p", SENSOR)
    harness.connect(first, second)
    second.publish(pose(1))
    harness.spin_until(lambda: node._writer.message_count)
