# SPDX-License-Identifier: Apache-2.0
"""Bags of SQLite and ROS 1, folders of files, and definitions of each release are read whole."""

import contextlib
import re
import shutil
import sqlite3

import pytest
import zstandard
from bag_builder import (
    COUNT,
    JOINTS,
    NOETIC,
    POSE,
    START_NS,
    STEP_NS,
    STORE,
    TOPICS,
    check_bag,
    contents,
    pose,
    raw,
    write_mcap,
    write_ros1,
    write_session,
)
from mcap.records import Schema
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from intent_recognition.bags import BagReader, recover
from intent_recognition.bags.definitions import definition, serialize
from intent_recognition.bags.messages import complete_schema, schema_decoder
from intent_recognition.cli.main import main
from intent_recognition.demonstrations import find_bags
from intent_recognition.errors import BagError


def write_db3(path, mode=CompressionMode.NONE):
    writer = Ros2Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        writer.set_custom_data("task", "plate")
        connections = {
            topic: writer.add_connection(topic, kind, typestore=STORE)
            for topic, (kind, _) in TOPICS.items()
        }
        for topic, at_ns, data in contents():
            writer.write(connections[topic], at_ns, data)


def test_a_bag_of_ros1(tmp_path):
    write_ros1(tmp_path / "plate_01.bag")
    check_bag(tmp_path / "plate_01.bag", contents())


def test_transforms_of_ros1_s_first_package_are_those_of_ros2(tmp_path):
    text, _ = STORE.generate_msgdef("tf2_msgs/msg/TFMessage", ros_version=1)
    with Ros1Writer(tmp_path / "a.bag") as writer:
        tf = writer.add_connection("/tf", "tf/msg/tfMessage", msgdef=text, md5sum="a" * 32)
        writer.write(tf, START_NS, bytes(4))
    (found,) = BagReader(tmp_path / "a.bag").messages()
    assert found.type == "tf2_msgs/msg/TFMessage" and len(found.message.transforms) == 0


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_of_a_bag_of_ros1_that_was_not_closed_all_whole_messages_are_saved(compression, tmp_path):
    write_ros1(tmp_path / "a.bag", compression)
    data, counts = (tmp_path / "a.bag").read_bytes(), []
    for size in range(5000, len(data), 500):
        (tmp_path / "cut.bag").write_bytes(data[:size])
        try:
            report = recover(tmp_path / "cut.bag", tmp_path / f"{size}")
        except BagError:
            assert not counts  # not one message is whole
            continue
        assert (
            raw(tmp_path / f"{size}", BagReader)
            == raw(tmp_path / "a.bag", BagReader)[: report.message_count]
        )
        assert report.notes == ("the recording was not closed; its end may be missing",)
        counts.append(report.message_count)
    assert counts == sorted(counts) and counts[-1] == 2 * COUNT and len(set(counts)) > 3


@pytest.mark.parametrize("compression", Ros1Writer.CompressionFormat)
def test_of_a_damaged_bag_of_ros1_all_other_chunks_are_saved(compression, tmp_path):
    write_ros1(tmp_path / "a.bag", compression)
    data, whole = (tmp_path / "a.bag").read_bytes(), raw(tmp_path / "a.bag", BagReader)
    middle = [m.start() for m in re.finditer(b"compression=", data)][3]
    for k, (start, length) in enumerate([(middle + 200, 1), (middle - 400, 300)]):
        changed = bytes(255 - byte for byte in data[start : start + length])
        (tmp_path / "b.bag").write_bytes(data[:start] + changed + data[start + length :])
        report = recover(tmp_path / "b.bag", tmp_path / f"saved{k}")
        saved = raw(tmp_path / f"saved{k}", BagReader)
        assert {*saved} < {*whole} and saved[-1] == whole[-1] and len(report.damage) == 1
        assert len(saved) > len(whole) - 14  # messages of two chunks
        try:
            found = raw(tmp_path / "b.bag", BagReader)
        except BagError:
            continue
        assert found == saved and not BagReader(tmp_path / "b.bag").is_finished


def test_messages_of_ros1_in_mcap(tmp_path):
    write_ros1(tmp_path / "a.bag")
    about = {}
    for topic, (kind, _) in TOPICS.items():
        text, _ = NOETIC.generate_msgdef(kind)
        about[topic] = (kind.replace("/msg/", "/"), "ros1msg", text)
    messages = contents()
    ros1 = [(t, ns, bytes(STORE.cdr_to_ros1(d, TOPICS[t][0]))) for t, ns, d in messages]
    write_mcap(tmp_path / "a.mcap", ros1, about, encoding="ros1", profile="ros1")
    check_bag(tmp_path / "a.mcap", messages)


MODES = CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE


