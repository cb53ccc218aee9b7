# SPDX-License-Identifier: Apache-2.0
"""Replay sends the recorded bytes in the recorded rhythm, to whoever listens from the start."""

import time
from unittest.mock import Mock

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from intent_recognition.bags import BagReader, BagWriter, RawMessage, TopicInfo, rosbag2_profile
from intent_recognition.bags.definitions import serialize
from intent_recognition.errors import BagError
from intent_recognition.nodes import bag_player
from intent_recognition.nodes.bag_player import BagPlayer, shift_stamp
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.diagnostics import Level
from intent_recognition.nodes.qos import LATCHED, SENSOR, recorded_profile

POSE = "geometry_msgs/msg/PoseStamped"
START_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000
EVERY = 100
"""Depth that keeps all there is: with a reliable publisher nothing may be missing."""


def pose_fields(index: int) -> dict:
    return {
        "header": {"stamp": START_NS + index * STEP_NS, "frame_id": "world"},
        "pose": {"position": {"x": 0.01 * index}},
    }


def write(path, *profiles, damaged=None):
    """A description and thirty poses, recorded from publishers that offered `profiles`.

    Those at the indices of `damaged` are other bytes.
    """
    with BagWriter(path, {"task": "t"}) as writer:
        writer.write_message("robot_description", "std_msgs/msg/String", {"data": "r"}, START_NS)
        writer.add_topic("mocap/wrist/pose", POSE, [rosbag2_profile(*p) for p in profiles])
        for i in range(30):
            at_ns = START_NS + i * STEP_NS
            data = (damaged or {}).get(i, serialize(POSE, pose_fields(i)))
            writer.write("mocap/wrist/pose", POSE, data, at_ns, at_ns)
    return path


@pytest.fixture
def bag(tmp_path):
    """Of poses whose publisher was reliable, so that each must arrive."""
    return write(tmp_path / "bag", ("reliable", "volatile", 10))


def player(harness, bag, **values) -> BagPlayer:
    return harness.node(BagPlayer, bag=str(bag), **values)


def raw_collector(harness, message_type, topic, qos):
    seen = []
    harness.probe.create_subscription(
        message_type, topic, lambda d: seen.append((time.monotonic(), bytes(d))), qos, raw=True
    )
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 5.0])
def test_every_byte_arrives_from_the_first_message_on(harness, bag, rate):
    seen = raw_collector(harness, PoseStamped, "mocap/wrist/pose", EVERY)
    node = player(harness, bag, rate=rate)
    harness.spin_until(lambda: len(seen) >= 30 and node.done)
    recorded = [m.data for m in BagReader(bag).raw_messages(["/mocap/wrist/pose"])]
    assert [data for _, data in seen] == recorded


def test_latched_and_sensor_topics_keep_their_quality(harness, tmp_path):
    seen = raw_collector(harness, PoseStamped, "mocap/wrist/pose", SENSOR)
    described = harness.collect(String, "robot_description", LATCHED)
    node = player(harness, write(tmp_path / "bag"), rate=5.0)
    harness.spin_until(lambda: seen and described and node.done)
    offered = {p.topic_name: p for p in node.publishers}["/mocap/wrist/pose"].qos_profile
    assert offered.reliability == QoSReliabilityPolicy.BEST_EFFORT


def test_rhythm_is_the_recorded_one(harness, bag, monkeypatch):
    harness.collect(PoseStamped, "mocap/wrist/pose", SENSOR)
    harness.collect(String, "robot_description", LATCHED)
    now_s, sent_s, publish = [5.0], [], BagPlayer._publish  # time goes on only in sleep
    clock = Mock(monotonic=lambda: sum(now_s), sleep=now_s.append)
    monkeypatch.setattr(bag_player, "time", clock)
    monkeypatch.setattr(BagPlayer, "_publish", lambda *a: (sent_s.append(sum(now_s)), publish(*a)))
    node = player(harness, bag)
    harness.spin_until(node.finished.is_set)
    log_s = np.array([m.log_time_ns for m in BagReader(bag).raw_messages()]) * 1e-9
    np.testing.assert_allclose(np.array(sent_s) - sent_s[0], log_s - log_s[0], atol=1e-6)


