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
    Demonstration,
    load_dofs,
    read_demonstrations,
)
from intent_recognition.storage.model import Model, save_model

TOPICS = {"PoseStamped": "/mocap/wrist/pose", "JointState": "/joint_states"}
DECODED_BAGS = 12


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


def decoding(folder: Path) -> Iterator[Result]:
    """Messages decoded a second, beside rosbags on the same bags in the same run."""
    bags = sorted(path.parent for path in folder.glob("*/metadata.yaml"))[:DECODED_BAGS]
    for kind, topic in TOPICS.items():
        counts: list[int] = []
        mine = partial(_decode_ours, bags, topic, counts)
        ours_s, theirs_s = seconds_of_both(mine, partial(_decode_rosbags, bags, topic), 3)
        yield Result(
            f"decoding {kind}, rosbags takes",
            theirs_s / ours_s,
            1.0,
            "at least",
            "x",
            f"{counts[0] / ours_s / 1e3:.0f} and {counts[0] / theirs_s / 1e3:.0f}"
            " thousand messages a second, files opened included",
        )


def _decode_ours(bags: Sequence[Path], topic: str, counts: list[int]) -> None:
    counts.append(sum(1 for bag in bags for _ in BagReader(bag).messages([topic.lstrip("/")])))


def _decode_rosbags(bags: Sequence[Path], topic: str) -> int:
    store, count = get_typestore(Stores.ROS2_JAZZY), 0
    for bag in bags:
        with AnyReader([bag], default_typestore=store) as reader:
            wanted = [c for c in reader.connections if c.topic == topic]
            for connection, _, data in reader.messages(connections=wanted):
                reader.deserialize(data, connection.msgtype)
                count += 1
    return count


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
