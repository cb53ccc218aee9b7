# SPDX-License-Identifier: Apache-2.0
"""Truncated and bit-flipped files: the reader names the damage, recovery saves the rest."""

import shutil

import numpy as np
import pytest
import yaml
from bag_builder import SteppingClock, contents, raw, write_bag, write_mcap
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from intent_recognition.bags import BagReader, recover
from intent_recognition.bags.definitions import serialize
from intent_recognition.bags.mcap.chunk import read_messages
from intent_recognition.bags.mcap.scan import scan_file
from intent_recognition.errors import BagError, ResourceBusyError

COUNT = 120
TEXT = "std_msgs/msg/String"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A bag of many chunks and all its messages."""
    folder = tmp_path_factory.mktemp("whole")
    path = write_bag(folder / "bag", COUNT, clock=SteppingClock(0.02))
    return path, raw(path, BagReader)


@pytest.fixture
def damaged(whole, tmp_path):
    """Function that writes the bag with other bytes; returns its path."""

    def change(data: bytes):
        folder = tmp_path / "damaged"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(whole[0], folder)
        (folder / "bag_0.mcap").write_bytes(data)
        return folder

    return change


def content(whole) -> bytes:
    return (whole[0] / "bag_0.mcap").read_bytes()


def read_until_error(path) -> tuple[list, BagError | None]:
    found = []
    try:
        for m in BagReader(path).raw_messages():
            found.append((m.topic, m.type, m.log_time_ns, m.publish_time_ns, m.data))
    except BagError as error:
        return found, error
    return found, None


def check_columns(path, whole):
    """Columns of a damaged bag are those of the whole one, up to the damage, if there are any."""
    try:
        found = BagReader(path).columns(["mocap/wrist/pose"])["mocap/wrist/pose"]
    except BagError:
        return
    if found is not None:  # else a definition is damaged
        kept = BagReader(whole).columns(["mocap/wrist/pose"])["mocap/wrist/pose"]
        for name in ("log_times_ns", "stamps_ns", "positions", "orientations"):
            ours = getattr(found, name)
            np.testing.assert_array_equal(ours, getattr(kept, name)[: len(ours)])
        assert len(ours) == COUNT or not BagReader(path).is_finished


def recovered(path, tmp_path) -> list:
    shutil.rmtree(tmp_path / "saved", ignore_errors=True)
    recover(path, tmp_path / "saved")
    return raw(tmp_path / "saved", BagReader)


@pytest.mark.slow
def test_truncation_anywhere_is_an_error_and_the_whole_chunks_are_saved(whole, damaged, tmp_path):
    data, messages = content(whole), whole[1]
    scan = scan_file(whole[0] / "bag_0.mcap")
    ends = [(b.offset + 9 + b.length, b.end_ns) for b in scan.blocks]
    for size in range(60, len(data), 509):
        path = damaged(data[:size])
        check_columns(path, whole[0])
        found, error = read_until_error(path)
        assert found == messages[: len(found)]
        if error is None:  # cut between two records: what was written is whole
            assert not BagReader(path).is_finished
        else:
            assert "bag_0.mcap" in str(error) and "time" in str(error)
        complete_ns = max((end_ns for end, end_ns in ends if end <= size), default=0)
        expected = [m for m in messages if m[2] <= complete_ns]
        if not expected:
            continue
        saved = recovered(path, tmp_path)
        assert saved[: len(expected)] == expected
        assert saved == messages[: len(saved)]


@pytest.mark.slow
def test_flipped_bits_are_never_read_silently(whole, damaged, tmp_path):
    data, messages = content(whole), whole[1]
    chunks = len(scan_file(whole[0] / "bag_0.mcap").blocks)
    rng = np.random.default_rng(1)
    for _ in range(60):
        flipped = bytearray(data)
        flipped[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        path = damaged(bytes(flipped))
        check_columns(path, whole[0])
        found, error = read_until_error(path)
        assert found == messages or error is not None
        assert found == messages[: len(found)]
        saved = recovered(path, tmp_path)
        assert set(saved) <= set(messages)
        assert len(saved) >= len(messages) * (1 - 2.5 / chunks)


def test_several_damaged_places(whole, damaged, tmp_path):
    data = bytearray(content(whole))
    blocks = scan_file(whole[0] / "bag_0.mcap").blocks
    for block in (blocks[2], blocks[5]):
        data[block.offset : block.offset + 40] = bytes(40)
    path = damaged(bytes(data))
    report = recover(path, tmp_path / "saved")
    lost = {m for m in whole[1] for b in (blocks[2], blocks[5]) if b.start_ns <= m[2] <= b.end_ns}
    assert set(whole[1]) - set(raw(tmp_path / "saved", BagReader)) == lost
    assert len(report.damage) == 2
    assert report.message_count == len(whole[1]) - len(lost)
    assert BagReader(tmp_path / "saved").custom_data["task"] == "plate"
    assert (path / "bag_0.mcap").read_bytes() == bytes(data)


def test_messages_of_a_chunk_that_says_other_times_are_saved(whole, damaged, tmp_path):
    data = bytearray(content(whole))
    for block in scan_file(whole[0] / "bag_0.mcap").blocks[3:5]:
        data[block.offset + 9 : block.offset + 25] = bytes(16)
    path = damaged(bytes(data))
    with pytest.raises(BagError, match="times of the chunk and of its messages disagree"):
        list(BagReader(path).raw_messages())
    report = recover(path, tmp_path / "saved")
    assert raw(tmp_path / "saved", BagReader) == whole[1] and len(report.damage) == 2
    assert (report.start_ns, report.end_ns) == (whole[1][0][2], whole[1][-1][2])


@pytest.mark.parametrize("field", [0, 2, 10])  # opcode, length, channel
def test_messages_outside_of_chunks_are_saved_behind_damage(field, tmp_path):
    path = write_mcap(tmp_path / "a.mcap", contents(), use_chunking=False)
    messages, data = raw(path, BagReader), bytearray(path.read_bytes())
    for block in (blocks := scan_file(path).blocks)[3:9:5]:
        data[block.offset + field] += 1
    path.write_bytes(data)
    assert len(blocks) == len(messages)
    report = recover(path, tmp_path / "saved")
    kept = [m for k, m in enumerate(messages) if k not in (3, 8)]
    assert raw(tmp_path / "saved", BagReader) == kept
    assert [found.offset for found in report.damage] == [blocks[3].offset, blocks[8].offset]


def test_messages_inside_of_a_damaged_chunk_are_not_taken_for_others(tmp_path):
    options = {"chunk_size": 1000, "compression": CompressionType.NONE}
    path = write_mcap(tmp_path / "a.mcap", contents(), **options)
    messages, data = raw(path, BagReader), bytearray(path.read_bytes())
    block = scan_file(path).blocks[1]
    count = read_messages(bytes(data), block).starts.size
    data[block.offset] = 0x7F
    path.write_bytes(data)
    assert recover(path, tmp_path / "saved").message_count == len(messages) - count
    assert {*raw(tmp_path / "saved", BagReader)} < {*messages}


def test_the_only_chunk_cut_in_half_gives_its_first_part(tmp_path, shared_data):
    source = shared_data / "hri_yumi" / "demo_0000"
    messages = raw(source, BagReader)
    shutil.copytree(source, tmp_path / "demo")
    file = tmp_path / "demo" / "demo_0000.mcap"
    file.chmod(0o644)
    data = (source / "demo_0000.mcap").read_bytes()
    file.write_bytes(data[: len(data) // 2])
    with pytest.raises(BagError, match=r"demo_0000\.mcap: topics .*/joint_states.*time 17"):
        list(BagReader(tmp_path / "demo").messages())
    report = recover(tmp_path / "demo", tmp_path / "saved")
    assert report.message_count > len(messages) // 4
    assert raw(tmp_path / "saved", BagReader) == messages[: report.message_count]


def test_recovering_a_whole_bag_loses_nothing(whole, tmp_path):
    report = recover(whole[0], tmp_path / "saved")
    assert raw(tmp_path / "saved", BagReader) == whole[1]
    assert not report.damage and report.message_count == len(whole[1])


def test_nothing_to_save_and_nothing_overwritten(whole, tmp_path, damaged):
    for data in (b"", b"no mcap at all", bytes(1000)):
        with pytest.raises(BagError, match=r"damaged"):
            recover(damaged(data), tmp_path / "saved")
        assert not (tmp_path / "saved").exists()
    with pytest.raises(ResourceBusyError):
        recover(whole[0], whole[0])


def test_topics_of_no_known_type_are_left_out(tmp_path):
    for texts in ("", "xy"):
        source = tmp_path / f"{len(texts)}.mcap"
        with source.open("wb") as stream:
            writer = Writer(stream)
            writer.start("ros2")
            schema = writer.register_schema(TEXT, "ros2msg", b"string data")
            own = writer.register_channel("/own", "cdr", 0)
            channel = writer.register_channel("/text", "cdr", schema)
            writer.add_message(own, 1, b"{}", 1)
            for text in texts:
                writer.add_message(channel, 2, serialize(TEXT, {"data": text}), 2)
            writer.finish()
        if not texts:
            with pytest.raises(BagError, match=r"got none: left out /own: type: expected a"):
                recover(source, tmp_path / "saved")
            assert not (tmp_path / "saved").exists()
    report = recover(source, tmp_path / "saved")
    assert report.message_counts == {"/text": 2} and "left out /own" in report.notes[-1]
    assert [m.message.data for m in BagReader(tmp_path / "saved").messages()] == ["x", "y"]


def test_what_came_in_place_of_a_bag_is_told_in_words(whole, damaged):
    path = damaged(content(whole)[:4000])
    with pytest.raises(BagError, match=r"expected a whole recording, got a damaged one \(trunc"):
        list(BagReader(path).raw_messages())
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 9}")
    with pytest.raises(BagError, match="got none named 'relative_file_paths'"):
        BagReader(path)


def test_a_bag_whose_file_was_renamed_is_read(whole, damaged):
    path = damaged(content(whole))
    (path / "bag_0.mcap").rename(path / "monday.mcap")
    reader = BagReader(path)
    assert raw(path, BagReader) == whole[1] and reader.custom_data["task"] == "plate"
    assert reader.notes == ["renamed: bag_0.mcap"]
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(text.replace("_epoch: 17", "_epoch: 16"))
    with pytest.raises(BagError, match=r"got files that do not fit metadata\.yaml"):
        BagReader(path)
    (path / "metadata.yaml").write_text(text)
    (path / "more.mcap").write_bytes(content(whole))
    with pytest.raises(BagError, match=r"got no bag_0\.mcap"):
        BagReader(path)


def test_bag_without_metadata_reads_with_a_note(whole, damaged):
    path = damaged(content(whole))
    (path / "metadata.yaml").unlink()
    reader = BagReader(path)
    assert reader.custom_data == {"task": "plate"} and "metadata.yaml" in reader.notes[0]
    assert raw(path, BagReader) == whole[1]
    file = path / "bag_0.mcap"
    assert raw(file, BagReader) == whole[1] and BagReader(file).custom_data == {"task": "plate"}
    with file.open("rb") as stream:  # what `ros2 bag reindex` finds
        (record,) = make_reader(stream).iter_metadata()
    said = yaml.safe_load(record.metadata["serialized_metadata"])
    assert record.name == "rosbag2" and said["custom_data"] == {"task": "plate"}


@pytest.mark.parametrize("text", ["", "a: [", "rosbag2_bagfile_information: {}", "3"])
def test_broken_metadata_is_named_and_recovered(whole, damaged, tmp_path, text):
    path = damaged(content(whole))
    (path / "metadata.yaml").write_text(text)
    with pytest.raises(BagError, match=r"metadata\.yaml"):
        BagReader(path)
    assert recovered(path, tmp_path) == whole[1]
