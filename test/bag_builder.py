# SPDX-License-Identifier: Apache-2.0
"""Small bags for tests, built without ROS."""

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.bags.definitions import definition, serialize

POSE = "geometry_msgs/msg/PoseStamped"
JOINTS = "sensor_msgs/msg/JointState"
TEXT = "std_msgs/msg/String"
START_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000
LWR = [f"lwr_a{i}_joint" for i in range(1, 8)]


class SteppingClock:
    """Seconds that pass by a fixed amount with every look."""

    def __init__(self, step_s: float):
        self.now_s, self._step_s = 0.0, step_s

    def __call__(self) -> float:
        self.now_s += self._step_s
        return self.now_s


def pose(index: int, x: float | None = None, **changes) -> dict:
    """A wrist pose moving at 0.1 m/s."""
    stamp_ns = changes.get("stamp_ns", START_NS + index * STEP_NS)
    return {
        "header": {"stamp": stamp_ns, "frame_id": changes.get("frame_id", "world")},
        "pose": {
            "position": {"x": 0.001 * index if x is None else x, "y": 0.2, "z": 1.0},
            "orientation": {"w": 1.0},
        },
    }


def joints(index: int, **changes) -> dict:
    """Seven joints."""
    return {
        "header": {"stamp": changes.get("stamp_ns", START_NS + index * STEP_NS)},
        "name": changes.get("names", LWR),
        "position": changes.get("positions", [0.01 * index + j for j in range(7)]),
    }


def write_bag(path: Path, count: int = 50, task: str | None = "plate", **options) -> Path:
    """A demonstration of `count` poses and joint states."""
    with BagWriter(path, {} if task is None else {"task": task}, **options) as writer:
        for i in range(count):
            at_ns = START_NS + i * STEP_NS
            writer.write_message("mocap/wrist/pose", POSE, pose(i), at_ns)
            writer.write_message("joint_states", JOINTS, joints(i), at_ns + 1000)
    return path


def write_pairs(
    path: Path, poses, states=None, *, topic="mocap/wrist/pose", description="", **custom
) -> Path:
    """Poses, each with a state of the arm, those of `joints` or others; and its description."""
    with BagWriter(path, {"task": "plate", **custom}) as writer:
        if description:
            writer.write_message("robot_description", TEXT, {"data": description}, START_NS)
        for i, message in enumerate(poses):
            at_ns = START_NS + i * STEP_NS
            writer.write_message(topic, POSE, message, at_ns)
            state = joints(i) if states is None else states[i]
            writer.write_message("joint_states", JOINTS, state, at_ns)
    return path


def write_session(path: Path, labels: list[str], *, last_end: bool = True, **options) -> Path:
    """A session: each label lasts 20 steps, with 5 steps of pause between."""
    with BagWriter(path, **options) as writer:
        step = 0
        for number, label in enumerate(labels):
            marks = {5: label, 25: "" if last_end or number < len(labels) - 1 else None}
            for i in range(30):
                at_ns = START_NS + step * STEP_NS
                writer.write_message("mocap/wrist/pose", POSE, pose(step), at_ns)
                writer.write_message("joint_states", JOINTS, joints(step), at_ns)
                if marks.get(i) is not None:
                    writer.write_message("demonstration", TEXT, {"data": marks[i]}, at_ns)
                step += 1
    return path


def raw(path: Path, reader) -> list[tuple]:
    """All messages of a bag as comparable tuples."""
    return [
        (m.topic, m.type, m.log_time_ns, m.publish_time_ns, m.data)
        for m in reader(path).raw_messages()
    ]


COUNT = 25
"""Messages on each topic of the bags below."""
TOPICS = {"/mocap/wrist/pose": (POSE, pose), "/joint_states": (JOINTS, joints)}
STORE = get_typestore(Stores.ROS2_JAZZY)
NOETIC = get_typestore(Stores.ROS1_NOETIC)


def contents() -> list[tuple[str, int, bytes]]:
    """Topic, time and bytes of every message of a recording."""
    return [
        (topic, START_NS + i * STEP_NS, serialize(kind, make(i)))
        for i in range(COUNT)
        for topic, (kind, make) in TOPICS.items()
    ]


def write_ros1(path: Path, compression: Ros1Writer.CompressionFormat | None = None) -> None:
    """The same messages, as ROS 1 serializes them; compressed ones in chunks of some."""
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
        writer.chunk_threshold = 1000
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=NOETIC)
            for topic, (kind, _) in TOPICS.items()
        }
        for topic, at_ns, data in contents():
            ros1 = STORE.cdr_to_ros1(data, TOPICS[topic][0])
            writer.write(connections[topic], at_ns, ros1)


def messages_in(bag: Path) -> list[tuple[str, int, bytes]]:
    """Topic, time and bytes of every message; names of files and records on them may differ."""
    (path,) = bag.glob("*.mcap")
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages()
        return [(channel.topic, one.log_time, one.data) for _, channel, one in messages]


def write_mcap(path, messages, schemas=None, encoding="cdr", profile="ros2", **options):
    """An MCAP file by the mcap library; `schemas` are name, encoding and text by topic."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile=profile, library="test")
        channels = {}
        for topic, (kind, _) in TOPICS.items():
            form = (schemas or {}).get(topic, (kind, "ros2msg", definition(kind).text))
            number = form and writer.register_schema(form[0], form[1], form[2].encode())
            channels[topic] = writer.register_channel(topic, encoding, number or 0)
        for topic, at_ns, data in messages:
            writer.add_message(channels[topic], at_ns, data, at_ns)
        writer.add_attachment(1, 1, "note", "text/plain", b"\x05" * 100)
        writer.finish()
    return path


def check_bag(path, messages):
    """All messages are read: in order, decoded and as columns."""
    reader = BagReader(path)
    assert [(m.topic, m.log_time_ns, m.data) for m in reader.raw_messages()] == messages
    assert {t.name: t.message_count for t in reader.topics.values()} == dict.fromkeys(TOPICS, COUNT)
    assert (reader.damage, reader.is_finished) == ([], True)
    columns = reader.columns(TOPICS)["mocap/wrist/pose"]
    if columns is None:
        decoded = [m.message.pose.position.x for m in reader.messages(["/mocap/wrist/pose"])]
    else:
        decoded = columns.positions[:, 0]
    assert np.array_equal(decoded, [pose(i)["pose"]["position"]["x"] for i in range(COUNT)])
