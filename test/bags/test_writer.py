# SPDX-License-Identifier: Apache-2.0
"""What is written is what is read, by us and by independent readers; nothing is overwritten."""

import os
import shutil
import tempfile
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import yaml
from bag_builder import POSE, START_NS, STEP_NS, SteppingClock, pose, raw, write_bag
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from intent_recognition.bags import BagReader, BagWriter, DiskFullError, read_metadata
from intent_recognition.bags.definitions import (
    definition,
    jazzy_types,
    make_message,
    message_class,
    serialize,
)
from intent_recognition.errors import ArgumentError, BagError, MessageError, ResourceBusyError

TYPES = sorted(name for name in jazzy_types().fielddefs if "/msg/" in name)
COVARIANCE = "geometry_msgs/msg/PoseWithCovariance"
MESSAGES = st.lists(
    st.tuples(
        st.sampled_from(["/a", "b/c", "d"]),
        st.integers(0, 2**62),
        st.integers(0, 2**62),
        st.binary(max_size=60),
    ),
    max_size=30,
)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(messages=MESSAGES)
def test_any_bytes_and_stamps_come_back_in_order_of_log_time(messages):
    kinds = {"/a": POSE, "b/c": "std_msgs/msg/String", "d": "sensor_msgs/msg/PointCloud2"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "bag")
        with BagWriter(path, clock=SteppingClock(0.1)) as writer:
            for topic, log_ns, sent_ns, data in messages:
                writer.write(topic, kinds[topic], data, log_ns, sent_ns)
        expected = [("/" + t.lstrip("/"), kinds[t], log, sent, d) for t, log, sent, d in messages]
        assert raw(path, BagReader) == sorted(expected, key=lambda m: m[2])
        if messages:
            with Reader(path) as independent:
                found = [(c.topic, t, bytes(d)) for c, t, d in independent.messages()]
            assert sorted(found) == sorted((m[0], m[2], m[4]) for m in expected)


@pytest.mark.slow
def test_every_jazzy_type_is_defined_serialized_and_decoded(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for stamp_ns, kind in enumerate(TYPES):
            writer.write_message(kind, kind, {}, stamp_ns)
    with Reader(tmp_path / "bag") as independent:
        found = [(connection.msgtype, data) for connection, _, data in independent.messages()]
    assert [kind for kind, _ in found] == TYPES
    for kind, data in found:
        jazzy_types().deserialize_cdr(data, kind)
    assert [message.type for message in BagReader(tmp_path / "bag").messages()] == TYPES


def test_hashes_are_those_of_the_installed_packages():
    found = definition(POSE)
    assert found.type_hash == (
        "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"
    )


def test_type_of_an_installed_package_outside_jazzy(tmp_path, monkeypatch):
    share = tmp_path / "share" / "my_msgs" / "msg"
    share.mkdir(parents=True)
    (share / "Grip.msg").write_text("# how\nstd_msgs/Header header\nFinger[] fingers\n")
    (share / "Finger.msg").write_text("float64 force\nstring<=5 name\n")
    (share / "Grip.json").write_text(
        '{"type_hashes": [{"type_name": "my_msgs/msg/Grip", "hash_string": "RIHS01_x"}]}'
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path), prepend=":")
    with BagWriter(tmp_path / "bag") as writer:
        message = {"header": {"stamp": 7}, "fingers": [{"force": 2.5, "name": "thumb"}]}
        writer.write_message("grip", "my_msgs/msg/Grip", message, 5)
    reader = BagReader(tmp_path / "bag")
    (message,) = reader.messages()
    assert message.stamp_ns == 7
    assert message.message.fingers[0].force == 2.5
    assert reader.topics["/grip"].type_hash == "RIHS01_x"


def test_metadata_is_rosbag2s(tmp_path, shared_data):
    write_bag(tmp_path / "demo", 10, task="waving")
    ours = yaml.safe_load((tmp_path / "demo" / "metadata.yaml").read_text())
    theirs = yaml.safe_load((shared_data / "hri_yumi/demo_0000/metadata.yaml").read_text())
    ours, theirs = (m["rosbag2_bagfile_information"] for m in (ours, theirs))
    assert list(ours) == list(theirs)
    for key in ("version", "storage_identifier", "compression_format", "ros_distro"):
        assert ours[key] == theirs[key]
    topics = {t["topic_metadata"]["name"]: t for t in theirs["topics_with_message_count"]}
    for topic in ours["topics_with_message_count"]:
        assert topic["topic_metadata"] == topics[topic["topic_metadata"]["name"]]["topic_metadata"]
    assert ours["starting_time"]["nanoseconds_since_epoch"] == START_NS
    assert ours["duration"]["nanoseconds"] == 9 * STEP_NS + 1000
    assert ours["message_count"] == 20
    assert ours["files"][0]["path"] == "demo_0.mcap"
    assert ours["custom_data"] == {"task": "waving"}


def test_a_killed_writer_leaves_a_description_of_what_is_there(tmp_path):
    writer = BagWriter(tmp_path / "demo", {"task": "waving"}, clock=SteppingClock(0.1))
    for i in range(1000):
        writer.write_message("mocap/wrist/pose", POSE, {}, START_NS + i * STEP_NS)
    metadata = read_metadata(tmp_path / "demo")
    written = BagReader(tmp_path / "demo", tolerant=True).message_count
    assert 970 < metadata.message_count <= written < 1000
    assert metadata.start_ns == START_NS
    assert metadata.duration_ns == (metadata.message_count - 1) * STEP_NS
    writer.close()
    assert read_metadata(tmp_path / "demo").message_count == 1000