@pytest.mark.parametrize("mode", MODES)
def test_a_bag_in_sqlite(mode, tmp_path):
    write_db3(tmp_path / "bag", mode)
    check_bag(tmp_path / "bag", contents())
    assert BagReader(tmp_path / "bag").custom_data == {"task": "plate"}
    if mode == CompressionMode.NONE:
        check_bag(tmp_path / "bag/bag.db3", contents())


def test_of_a_database_that_is_cut_off_the_messages_before_are_read(tmp_path):
    write_db3(tmp_path / "bag")
    whole, data = raw(tmp_path / "bag", BagReader), (tmp_path / "bag/bag.db3").read_bytes()
    counts = []
    for size in range(5000, len(data), 5000):
        (tmp_path / "cut.db3").write_bytes(data[:size])
        try:
            found = raw(tmp_path / "cut.db3", BagReader)
        except BagError:
            assert not counts  # not one message is whole
            continue
        assert found and not {*found} - {*whole}
        assert not BagReader(tmp_path / "cut.db3").is_finished
        counts.append(len(found))
    assert counts == sorted(counts) and counts[-1] > COUNT
    page = data.rindex(bytes(whole[len(whole) // 2][-1])) // 4096 * 4096
    (tmp_path / "cut.db3").write_bytes(data[:page] + bytes(4096) + data[page + 4096 :])
    found = raw(tmp_path / "cut.db3", BagReader)
    assert len(found) < len(whole) and {whole[0], whole[-1]} <= {*found} <= {*whole}
    assert recover(tmp_path / "cut.db3", tmp_path / "saved").damage[0].reason.endswith("malformed")
    long = pose(0, frame_id="w" * 20_000), pose(1, frame_id="w" * 70_000)  # over several pages
    with contextlib.closing(sqlite3.connect(tmp_path / "bag/bag.db3")) as file:
        rows = [(START_NS + k, serialize(POSE, one)) for k, one in enumerate(long)]
        file.executemany("INSERT INTO messages VALUES (NULL, 1, ?, ?)", rows)
        file.commit()
    data = (tmp_path / "bag/bag.db3").read_bytes()
    (tmp_path / "cut.db3").write_bytes(bytes(4096) + data[4096:])
    whole = raw(tmp_path / "bag", BagReader)
    assert raw(tmp_path / "cut.db3", BagReader) == whole
    report = recover(tmp_path / "cut.db3", tmp_path / "all")
    assert report.message_count == len(whole) and "not a database" in report.damage[0].reason


def test_a_database_with_a_log_and_an_unknown_definition_is_read_whole(tmp_path, monkeypatch):
    """A killed recorder leaves the log; a type whose package is not there has no definition."""
    write_db3(tmp_path / "bag")
    with contextlib.closing(sqlite3.connect(tmp_path / "bag/bag.db3")) as file:
        file.execute("PRAGMA journal_mode=WAL")
        late = START_NS + COUNT * STEP_NS
        file.execute("INSERT INTO messages SELECT NULL, topic_id, ?, data FROM messages", [late])
        file.execute("INSERT INTO message_definitions VALUES (NULL, 'a/msg/B', 'unknown', '', '')")
        file.commit()
        shutil.copytree(tmp_path / "bag", tmp_path / "50% #2")
    with (tmp_path / "50% #2/bag.db3").open("r+b") as killed:  # while it wrote the log back
        killed.seek(28)
        killed.write((1000).to_bytes(4, "big"))  # pages, most of them in the log alone
    reader = BagReader(tmp_path / "50% #2")
    times_ns = [m.log_time_ns for m in reader.raw_messages()]
    assert times_ns == [*(ns for _, ns, _ in contents()), *[late] * 2 * COUNT]
    assert reader.message_count == 4 * COUNT and not reader.is_finished
    assert reader.topics["/joint_states"].type_hash == definition(JOINTS).type_hash
    monkeypatch.setattr("os.access", lambda *_: False)  # where nothing can be written
    reader = BagReader(tmp_path / "50% #2")
    assert reader.message_count == 2 * COUNT and not reader.is_finished


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        ("UPDATE topics SET name = X'00'", "topic 1 without a name and a type"),
        ("UPDATE messages SET timestamp = 'x' WHERE id = 9", "invalid literal for int"),
        ("UPDATE messages SET timestamp = -5 WHERE id = 9", ""),
        ("UPDATE message_definitions SET encoded_message_definition = X'00'", ""),
        ("DROP TABLE topics", "not topics and messages"),
    ],
)
def test_what_a_damaged_database_holds_is_named(damage, says, tmp_path):
    write_db3(tmp_path / "bag")
    with contextlib.closing(sqlite3.connect(tmp_path / "bag/bag.db3")) as file:
        file.execute(damage)
        file.commit()
    if not says:
        assert len(list(BagReader(tmp_path / "bag").raw_messages())) >= 2 * COUNT - 1
        return
    with pytest.raises(BagError, match=says):
        list(BagReader(tmp_path / "bag").raw_messages())


def test_files_in_a_folder_are_recordings_unless_they_are_numbered_parts(tmp_path):
    for name in ("give_01.mcap", "give_02.mcap", "plate.mcap.zst"):
        path = write_mcap(tmp_path / name.removesuffix(".zst"), contents())
        if name.endswith(".zst"):
            path.with_name(name).write_bytes(zstandard.compress(path.read_bytes()))
            path.unlink()
    write_ros1(tmp_path / "a.bag")
    shutil.copy(tmp_path / "a.bag", tmp_path / "b.bag.active")  # as a killed recorder names it
    names = [path.name for path in find_bags(tmp_path)]
    bags = ["a.bag", "b.bag.active", "give_01.mcap", "give_02.mcap", "plate.mcap.zst"]
    assert names == bags
    with pytest.raises(BagError, match="a folder of 3 bags"):
        BagReader(tmp_path)
    folder, messages = tmp_path / "parts", contents()
    folder.mkdir()
    for k in range(12):  # the last is the rest
        part = messages[4 * k : 4 * k + 4] if k < 11 else messages[44:]
        write_mcap(folder / f"20.11_{k}.mcap", part)
    assert find_bags(folder) == [folder]
    assert [(m.topic, m.log_time_ns, m.data) for m in BagReader(folder).raw_messages()] == messages
    assert "its 12 files count as parts of one recording" in BagReader(folder).notes[0]


@pytest.mark.parametrize("release", [r for r in Stores if r != Stores.EMPTY])
def test_types_as_each_release_has_them(release):
    """A marker of Foxy has no texture, a range of Humble no variance, a camera of ROS 1 a D."""
    store, form = get_typestore(release), "ros1msg" if "ros1" in release.value else "ros2msg"
    for name in sorted(store.fielddefs.keys() & get_typestore(Stores.ROS2_JAZZY).fielddefs):
        if "/msg/" not in name:
            continue
        text, _ = store.generate_msgdef(name, ros_version=2 if form == "ros2msg" else 1)
        said = Schema(data=text.encode(), encoding=form, id=1, name=name)
        assert schema_decoder(complete_schema(said, name)) is not None


def test_definitions_that_only_the_decoder_parses():
    text = b"string<=10 s\nwstring<=5 w\nstring EMPTY=\nint32 n\n"
    assert schema_decoder(Schema(data=text, encoding="ros2msg", id=1, name="a/msg/B")) is not None


def test_the_commands_take_them(tmp_path, repository, capsys):
    for path in ("one.bag", "two.bag"):
        write_ros1(tmp_path / path)
    write_db3(tmp_path / "three")
    model, dofs = str(tmp_path / "m.npz"), str(repository / "config/dofs.yaml")
    bags = [str(tmp_path)]
    assert main(["inspect", str(tmp_path / "one.bag"), "--dofs", dofs]) == 0
    assert "50" in capsys.readouterr().out
    assert main(["train", *bags, "--dofs", dofs, "--output", model, "--unlabelled"]) == 0


def test_evaluate_says_the_same_of_every_storage(tmp_path, repository, monkeypatch):
    for name in ("mcap", "db3", "ros1"):
        (tmp_path / name).mkdir()
    write_session(tmp_path / "mcap/day", ["plate"] * 4)
    messages = [*BagReader(tmp_path / "mcap/day").raw_messages()]
    kinds = {one.topic: one.type for one in messages}
    ros2 = Ros2Writer(tmp_path / "db3/day", version=9, storage_plugin=StoragePlugin.SQLITE3)
    with ros2, Ros1Writer(tmp_path / "ros1/day.bag") as ros1:
        for writer, store in ((ros2, STORE), (ros1, NOETIC)):
            ids = {t: writer.add_connection(t, kind, typestore=store) for t, kind in kinds.items()}
            for one in messages:
                data = one.data if writer is ros2 else STORE.cdr_to_ros1(one.data, one.type)
                writer.write(ids[one.topic], one.log_time_ns, data)
    options = ["--dofs", str(repository / "config/dofs.yaml"), "--basis", "5"]
    options += ["--protocol", "kfold:2", "--unknown-tasks", "off", "--json", "scores.json"]
    found = {}
    for name in ("mcap", "db3", "ros1"):
        monkeypatch.chdir(tmp_path / name)
        bag = "day.bag" if name == "ros1" else "day"
        assert main(["evaluate", bag, *options]) == 0
        found[name] = (tmp_path / name / "scores.json").read_text().replace("day.bag", "day")
    assert '"plate"' in found["mcap"]
    assert found["db3"] == found["ros1"] == found["mcap"]
