# SPDX-License-Identifier: Apache-2.0
"""What writes MCAP is read whole, whatever its options, encodings and compression."""

import gzip
import itertools
import re
import struct

import numpy as np
import pytest
import yaml
import zstandard
from bag_builder import (
    COUNT,
    POSE,
    STEP_NS,
    TOPICS,
    check_bag,
    contents,
    pose,
    raw,
    write_bag,
    write_mcap,
)
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from intent_recognition.bags import BagReader, recover
from intent_recognition.bags.definitions import definition
from intent_recognition.cli.main import main
from intent_recognition.errors import BagError

SWITCHES = ("repeat_channels", "repeat_schemas", "use_chunking", "use_statistics",
            "use_summary_offsets", "enable_crcs", "enable_data_crcs")  # fmt: skip


IDL = """{line}
IDL: geometry_msgs/msg/PoseStamped
#include "geometry_msgs/msg/Pose.idl"
#include "std_msgs/msg/Header.idl"
module geometry_msgs {{ module msg {{ struct PoseStamped {{
  std_msgs::msg::Header header;
  geometry_msgs::msg::Pose pose;
}}; }}; }};
{line}
IDL: geometry_msgs/msg/Pose
module geometry_msgs {{ module msg {{ struct Pose {{
  geometry_msgs::msg::Point position;
  geometry_msgs::msg::Quaternion orientation;
}}; }}; }};
""".format(line="=" * 80)


@pytest.mark.slow
def test_every_combination_of_the_options_of_the_library(tmp_path):
    messages, compressions = contents(), itertools.cycle(CompressionType)
    for index, *flags in itertools.product(
        (IndexType.ALL, IndexType.NONE), *[(True, False)] * len(SWITCHES)
    ):
        options = dict(zip(SWITCHES, flags, strict=True))
        path = tmp_path / "a.mcap"
        options |= {"compression": next(compressions), "index_types": index}
        write_mcap(path, messages, chunk_size=1000, **options)
        check_bag(path, messages)


def test_channels_only_in_chunks_are_saved_and_a_damaged_summary_is_still_told(tmp_path):
    messages = contents()
    path = write_mcap(tmp_path / "a.mcap", messages, repeat_channels=False, repeat_schemas=False)
    recover(path, tmp_path / "saved")
    assert [m.data for m in BagReader(tmp_path / "saved").raw_messages()] == [
        data for _, _, data in messages
    ]
    data = bytearray(path.read_bytes())
    data[-40] ^= 1
    path.write_bytes(data)
    with pytest.raises(BagError, match="summary"):
        list(BagReader(path).raw_messages())


def test_a_summary_without_counts_is_one_that_does_not_say(tmp_path):
    """MCAP: an empty map of counts means that the writer has none."""
    data = write_mcap(tmp_path / "a.mcap", contents(), enable_crcs=False).read_bytes()
    counts = struct.pack("<IHQHQ", 2 * 10, 1, COUNT, 2, COUNT)
    at = data.rindex(counts)
    head = data.rindex(b"\x0b", 0, at)  # the record, and the offsets after it, become shorter
    record = b"\x0b" + struct.pack("<Q", at + 4 - head - 9) + data[head + 9 : at] + b"\0" * 4
    footer = data.rindex(b"\x02" + struct.pack("<Q", 20))
    start, _, _ = struct.unpack("<QQI", data[footer + 9 : footer + 29])
    end = b"\x02" + struct.pack("<QQQI", 20, start, 0, 0) + data[-8:]
    (tmp_path / "a.mcap").write_bytes(data[:head] + record + end)
    check_bag(tmp_path / "a.mcap", contents())