def test_begins_where_asked_and_plays_the_topics_asked_for(harness, bag):
    seen = harness.collect(PoseStamped, "mocap/wrist/pose", EVERY)
    node = player(harness, bag, rate=0.0, start_offset=0.2, topics=["/mocap/wrist/pose"])
    harness.spin_until(node.finished.is_set)
    assert node._diagnostics.report().message == "played"
    harness.spin_until(lambda: len(seen) == node.published)
    assert node.published == 10
    assert node.position_s == pytest.approx(node.duration_s)
    assert [p.topic_name for p in node.publishers if "robot" in p.topic_name] == []


@pytest.mark.slow
def test_paused_it_sends_nothing_and_resumed_it_goes_on_where_it_stopped(harness, bag):
    def pause():
        return harness.trigger("bag_player/pause").message

    seen = harness.collect(PoseStamped, "mocap/wrist/pose", EVERY)
    node = player(harness, bag, start_paused=True, wait_for_subscribers=0.0, rate=0.05)
    harness.spin_until(lambda: node._outputs["/mocap/wrist/pose"].get_subscription_count())
    assert not node._running.is_set() and pause() == "paused after 0 messages" and not seen
    assert harness.trigger("bag_player/resume").success
    harness.spin_until(lambda: len(seen) >= 3)
    held = pause()
    node.set_parameters([Parameter("rate", value=10.0)])
    assert {pause() for _ in range(60)} == {held} and node.published < 31
    assert harness.trigger("bag_player/resume").success
    harness.spin_until(lambda: node.done and len(seen) == 30)
    assert [m.header.stamp.nanosec for m in seen] == [i * STEP_NS for i in range(30)]


@pytest.mark.slow
def test_loop_begins_again(harness, bag):
    seen = harness.collect(PoseStamped, "mocap/wrist/pose", EVERY)
    node = player(harness, bag, loop=True, rate=20.0)
    harness.spin_until(lambda: len(seen) > 60)
    assert not node.done


def test_a_loop_of_nothing_ends(harness, bag):
    node = player(harness, bag, loop=True, start_offset=10.0, wait_for_subscribers=0.0)
    harness.spin_until(node.finished.is_set, what="the end")


@pytest.mark.slow
def test_clock_follows_the_recording(harness, bag):
    ticks = harness.collect(Clock, "/clock", SENSOR)
    harness.collect(PoseStamped, "mocap/wrist/pose", SENSOR)
    node = player(harness, bag, clock=True)
    harness.spin_until(lambda: node.done and len(ticks) > 5)
    times = [t.clock.sec * 10**9 + t.clock.nanosec for t in ticks]
    assert times == sorted(times)
    assert times[0] >= START_NS and times[-1] <= START_NS + 30 * STEP_NS


@pytest.mark.slow
def test_restamp_moves_stamps_to_the_present(harness, bag):
    seen = harness.collect(PoseStamped, "mocap/wrist/pose", EVERY)
    begun_ns = time.time_ns()
    node = player(harness, bag, restamp=True, rate=2.0)
    harness.spin_until(lambda: node.done and len(seen) == 30)
    stamps = np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in seen])
    assert stamps[0] >= begun_ns
    np.testing.assert_allclose(np.diff(stamps), STEP_NS / 2, atol=2)


@pytest.mark.parametrize("apart_ns", [0, 3_600_000_000_000])
@pytest.mark.parametrize("kind", [PoseStamped, MarkerArray])
def test_restamp_moves_stamps_of_elements_and_of_another_clock(kind, apart_ns):
    now_ns, name = 10**18, f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
    anchor = bag_player._Anchor(START_NS, 0.0, now_ns)
    arrays = {"/a": (kind, "markers")} if kind is MarkerArray else {}
    node = Mock(_values={"rate": 1.0}, _apart_ns={}, _stamped={"/a"} - {*arrays}, _arrays=arrays)
    for step in range(3):
        header = {"stamp": START_NS + step * STEP_NS - apart_ns}
        fields = {"markers": [{"header": header}, {}]} if arrays else {"header": header}
        at_ns = START_NS + step * STEP_NS
        message = RawMessage("/a", name, at_ns, at_ns, serialize(name, fields))
        found = deserialize_message(BagPlayer._restamped(node, message, anchor), kind)
        moved, *others = found.markers if arrays else [found]
        assert stamp_ns(moved) == now_ns + step * STEP_NS
        assert not any(map(stamp_ns, others))


