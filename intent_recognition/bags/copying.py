# SPDX-License-Identifier: Apache-2.0
"""Messages of one recording into others, byte for byte: a whole one, or parts of it."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags.messages import RawMessage
from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter


class BagPart(NamedTuple):
    """A part of a recording, to be written as a bag of its own.

    Attributes:
        start_ns: log time of its first message, or earlier.
        end_ns: log time of its last message, or later; before the next part begins.
        path: directory of the new bag; must not exist.
    """

    start_ns: int
    end_ns: int
    path: Path
    custom_data: Mapping[str, str]


def cut_bag(reader: BagReader, parts: Sequence[BagPart], leave_out: Collection[str] = ()) -> None:
    """Write parts of a recording, in order of time, as bags; every message as it is.

    Args:
        reader: the recording.
        parts: one after the other.
        leave_out: absolute names of topics that are not copied.

    Raises:
        ResourceBusyError: a directory exists already or cannot be made.
        DiskFullError: too little space; what was written before is whole.
    """
    waiting = list(parts)
    with ExitStack() as stack:
        writer: BagWriter | None = None
        for message in reader.raw_messages():
            while waiting and message.log_time_ns > waiting[0].end_ns:
                waiting.pop(0)
                if writer is not None:
                    writer.close()
                    writer = None
            if not waiting:
                return
            if message.log_time_ns < waiting[0].start_ns or message.topic in leave_out:
                continue
            if writer is None:
                writer = stack.enter_context(
                    BagWriter(waiting[0].path, waiting[0].custom_data, flush_period_s=None)
                )
                declare_topics(writer, reader, leave_out)
            copy_message(writer, message)


def declare_topics(writer: BagWriter, reader: BagReader, leave_out: Collection[str] = ()) -> None:
    """Declare the topics of a recording with their definitions and QoS profiles."""
    for topic in reader.topics.values():
        if topic.name not in leave_out:
            found = reader.definition_of(topic.name)
            writer.add_topic(topic.name, topic.type, topic.offered_qos_profiles, found)


def copy_message(writer: BagWriter, message: RawMessage) -> None:
    """Append a message as it was recorded."""
    writer.write(
        message.topic,
        message.type,
        message.data,
        message.log_time_ns,
        message.publish_time_ns,
        sequence=message.sequence,
    )
