# SPDX-License-Identifier: Apache-2.0
"""Columns hold bit for bit what rosbags deserializes message by message, or there are none."""

import dataclasses
import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import Mock

import numpy as np
import pytest
from bag_builder import JOINTS, LWR, POSE, START_NS, TEXT, joints, pose
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.bags.cdr.columns import JointColumns, PoseColumns
from intent_recognition.bags.definitions import Definition, definition, make_message, serialize
from intent_recognition.bags.mcap import file as mcap_file
from intent_recognition.bags.mcap.scan import scan_file
from intent_recognition.errors import BagError, MessageError

STORE = get_typestore(Stores.ROS2_JAZZY)
TEXTS = st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=6)
NAMES = st.lists(TEXTS, max_size=4)
BITS = st.integers(0, 2**64 - 1)  # of a double: NaN with any payload, infinities, denormals
TIMES = st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
TOPICS = {POSE: "mocap/wrist/pose", JOINTS: "joint_states"}


def doubles(bits) -> np.ndarray:
    return np.array(bits, np.uint64).view(np.float64)


def header(stamp, frame_id):
    return {"stamp": {"sec": stamp[0], "nanosec": stamp[1]}, "frame_id": frame_id}


@st.composite
def pose_bytes(draw, frames):
    bits = draw(st.lists(BITS, min_size=7, max_size=7))
    message = make_message(POSE, {"header": header(draw(TIMES), draw(frames))})
    data = bytearray(STORE.serialize_cdr(message, POSE))
    data[len(data) - 56 :] = doubles(bits).tobytes()  # NaN payloads as they are
    return bytes(data)


@st.composite
def joint_bytes(draw, frames, layouts):
    names, *sizes = draw(layouts)
    columns = [draw(st.lists(BITS, min_size=n, max_size=n)) for n in sizes]
    fields = dict(zip(("position", "velocity", "effort"), map(doubles, columns), strict=True))
    kind = STORE.types[JOINTS]
    head = make_message("std_msgs/msg/Header", header(draw(TIMES), draw(frames)))
    return bytes(STORE.serialize_cdr(kind(header=head, name=names, **fields), JOINTS))


LAYOUTS = st.tuples(NAMES, *[st.integers(0, 4)] * 3)


@st.composite
def recordings(draw, kind):
    """Messages of one topic with one or a few layouts, and their log times in any order."""
    frames = st.sampled_from(draw(st.lists(TEXTS, min_size=1, max_size=2)))
    if kind == POSE:
        message = pose_bytes(frames)
    else:
        layouts = st.sampled_from(draw(st.lists(LAYOUTS, min_size=1, max_size=3)))
        message = joint_bytes(frames, layouts)
    found = draw(st.lists(message, min_size=1, max_size=12))
    times = st.lists(st.integers(1, 20), min_size=len(found), max_size=len(found))
    return list(zip(draw(times), found, strict=True))


def record(path, kind, messages, **options):
    """A bag with another topic in between, as recorders make it."""
    with BagWriter(path, **options) as writer:
        for log_ns, data in messages:
            writer.write(TOPICS[kind], kind, data, log_ns)
            writer.write_message("demonstration", TEXT, {"data": "x\x05" * (log_ns % 3)}, log_ns)
    return path


def columns(path, kind):
    return BagReader(path).columns([TOPICS[kind]])[TOPICS[kind]]


def in_log_order(messages):
    return sorted(range(len(messages)), key=lambda i: messages[i][0])


def same_bits(ours, theirs) -> bool:
    theirs = np.asarray(theirs, np.float64)
    return ours.shape == theirs.shape and ours.tobytes() == theirs.tobytes()