def test_qos_comes_from_the_bag_else_from_the_topic():
    recorded = rosbag2_profile("best_effort", "volatile", 5)
    best_effort = recorded_profile(TopicInfo("/joint_states", POSE, 1, "", (recorded,)))
    assert best_effort.reliability == QoSReliabilityPolicy.BEST_EFFORT
    old = {"reliability": 1, "durability": 1, "depth": 1}
    latched = recorded_profile(TopicInfo("/anything", POSE, 1, "", (old,)))
    assert latched.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    assert recorded_profile(TopicInfo("/mocap/a/pose", POSE)).reliability == best_effort.reliability
    by_name = recorded_profile(TopicInfo("/robot_description", POSE))
    assert by_name.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL


@pytest.mark.parametrize("damaged", [b"", b"\0\1\0\0\5", b"\0\1\0\0\xff\xff\xff\x7f\0\0\0\0\0"])
def test_what_has_no_stamp_that_can_be_moved_is_counted_and_the_rest_is_played(
    harness, tmp_path, damaged
):
    bag = write(tmp_path / "bag", ("reliable", "volatile", 10), damaged={3: damaged})
    seen = harness.collect(PoseStamped, "mocap/wrist/pose", EVERY)
    node = player(harness, bag, restamp=True, rate=0.0)
    harness.spin_until(lambda: node.done and len(seen) == 29)
    assert node._diagnostics.rejected("malformed") == 1
    assert node.exit_code == 0


def test_a_topic_whose_name_ros_2_does_not_take_is_counted_and_the_rest_is_played(
    harness, tmp_path
):
    with BagWriter(tmp_path / "bag") as writer:
        for topic in ("vrpn/1/note", "vrpn/note"):  # ROS 1 has both
            writer.write_message(topic, "std_msgs/msg/String", {"data": "seen"}, START_NS)
    node = player(harness, tmp_path / "bag", rate=0.0, wait_for_subscribers=0.0)
    harness.spin_until(lambda: node.done)
    assert (node.published, node._diagnostics.rejected("unwritable")) == (1, 1)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("error", [BagError("the disk is gone"), OSError("the disk is gone")])
def test_it_ends_whatever_fails(harness, bag, monkeypatch, error):
    monkeypatch.setattr(BagPlayer, "_publish", Mock(side_effect=error))
    node = player(harness, bag, rate=0.0, wait_for_subscribers=0.0)
    harness.spin_until(lambda: node.done)
    report = node._diagnostics.report()
    assert node.finished.is_set() and node.exit_code == 1
    assert report.level == bytes([Level.ERROR]) and report.message == "the disk is gone"


@pytest.mark.parametrize("order", ["<", ">"])
def test_shifting_a_stamp_changes_nothing_else(order):
    data = bytearray(serialize(POSE, pose_fields(1)))
    if order == ">":
        data[1] = 0
        data[4:8], data[8:12] = data[7:3:-1], data[11:7:-1]
    moved = shift_stamp(bytes(data), lambda ns: ns + 5)
    assert shift_stamp(moved, lambda ns: ns - 5) == bytes(data)
    assert moved[12:] == data[12:] and moved[:8] == data[:8]
    with pytest.raises(BagError, match="expected a stamp between 1901 and 2038"):
        shift_stamp(bytes(data), lambda ns: 2**63)


@pytest.mark.parametrize("name", ["a.mcap", "bag/a.db3", "a.bag"])
def test_a_big_recording_of_any_storage_is_not_taken_into_memory(name, tmp_path):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        file.truncate(2**26 + 1)
    reader = Mock(path=path if name.count("/") == 0 else path.parent)
    assert BagPlayer._load(Mock(_reader=reader)) == ()
    reader.raw_messages.assert_not_called()