@pytest.mark.parametrize(
    ("encoding", "schema"),
    [
        ("json", None),
        ("json", (POSE, "jsonschema", b"{}")),
        ("protobuf", ("foxglove.Pose", "protobuf", bytes(range(256)))),
    ],
)
def test_messages_in_other_encodings_are_kept_and_never_decoded_as_ours(
    encoding, schema, tmp_path, capsys
):
    content, path = b'{"header": {"stamp": {"sec": 1}}}', tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "test")
        text = definition(POSE).text.encode()
        wrist = writer.register_channel("/w", "cdr", writer.register_schema(POSE, "ros2msg", text))
        number = writer.register_schema(*schema) if schema else 0
        other = writer.register_channel("/other", encoding, number)
        for topic, at_ns, data in contents():
            writer.add_message(wrist if "wrist" in topic else other, at_ns, data, at_ns)
            writer.add_message(other, at_ns, content, at_ns)
        writer.finish()
    recover(path, tmp_path / "saved")
    with (tmp_path / "saved/saved_0.mcap").open("rb") as stream:
        found = [*make_reader(stream).iter_messages("/other")]
    assert {channel.message_encoding for _, channel, _ in found} == {encoding}
    kept = {s and (s.name, s.encoding, bytes(s.data)) for s, _, _ in found}
    assert kept == {schema}
    assert [m.data for _, _, m in found].count(content) == 2 * COUNT
    for bag in (path, tmp_path / "saved"):
        with pytest.raises(BagError, match=f"got messages in {encoding}. Record it from ROS"):
            list(BagReader(bag).messages(["/other"]))
        assert len(list(BagReader(bag).messages(["/w"]))) == COUNT
        assert main(["inspect", str(bag)]) == 0
        assert f"{3 * COUNT} undecodable" in capsys.readouterr().out


def test_another_representation_of_dds_is_no_wrong_number(tmp_path):
    """XCDR2 aligns to four bytes: read as XCDR1, a message may give other numbers."""
    content = [(t, ns, b"\0\x07" + data[2:]) for t, ns, data in contents()]
    path = write_mcap(tmp_path / "a.mcap", content)
    assert set(BagReader(path).columns(TOPICS).values()) == {None}
    with pytest.raises(BagError, match="got encapsulation 0007, neither 0000 nor 0001"):
        list(BagReader(path).messages())


def test_parts_that_overlap_come_in_the_order_of_time(tmp_path):
    messages, folder = contents(), tmp_path / "bag"
    parts = messages[10:30:2] + messages[38:], messages[:10] + messages[11:30:2], messages[30:38]
    folder.mkdir()
    for k, part in enumerate(parts):
        write_mcap(folder / f"bag_{k}.mcap", part, chunk_size=500)
    for reader in (BagReader(folder), BagReader(folder, tolerant=True)):
        found = [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()]
        assert sorted(found) == sorted(messages)
        times_ns = [at_ns for _, at_ns, _ in found]
        assert times_ns == sorted(times_ns)
        columns = reader.columns(TOPICS)["mocap/wrist/pose"]
        assert np.array_equal(columns.stamps_ns, columns.log_times_ns)
        assert np.all(np.diff(columns.stamps_ns) == STEP_NS)


def test_damage_in_a_part_that_overlaps_comes_after_the_messages_before_it(tmp_path):
    messages, folder = contents(), tmp_path / "bag"
    folder.mkdir()
    write_mcap(folder / "bag_0.mcap", messages[:31])
    path = write_mcap(folder / "bag_1.mcap", messages[29:], compression=CompressionType.NONE)
    content = path.read_bytes()
    at = content.index(messages[29][2])
    path.write_bytes(content[: at - 30] + b"\xff" * 20 + content[at - 10 :])
    found = []
    with pytest.raises(BagError, match=r"bag_1\.mcap"):
        for message in BagReader(folder).raw_messages():
            found.append(message)
    assert [m.log_time_ns for m in found] == [at_ns for _, at_ns, _ in messages[:30]]


def wrist_schema(form):
    return {"/mocap/wrist/pose": form}


@pytest.mark.parametrize(
    "form", [None, (POSE, "", ""), (POSE, "ros2msg", ""), (POSE, "ros2idl", IDL)]
)
def test_known_types_without_a_definition_or_in_idl(form, tmp_path):
    messages = contents()
    folder = tmp_path / "bag"
    write_bag(folder)
    (folder / "bag_0.mcap").unlink()
    write_mcap(folder / "bag_0.mcap", messages, wrist_schema(form))
    check_bag(folder, messages)  # the type of a channel without a schema is that of metadata.yaml


