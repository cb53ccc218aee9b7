# SPDX-License-Identifier: Apache-2.0
"""Read task labels: of a whole bag, of the parts of a session, and as sequences of tasks.

A session bag holds several demonstrations, separated by markers on the topic `demonstration`. In a
recording of the running graph without markers, tasks are read from `intent/active_task`, the task
recognized and served. Both topics carry a label when a task begins, an empty text when it ends.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Integers
from intent_recognition.bags import BagMessage, BagReader
from intent_recognition.demonstrations.cleaning import TopicSamples
from intent_recognition.demonstrations.dofs import relative_topic
from intent_recognition.demonstrations.folders import check_label, find_bags, label_problem, no_bag
from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection

MARKER_TOPIC = "demonstration"
MARKER_TYPE = "std_msgs/msg/String"
ACTIVE_TOPIC = "intent/active_task"


@dataclass(frozen=True)
class SessionPart:
    """One demonstration of a session."""

    index: int  # number in the session, from 0
    task: str
    start_ns: int  # start on the clock of the messages' stamps
    end_ns: int


class TaskSequence(NamedTuple):
    """Tasks that followed one another without a long pause between them."""

    source: str
    tasks: tuple[str, ...]
    durations_s: tuple[float, ...] = ()  # time between each label and the empty text after it


def clock_shift_ns(differences: Integers) -> int:
    """Median of log time minus stamp (n,) if they are from different clocks; 0 if from one."""
    shift_ns = int(np.median(differences)) if differences.size else 0
    return shift_ns if abs(shift_ns) > 1_000_000_000 else 0  # longer than any transport


def task_of(reader: BagReader) -> str | None:
    """The label of a whole bag, None if it has none."""
    return reader.custom_data.get("task") or None


def find_marker_topic(reader: BagReader) -> str | None:
    """Relative name of the marker topic, None if the bag is not a session."""
    return _find_label_topic(reader, MARKER_TOPIC)


def split_session(
    markers: Sequence[BagMessage], samples: Mapping[str, TopicSamples], source: str
) -> Iterator[SessionPart | Rejection]:
    """Demonstrations, each from a label to the following empty marker.

    Markers have no stamp, so their log times are used. If the stamps of the data are from another
    clock (simulated time), these are shifted by the median difference.
    """
    differences = [topic.log_times_ns - topic.stamps_ns for topic in samples.values()]
    shift_ns = clock_shift_ns(np.concatenate([*differences, np.empty(0, np.int64)]))
    label, start_ns, index = "", 0, 0
    for marker in markers:
        now_ns = marker.log_time_ns - shift_ns
        text = _label(marker)
        if text and label:
            yield _unended(source, marker, label, "before the next began")
        elif label and (problem := label_problem(label, source, marker.topic, start_ns)):
            yield problem
        elif not text and label:
            yield SessionPart(index, label, start_ns, now_ns)
            index += 1
        label, start_ns = text, now_ns
    if label:
        yield _unended(source, markers[-1], label, "before the recording ended")


def task_sequences(reader: BagReader, forget_after_s: float) -> Iterator[TaskSequence]:
    """The task sequences in a bag, by log times; none if it has no topic of labels."""
    tasks: list[str] = []
    durations_s: list[float] = []
    begun_ns, ended_ns, running = 0, 0, False
    marker = find_marker_topic(reader)
    topic = marker or _find_label_topic(reader, ACTIVE_TOPIC)
    for message in reader.messages([topic]) if topic else ():
        label, now_ns = _label(message), message.log_time_ns
        if label:
            check_label(label)
            if tasks and not running and now_ns - ended_ns > forget_after_s * 1e9:
                yield TaskSequence(str(reader.path), tuple(tasks), tuple(durations_s))
                tasks, durations_s = [], []
            if running and marker is None:
                tasks[-1] = label  # the decision changed during one movement
            else:
                tasks.append(label)
                durations_s.append(0.0)
                begun_ns = now_ns
        elif running:
            durations_s[-1] = (now_ns - begun_ns) * 1e-9
        ended_ns, running = now_ns, bool(label)
    if tasks:
        yield TaskSequence(str(reader.path), tuple(tasks), tuple(durations_s))


def _find_label_topic(reader: BagReader, wanted: str) -> str | None:
    for name, info in reader.topics.items():
        relative = relative_topic(name)
        named = f"/{relative}".endswith(f"/{wanted}")
        if named and info.type == MARKER_TYPE and info.message_count:
            return relative
    return None


def _label(message: BagMessage) -> str:
    return str(message.message.data).strip()


def _unended(source: str, marker: BagMessage, label: str, when: str) -> Rejection:
    reason = f"truncated: demonstration of {label!r} did not end {when}"
    return Rejection(source, marker.topic, marker.log_time_ns, reason)


def read_task_sequences(
    paths: Iterable[str | Path], forget_after_s: float
) -> tuple[list[TaskSequence], list[Rejection]]:
    """Task sequences in all session bags below `paths`, and rejections of the other bags.

    A pause between two tasks longer than `forget_after_s` [s] ends a sequence.

    Raises:
        BagError: a path does not exist.
    """
    sequences: list[TaskSequence] = []
    rejections: list[Rejection] = []
    for path in map(Path, paths):
        bags = find_bags(path)
        if not bags:
            rejections.append(no_bag(path))
        for bag in bags:
            try:
                found = list(task_sequences(BagReader(bag), forget_after_s))
            except BagError as error:
                rejections.append(Rejection.of(str(bag), error))
                continue
            sequences += found
            if not found:
                reason = f"no session: nothing on {MARKER_TOPIC} nor on {ACTIVE_TOPIC}"
                rejections.append(Rejection(str(bag), "", 0, reason))
    return sequences, rejections
