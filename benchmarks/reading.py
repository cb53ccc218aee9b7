# SPDX-License-Identifier: Apache-2.0
"""What reading recordings costs, from file to values, beside rosbags in the same run."""

import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from benchmarks.measure import Result, at_least, seconds_of_both
from intent_recognition.bags import FLUSH_PERIOD_S, BagReader, BagWriter, PoseColumns, RawMessage
from intent_recognition.demonstrations import find_bags, load_dofs, read_demonstrations
from intent_recognition.share import share_path

TOPICS = {"PoseStamped": "/mocap/wrist/pose", "JointState": "/joint_states"}
RECORDING = "bags/toolbox/test/plate_handover_00"
FOLDER = "bags/toolbox/train"
LONG_MESSAGES = 20_000
REPEATS, FEW_REPEATS = 7, 3


def reading() -> Iterator[Result]:
    """One long bag, one as recorded live, many short ones, and what training makes of these."""
    with tempfile.TemporaryDirectory() as temporary:
        for name, live in (("one long bag", False), ("a chunk every 0.5 s", True)):
            bag = Path(temporary) / f"live_{live}"
            _prolong(share_path(RECORDING), bag, live)
            for kind, topic in TOPICS.items():
                yield _decoding(f"{kind}, {name}", [bag], topic, REPEATS)
    bags = find_bags(share_path(FOLDER))
    for kind, topic in TOPICS.items():
        yield _decoding(f"{kind}, {len(bags)} short bags", bags, topic, FEW_REPEATS)
    yield _demonstrations(bags)


def _decoding(name: str, bags: Sequence[Path], topic: str, repeats: int) -> Result:
    ours, theirs = partial(_columns, bags, topic), partial(_exhaust, bags, [topic])
    count = _check_equal(ours(), _rosbags(bags, topic))
    ours_s, theirs_s = seconds_of_both(ours, theirs, repeats)
    rates = [count / time_s / 1e3 for time_s in (ours_s, theirs_s)]
    return at_least(
        f"decoding {name}, rosbags takes",
        theirs_s / ours_s,
        10.0,
        "x",
        f"{rates[0]:.0f} and {rates[1]:.0f} thousand messages a second, reading included",
    )


def _demonstrations(bags: Sequence[Path]) -> Result:
    """Rosbags only decodes both topics; we also check, ingest and build the signals."""

    ours = partial(read_demonstrations, bags, load_dofs())
    theirs = partial(_exhaust, bags, list(TOPICS.values()))
    ours_s, theirs_s = seconds_of_both(ours, theirs, FEW_REPEATS)
    return at_least(
        f"{len(bags)} bags to demonstrations, rosbags decodes in",
        theirs_s / ours_s,
        10.0,
        "x",
        f"{ours_s:.2f} and {theirs_s:.2f} s",
    )


def _prolong(recording: Path, output: Path, live: bool) -> None:
    """A bag of `LONG_MESSAGES` messages on each topic: the recording's, again and again.

    `live` writes chunks as the recorder does when messages come at 100 Hz, else they are large.
    """
    now_ns = 0
    by_topic: dict[str, list[RawMessage]] = {topic: [] for topic in TOPICS.values()}
    for message in BagReader(recording).raw_messages(by_topic):
        by_topic[message.topic].append(message)
    period_s = FLUSH_PERIOD_S if live else None
    with BagWriter(output, {}, flush_period_s=period_s, clock=lambda: now_ns * 1e-9) as writer:
        for k in range(LONG_MESSAGES):
            now_ns = k * 10_000_000
            for topic, messages in by_topic.items():
                message = messages[k % len(messages)]
                writer.write(topic, message.type, message.data, now_ns, now_ns)


def _columns(bags: Sequence[Path], topic: str) -> list[np.ndarray]:
    """Positions of every bag: of the body, or of the joints."""
    found = []
    for bag in bags:
        (columns,) = BagReader(bag).columns([topic]).values()
        if isinstance(columns, PoseColumns):
            found.append(columns.positions)
        elif columns is not None:
            found.append(columns.parts[0].position)
    return found


def _rosbags(bags: Sequence[Path], topic: str) -> Iterator[Any]:
    """Messages of every bag, one at a time."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for bag in bags:
        with AnyReader([bag], default_typestore=store) as reader:
            wanted = [c for c in reader.connections if c.topic == topic]
            for connection, _, data in reader.messages(connections=wanted):
                yield reader.deserialize(data, connection.msgtype)


def _exhaust(bags: Sequence[Path], topics: Sequence[str]) -> None:
    for topic in topics:
        for _ in _rosbags(bags, topic):
            pass


def _check_equal(ours: Sequence[np.ndarray], theirs: Iterator[Any]) -> int:
    """Number of messages; fails if the two read anything else."""
    rows = np.concatenate(ours)
    for row, message in zip(rows, theirs, strict=True):
        if hasattr(message, "pose"):
            point = message.pose.position
            expected = [point.x, point.y, point.z]
        else:
            expected = message.position
        np.testing.assert_array_equal(row, expected)
    return len(rows)