FORMS = {
    "Windows": lambda name, text: (name, text.replace("\n", "\r\n")),
    "whole names": lambda name, text: (name, re.sub(r"(?m)^((MSG: )?\w+)/", r"\1/msg/", text)),
    "short lines": lambda name, text: (name, re.sub("=+\n", "===\n", text)),
    "short name": lambda name, text: (name.replace("/msg/", "/"), text),
}


@pytest.mark.parametrize("form", FORMS)
def test_definitions_as_other_writers_have_them(form, tmp_path):
    about = {}
    for topic, (kind, _) in TOPICS.items():
        name, text = FORMS[form](kind, definition(kind).text)
        assert (name, text) != (kind, definition(kind).text)
        about[topic] = (name, "ros2msg", text)
    path = write_mcap(tmp_path / "a.mcap", contents(), about)
    check_bag(path, contents())
    reader = BagReader(path)
    assert {t.name: t.type for t in reader.topics.values()} == {
        t: k for t, (k, _) in TOPICS.items()
    }
    decoded = [m.message.pose.position.x for m in reader.messages(["/mocap/wrist/pose"])]
    assert decoded == [pose(i)["pose"]["position"]["x"] for i in range(COUNT)]


def packed(folder, mode):
    """A bag as `ros2 bag record --compression-mode` leaves it."""
    messages = contents()
    write_bag(folder)
    content = [(t, ns, zstandard.compress(d) if mode == "message" else d) for t, ns, d in messages]
    write_mcap(folder / "bag_0.mcap", content, chunk_size=500)
    information = yaml.safe_load((folder / "metadata.yaml").read_text())
    about = information["rosbag2_bagfile_information"]
    about |= {"compression_mode": mode.upper(), "compression_format": "zstd"}
    if mode != "message":
        data = (folder / "bag_0.mcap").read_bytes()
        (folder / "bag_0.mcap").unlink()
        pack = gzip.compress if mode == "gz" else zstandard.compress
        (folder / f"bag_0.mcap.{mode}").write_bytes(pack(data))
        about["relative_file_paths"] = [f"bag_0.mcap.{mode}"]
    (folder / "metadata.yaml").write_text(yaml.safe_dump(information))
    return messages


@pytest.mark.parametrize("mode", ["zstd", "gz", "message"])
def test_what_was_compressed(mode, tmp_path):
    messages = packed(tmp_path / "bag", mode)
    check_bag(tmp_path / "bag", messages)
    (tmp_path / "bag/metadata.yaml").unlink()
    check_bag(tmp_path / "bag", messages)
    check_bag(next((tmp_path / "bag").iterdir()), messages)


def test_a_cut_file_of_zstd_gives_what_it_has(tmp_path):
    packed(tmp_path / "bag", "zstd")
    path = tmp_path / "bag/bag_0.mcap.zstd"
    data = zstandard.decompress(path.read_bytes())
    parts = [zstandard.compress(part) for part in (data[:1500], data[1500:])]
    path.write_bytes(parts[0] + parts[1][:-20])
    with pytest.raises(BagError, match="damaged"):
        list(BagReader(path).raw_messages())
    recover(path, tmp_path / "saved")
    path.write_bytes(parts[0][:-20])
    with pytest.raises(BagError, match=r"bag_0\.mcap\.zstd.*cut off"):
        BagReader(path)
    packed(tmp_path / "other", "gz")
    path = tmp_path / "other/bag_0.mcap.gz"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(BagError, match="damaged"):
        list(BagReader(path).raw_messages())


def test_a_storage_without_a_name_is_known_by_its_file(tmp_path):
    folder = write_bag(tmp_path / "bag")
    before = raw(folder, BagReader)
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(text.replace("storage_identifier: mcap",
                                                       "storage_identifier: ''"))  # fmt: skip
    assert raw(folder, BagReader) == before