def test_file_is_a_ros2_profile_with_zstd_and_summary(tmp_path):
    write_bag(tmp_path / "demo", 10)
    with (tmp_path / "demo" / "demo_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == 20
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
        assert len(list(reader.iter_messages())) == 20


def test_equal_input_gives_equal_files(tmp_path):
    first = write_bag(tmp_path / "a" / "demo", 200, flush_period_s=None)
    second = write_bag(tmp_path / "b" / "demo", 200, flush_period_s=None)
    for name in ("demo_0.mcap", "metadata.yaml"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_existing_output_is_never_touched(tmp_path):
    write_bag(tmp_path / "demo", 5)
    before = (tmp_path / "demo" / "demo_0.mcap").read_bytes()
    with pytest.raises(ResourceBusyError, match="never overwritten"):
        BagWriter(tmp_path / "demo")
    assert (tmp_path / "demo" / "demo_0.mcap").read_bytes() == before


def test_closed_writer_and_changed_type_are_refused(tmp_path):
    writer = BagWriter(tmp_path / "demo")
    writer.write("a", POSE, b"1", 1)
    with pytest.raises(BagError, match="topic /a"):
        writer.write("a", "std_msgs/msg/String", b"1", 1)
    writer.close()
    writer.close()
    with pytest.raises(BagError, match="open bag"):
        writer.write("a", POSE, b"1", 1)


def test_stamps_of_an_array_are_written_and_others_are_refused(tmp_path):
    with BagWriter(tmp_path / "demo") as writer:
        for stamp_ns in np.arange(1, 4):
            writer.write("a", POSE, b"1", stamp_ns, stamp_ns)
        for bad in (-1, 1.5, 2**64, np.float64(3.0), "4"):
            with pytest.raises(ArgumentError, match="log_time_ns"):
                writer.write("a", POSE, b"1", bad)
            with pytest.raises(ArgumentError, match="publish_time_ns"):
                writer.write("a", POSE, b"1", 4, bad)
    stamps = [(m.log_time_ns, m.publish_time_ns) for m in BagReader(writer.path).raw_messages()]
    assert stamps == [(1, 1), (2, 2), (3, 3)]
    assert read_metadata(writer.path).message_count == 3


@pytest.mark.parametrize(
    ("kind", "fields", "named"),
    [
        (POSE, {"pose": {"position": {"q": 1.0}}}, r"pose\.position.*q"),
        (POSE, {"pose": {"position": {"x": "far"}}}, r"position\.x"),
        (POSE, {"pose": 3}, "pose"),
        (POSE, {"header": {"frame_id": 3}}, "frame_id"),
        (COVARIANCE, {"covariance": np.zeros(35)}, "covariance"),
        ("no_such/msg/T", {}, "no_such/msg/T"),
    ],
)
def test_wrong_message_is_named(kind, fields, named):
    with pytest.raises(MessageError, match=named):
        make_message(kind, fields)


def test_message_of_the_type_store_is_taken_too():
    header = message_class("std_msgs/msg/Header")
    time = message_class("builtin_interfaces/msg/Time")
    built = header(stamp=time(sec=3, nanosec=4), frame_id="w")
    by_name = {"stamp": 3_000_000_004, "frame_id": "w"}
    assert serialize("std_msgs/msg/Header", built) == serialize("std_msgs/msg/Header", by_name)


def test_disk_without_room_refuses_to_begin(tmp_path):
    with pytest.raises(DiskFullError, match="MiB free"):
        BagWriter(tmp_path / "bag", disk_usage=lambda _: SimpleNamespace(free=10))
    assert not (tmp_path / "bag").exists()


def test_disk_running_full_ends_in_a_whole_bag(tmp_path):
    free = [2**30]
    writer = BagWriter(
        tmp_path / "bag",
        {"task": "plate"},
        clock=SteppingClock(0.2),
        disk_usage=lambda _: SimpleNamespace(free=free[0]),
    )
    written = 0
    with pytest.raises(DiskFullError, match="messages received until now are saved"):
        for written in range(100):
            if written == 20:
                free[0] = 2**20
            writer.write_message("mocap/wrist/pose", POSE, pose(written), written)
    reader = BagReader(tmp_path / "bag")
    assert reader.is_finished and reader.custom_data["task"] == "plate"
    assert len(list(reader.messages())) == written + 1
    assert reader.metadata.message_count == written + 1


def test_a_write_that_fails_leaves_what_was_flushed(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / "bag", flush_period_s=None)
    for i in range(10):
        writer.write_message("p", POSE, pose(i), i)
    writer.flush()
    real_write = os.write

    def full(descriptor: int, data: bytes) -> int:
        if len(data) > 20:
            return real_write(descriptor, data[:20])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    for i in range(10, 15):
        writer.write_message("p", POSE, pose(i), i)
    with pytest.raises(DiskFullError, match=r"room on the disk.*the last 5 messages are lost"):
        writer.flush()
    monkeypatch.undo()
    writer.close()
    assert [m.log_time_ns for m in BagReader(tmp_path / "bag").messages()] == list(range(10))


@pytest.mark.parametrize("end", [BagWriter.flush, BagWriter.close])
def test_a_folder_that_is_deleted_is_said(tmp_path, end):
    writer = BagWriter(tmp_path / "bag", clock=SteppingClock(2.0))
    shutil.rmtree(tmp_path / "bag")
    with pytest.raises(DiskFullError, match=r"a writable directory, .*: No such file"):
        end(writer)
    writer.close()


def test_a_folder_that_nothing_can_be_written_into_is_said(tmp_path, monkeypatch):
    for name in ("open", "fsync"):
        monkeypatch.setattr(os, name, Mock(side_effect=PermissionError(13, "Permission denied")))
        with pytest.raises(DiskFullError, match=r"a writable directory, got .*ermission denied"):
            BagWriter(tmp_path / name)
        monkeypatch.undo()
    assert not (tmp_path / "open").exists()
