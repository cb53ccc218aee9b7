# SPDX-License-Identifier: Apache-2.0
"""Which task followed which in recorded sessions: the labels alone, in order.

A session bag says so by its `demonstration` markers. A recording of the running graph without
such markers says it by `intent/active_task`: what was recognised and served. Both carry a label
when a task begins and an empty string when it is over.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations.dofs import relative_topic
from intent_recognition.demonstrations.reading import find_bags
from intent_recognition.demonstrations.sessions import MARKER_TOPIC, MARKER_TYPE
from intent_recognition.errors import BagError
from intent_recognition.recognition import FORGET_AFTER_S
from intent_recognition.signals import Rejection

ACTIVE_TOPIC = "intent/active_task"


class TaskSequence(NamedTuple):
    """Tasks that followed one another without a long silence between them.

    Attributes:
        source: path of the bag.
        tasks: their labels, in order.
    """

    source: str
    tasks: tuple[str, ...]


def read_task_sequences(
    paths: Iterable[str | Path], forget_after_s: float = FORGET_AFTER_S
) -> tuple[list[TaskSequence], list[Rejection]]:
    """The task sequences of all session bags below `paths`, and why others have none.

    Args:
        paths: session bags and folders of such, searched to any depth.
        forget_after_s: a longer silence between two tasks ends a sequence.

    Raises:
        BagError: a path does not exist.
    """
    sequences: list[TaskSequence] = []
    rejections: list[Rejection] = []
    for path in map(Path, paths):
        bags = find_bags(path)
        if not bags:
            rejections.append(Rejection(str(path), "", 0, "there is no bag in this folder"))
        for bag in bags:
            try:
                found = list(_sequences(BagReader(bag), forget_after_s))
            except BagError as error:
                rejections.append(Rejection(str(bag), "", 0, str(error)))
                continue
            sequences += found
            if not found:
                reason = f"no session: nothing on {MARKER_TOPIC} nor on {ACTIVE_TOPIC}"
                rejections.append(Rejection(str(bag), "", 0, reason))
    return sequences, rejections


def _sequences(reader: BagReader, forget_after_s: float) -> Iterator[TaskSequence]:
    """Times are those of recording: labels carry no stamp."""
    tasks: list[str] = []
    ended_ns, running = 0, False
    topic = _label_topic(reader)
    for message in reader.messages([topic]) if topic else ():
        label, now_ns = message.message.data.strip(), message.log_time_ns
        if label:
            if tasks and not running and now_ns - ended_ns > forget_after_s * 1e9:
                yield TaskSequence(str(reader.path), tuple(tasks))
                tasks = []
            if running and relative_topic(topic).endswith(ACTIVE_TOPIC):
                tasks[-1] = label  # the robot changed its mind: it was one movement
            else:
                tasks.append(label)
        ended_ns, running = now_ns, bool(label)
    if tasks:
        yield TaskSequence(str(reader.path), tuple(tasks))


def _label_topic(reader: BagReader) -> str | None:
    """The topic that tells the tasks, None when there is none; markers before what was served."""
    for wanted in (MARKER_TOPIC, ACTIVE_TOPIC):
        for name, info in reader.topics.items():
            named = f"/{relative_topic(name)}".endswith(f"/{wanted}")
            if named and info.type == MARKER_TYPE and info.message_count:
                return name
    return None