def check_times(found, messages, decoded):
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in decoded]
    assert found.stamps_ns.tolist() == stamps
    assert found.log_times_ns.tolist() == sorted(log_ns for log_ns, _ in messages)


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(messages=recordings(POSE))
def test_poses_are_those_of_rosbags(messages):
    with TemporaryDirectory() as folder:
        found = columns(record(Path(folder) / "bag", POSE, messages), POSE)
    decoded = [STORE.deserialize_cdr(messages[i][1], POSE) for i in in_log_order(messages)]
    assert isinstance(found, PoseColumns)
    check_times(found, messages, decoded)
    assert [found.frame_ids[k] for k in found.frames] == [m.header.frame_id for m in decoded]
    for row, message in enumerate(decoded):
        p, q = message.pose.position, message.pose.orientation
        assert same_bits(found.positions[row], [p.x, p.y, p.z])
        assert same_bits(found.orientations[row], [q.x, q.y, q.z, q.w])


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(messages=recordings(JOINTS))
def test_joint_states_are_those_of_rosbags(messages):
    with TemporaryDirectory() as folder:
        found = columns(record(Path(folder) / "bag", JOINTS, messages), JOINTS)
    decoded = [STORE.deserialize_cdr(messages[i][1], JOINTS) for i in in_log_order(messages)]
    assert isinstance(found, JointColumns)
    check_times(found, messages, decoded)
    rows = np.concatenate([part.rows for part in found.parts])
    assert sorted(rows.tolist()) == list(range(len(messages)))
    for part in found.parts:
        for k, row in enumerate(part.rows):
            message = decoded[row]
            assert part.frame_id == message.header.frame_id
            assert list(part.names) == message.name
            for name in ("position", "velocity", "effort"):
                assert same_bits(getattr(part, name)[k], getattr(message, name))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    messages=recordings(JOINTS),
    at=st.integers(0, 11),
    damage=st.sampled_from(["cut", "tail", "count", "big endian", "utf-8"]),
)
def test_whatever_does_not_fit_is_left_to_the_general_decoder(messages, at, damage):
    at %= len(messages)
    log_ns, data = messages[at]
    if damage == "cut":
        data = data[:-1]
    elif damage == "tail":
        data += bytes(4)
    elif damage == "count":
        data = data[:12] + struct.pack("<I", 2**31) + data[16:]
    elif damage == "big endian":
        message = STORE.deserialize_cdr(data, JOINTS)
        data = bytes(STORE.serialize_cdr(message, JOINTS, little_endian=False))
    else:
        data = data[:12] + struct.pack("<I", 3) + b"\xff\xfe\x00" + data[-1:]
    messages[at] = (log_ns, data)
    with TemporaryDirectory() as folder:
        found = columns(record(Path(folder) / "bag", JOINTS, messages), JOINTS)
    assert found is None


def test_garbage_in_padding_changes_nothing(tmp_path):
    states = [bytearray(serialize(JOINTS, joints(i, names=["a", "bcd"]))) for i in range(6)]
    start = states[0].index(b"a\x00") + 2
    assert states[0][start : start + 2] == bytes(2)
    for i, data in enumerate(states):
        data[start : start + 2] = bytes([i, 255 - i])
    found = columns(record(tmp_path / "bag", JOINTS, list(enumerate(states, 1))), JOINTS)
    (part,) = found.parts
    assert part.names == ("a", "bcd") and part.position.shape == (6, 7)


def test_too_many_layouts_are_left_to_the_general_decoder(tmp_path):
    messages = [(i + 1, serialize(POSE, pose(i, frame_id=f"frame{i}"))) for i in range(40)]
    path = record(tmp_path / "bag", POSE, messages)
    assert columns(path, POSE) is None
    frames = [m.message.header.frame_id for m in BagReader(path).messages([TOPICS[POSE]])]
    assert frames == [f"frame{i}" for i in range(40)]


def test_other_types_definitions_and_topics_have_no_columns(tmp_path):
    mine = dataclasses.replace(
        definition(POSE), text="float64 x\n", encoding="ros2msg", type_hash=""
    )
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("mocap/wrist/pose", POSE, (), mine)
        writer.write("mocap/wrist/pose", POSE, b"\x00\x01\x00\x00" + bytes(8), 1)
        writer.write_message("demonstration", TEXT, {"data": "a"}, 2)
    found = BagReader(tmp_path / "bag").columns(["/mocap/wrist/pose", "demonstration", "nothing"])
    assert found == {"mocap/wrist/pose": None, "demonstration": None, "nothing": None}


