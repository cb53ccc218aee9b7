# SPDX-License-Identifier: Apache-2.0
"""What reading, learning and evaluating cost."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from benchmarks.measure import Result, seconds_of_both
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.training import TrainingSettings, learn
from intent_recognition.report.evaluation import evaluate
from intent_recognition.storage import (
    BagReader,
    BagWriter,
    Demonstration,
    load_dofs,
    read_demonstrations,
)
from intent_recognition.storage.model import Model, save_model

TOPICS = {"PoseStamped": "/mocap/wrist/pose", "JointState": "/joint_states"}
LONG_MESSAGES = 20_000


def training(folder: Path) -> tuple[list[Result], TaskLibrary, list[Demonstration]]:
    """From bags to a model file, in its parts; also what came of it."""
    dofs = load_dofs()
    marks = [time.perf_counter()]
    demonstrations, _ = read_demonstrations(folder, dofs)
    marks.append(time.perf_counter())
    library, _ = learn(demonstrations, TrainingSettings())
    marks.append(time.perf_counter())
    with tempfile.TemporaryDirectory() as temporary:
        save_model(Path(temporary) / "model.npz", Model(library, dofs))
    marks.append(time.perf_counter())
    read_s, learn_s, save_s = (b - a for a, b in pairwise(marks))
    parts = f"{read_s:.2f} s reading, {learn_s:.2f} s learning, {save_s:.2f} s writing"
    n = len(demonstrations)
    name = f"{n} demonstrations, bags to model"
    result = Result(name, marks[-1] - marks[0], 10.0, "at most", "s", parts)
    return [result], library, demonstrations


def decoding(recording: Path) -> Iterator[Result]:
    """Messages decoded a second, beside rosbags on the same long bag in the same run."""
    with tempfile.TemporaryDirectory() as temporary:
        long_bag = Path(temporary) / "long"
        _prolong(recording, long_bag)
        for kind, topic in TOPICS.items():
            ours_s, theirs_s = seconds_of_both(
                partial(_decode_ours, long_bag, topic), partial(_decode_rosbags, long_bag, topic), 3
            )
            rates = [LONG_MESSAGES / time_s / 1e3 for time_s in (ours_s, theirs_s)]
            yield Result(
                f"decoding {kind}, rosbags takes",
                theirs_s / ours_s,
                1.0,
                "at least",
                "x",
                f"{rates[0]:.0f} and {rates[1]:.0f} thousand messages a second, reading included",
            )


def _prolong(recording: Path, output: Path) -> None:
    """A bag of `LONG_MESSAGES` messages on each topic: the recording's, again and again."""
    by_topic = {topic: [] for topic in TOPICS.values()}
    for message in BagReader(recording).raw_messages(by_topic):
        by_topic[message.topic].append(message)
    with BagWriter(output, {}) as writer:
        for k in range(LONG_MESSAGES):
            for topic, messages in by_topic.items():
                message, now_ns = messages[k % len(messages)], k * 10_000_000
                writer.write(topic, message.type, message.data, now_ns, now_ns)


def _decode_ours(bag: Path, topic: str) -> int:
    return sum(1 for _ in BagReader(bag).messages([topic.lstrip("/")]))


def _decode_rosbags(bag: Path, topic: str) -> int:
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        return sum(
            1
            for connection, _, data in reader.messages(connections=wanted)
            if reader.deserialize(data, connection.msgtype)
        )


def evaluation(demonstrations: Sequence[Demonstration]) -> Result:
    """One fold of leave-one-out: learn from the rest, score the one."""
    rest = list(range(1, len(demonstrations)))
    start = time.perf_counter()
    evaluate(demonstrations, [(rest, [0])], TrainingSettings(segmentation="recording"))
    return Result(
        f"one fold of {len(demonstrations)}, learned and scored",
        time.perf_counter() - start,
        10.0,
        "at most",
        "s",
    )