def test_topics_without_a_message_have_empty_columns(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for kind, topic in TOPICS.items():
            writer.add_topic(topic, kind)
    assert columns(tmp_path / "bag", POSE).positions.shape == (0, 3)
    assert columns(tmp_path / "bag", JOINTS).parts == ()


def test_several_files_follow_one_another(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    for number, first in enumerate((30, 0)):  # the second file's log times are earlier
        messages = [(first + i + 1, serialize(POSE, pose(first + i))) for i in range(30)]
        part = record(tmp_path / f"part{number}", POSE, messages)
        (part / f"part{number}_0.mcap").rename(folder / f"bag_{number}.mcap")
    found = columns(folder, POSE)
    assert found.log_times_ns.tolist() == [*range(31, 61), *range(1, 31)]
    read = [m.log_time_ns for m in BagReader(folder).messages([TOPICS[POSE]])]
    assert found.log_times_ns.tolist() == read
    np.testing.assert_array_equal(found.positions[:, 0], 0.001 * np.r_[30:60, 0:30])


def test_definition_with_comments_is_the_same_type(tmp_path):
    text = "# A pose.\n\n" + definition(POSE).text.replace("\n", "  # note\n", 1)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("mocap/wrist/pose", POSE, (), Definition(POSE, text, ""))
        writer.write_message("mocap/wrist/pose", POSE, pose(3), 1)
    found = columns(tmp_path / "bag", POSE)
    np.testing.assert_array_equal(found.positions, [[0.003, 0.2, 1.0]])


@pytest.fixture
def chunks(tmp_path):
    """A bag of many small chunks whose messages overlap in time, and its messages."""
    rng = np.random.default_rng(2)
    path = tmp_path / "bag"
    with BagWriter(path, flush_period_s=None) as writer:
        for i in range(400):
            log_ns = START_NS + int(rng.integers(300))
            writer.write_message("mocap/wrist/pose", POSE, pose(i), log_ns)
            writer.write_message("joint_states", JOINTS, joints(i), log_ns)
            if i % 50 == 49:
                writer.flush()
    return path


def test_order_is_that_of_the_messages(chunks):
    assert len(scan_file(chunks / "bag_0.mcap").blocks) >= 8
    found = BagReader(chunks).columns(TOPICS.values())
    for topic, column in found.items():
        messages = list(BagReader(chunks).messages([topic]))
        assert column.log_times_ns.tolist() == [m.log_time_ns for m in messages]
        assert column.stamps_ns.tolist() == [m.stamp_ns for m in messages]
    (part,) = found["joint_states"].parts
    assert part.names == tuple(LWR)
    np.testing.assert_array_equal(part.position, [m.message.position for m in messages])


def test_damage_is_an_error_and_nothing_is_given_out(chunks):
    file = chunks / "bag_0.mcap"
    data = bytearray(file.read_bytes())
    block = scan_file(file).blocks[4]
    data[block.offset + block.length // 2] ^= 1
    file.write_bytes(data)
    with pytest.raises(BagError, match=r"bag_0\.mcap: topics .*byte"):
        BagReader(chunks).columns(["joint_states"])
    tolerant = BagReader(chunks, tolerant=True)
    kept = tolerant.columns(["joint_states"])["joint_states"]
    left = [m.log_time_ns for m in BagReader(chunks, tolerant=True).messages(["joint_states"])]
    assert kept.log_times_ns.tolist() == left and 0 < len(left) < 400
    assert len(tolerant.damage) == 1


def test_small_chunks_are_read_together(chunks, monkeypatch):
    read = Mock(wraps=mcap_file.read_messages)
    monkeypatch.setattr(mcap_file, "read_messages", read)
    assert columns(chunks, POSE).stamps_ns.size == 400 and read.call_count == 1


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=40), min_size=1, max_size=30), st.integers(1, 80))
@example([b"\x05" * 40, b"\x05" + struct.pack("<Q", 22) + bytes(31)] * 3, 1)
@example([b"\x05" + struct.pack("<Q", 22) + bytes(31)] * 80 + [b"x"], 1)
@example([bytes(22), b"\x05" * 100] * 70 + [bytes(21)] * 3, 2)
def test_payloads_that_look_like_records_do_not_mislead(payloads, repeats):
    payloads = payloads * repeats
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        with BagWriter(path) as writer:
            for i, data in enumerate(payloads):
                writer.write("text", TEXT, data, i + 1, sequence=i)
        found = [(m.log_time_ns, m.sequence, m.data) for m in BagReader(path).raw_messages()]
    assert found == [(i + 1, i, data) for i, data in enumerate(payloads)]


@pytest.mark.parametrize("data", [b"\x00\x01\x00\x00" + bytes(10), b""])
def test_bytes_that_do_not_fit_their_type_are_named_when_read_one_by_one(data, tmp_path):
    path = record(tmp_path / "bag", POSE, [(1, data)])
    assert columns(path, POSE) is None
    with pytest.raises(MessageError, match=r"mocap/wrist/pose at 1 ns"):
        list(BagReader(path).messages([TOPICS[POSE]]))
