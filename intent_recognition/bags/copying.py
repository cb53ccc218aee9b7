# SPDX-License-Identifier: Apache-2.0
"""Messages of one recording into others, byte for byte: a whole one, or parts of it."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags.definitions import definition
from intent_recognition.bags.mcap.scan import Damage
from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter
from intent_recognition.errors import BagError, MessageError


class BagPart(NamedTuple):
    """A part of a recording, to be written as a bag of its own, in a new directory."""

    start_ns: int  # log time of its first message, or earlier
    end_ns: int  # log time of its last message, or later; before the next part begins
    path: Path
    custom_data: Mapping[str, str]


def cut_bag(
    reader: BagReader, parts: Sequence[BagPart], leave_out: Collection[str] = ()
) -> list[dict[str, int]]:
    """Write parts of a recording, in order of time, as bags; every message as it is.

    Topics of the absolute names `leave_out` are not copied.

    Returns:
        The messages of each part by topic; none of a part without any, which becomes no bag.

    Raises:
        ResourceBusyError: a directory exists already or cannot be made.
        DiskFullError: too little space; what was written before is whole.
    """
    topics = [name for name in reader.topics if name not in leave_out]
    counts: list[dict[str, int]] = [{} for _ in parts]
    waiting = list(zip(parts, counts, strict=True))
    with ExitStack() as stack:
        writer: BagWriter | None = None
        for message in reader.raw_messages():
            while waiting and message.log_time_ns > waiting[0][0].end_ns:
                waiting.pop(0)
                if writer is not None:
                    writer.close()
                    writer = None
            if not waiting:
                break
            part, count = waiting[0]
            if message.log_time_ns < part.start_ns or message.topic in leave_out:
                continue
            if writer is None:
                writer = stack.enter_context(
                    BagWriter(part.path, part.custom_data, flush_period_s=None)
                )
                declare_topics(writer, reader, leave_out)
                count |= dict.fromkeys(topics, 0)
            writer.write_raw(message)
            count[message.topic] += 1
    return counts


def declare_topics(writer: BagWriter, reader: BagReader, leave_out: Collection[str] = ()) -> None:
    """Declare the topics of a recording with their definitions and QoS profiles."""
    for topic in reader.topics.values():
        if topic.name not in leave_out:
            found = reader.definition_of(topic.name)
            writer.add_topic(topic.name, topic.type, topic.offered_qos_profiles, found)


@dataclass(frozen=True)
class RecoveryReport:
    """What was saved (messages by topic, log times of the first and the last, 0 for none), and what
    was not; notes are other oddities, as sentences.
    """

    source: str
    output: str
    message_counts: Mapping[str, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    damage: tuple[Damage, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def message_count(self) -> int:
        """Messages saved over all topics."""
        return sum(self.message_counts.values())


def recover(source: str | Path, output: str | Path) -> RecoveryReport:
    """Write a new bag with every message of `source`, a recording, whose checksum is right.

    Damaged parts are skipped up to the next whole chunk. Of a chunk cut off by the end of the file,
    whatever can be decompressed is kept. Labels come from metadata.yaml where it is readable.
    Topics of a type that neither the recording nor ROS defines are left out.

    Raises:
        BagError: not one message in it can be read.
        ResourceBusyError: `output`, the directory of the new bag, exists already.
    """
    reader = BagReader(source, tolerant=True)
    undefined = _undefined(reader)
    messages = (m for m in reader.raw_messages() if m.topic not in undefined)
    first = next(messages, None)
    if first is None:
        reasons = [*(found.reason for found in reader.damage), *undefined.values()]
        why = next(iter(reasons), "the bag is empty")
        cure = "Record it again."
        raise BagError.about(str(source), "a message that can be read", f"none: {why}", cure)
    counts: Counter[str] = Counter()
    start_ns = end_ns = first.log_time_ns
    with BagWriter(output, reader.custom_data, flush_period_s=None) as writer:
        declare_topics(writer, reader, undefined)
        for message in chain([first], messages):
            writer.write_raw(message)
            counts[message.topic] += 1
            at_ns = message.log_time_ns
            start_ns, end_ns = min(start_ns, at_ns), max(end_ns, at_ns)
    damage = tuple(sorted(reader.damage, key=lambda found: found.offset))
    notes = (*reader.notes, *undefined.values())
    return RecoveryReport(str(source), str(output), dict(counts), start_ns, end_ns, damage, notes)


def _undefined(reader: BagReader) -> dict[str, str]:
    """Why topics of a recording are left out, whose types are not defined."""
    found = {}
    for topic in reader.topics.values():
        try:
            if reader.definition_of(topic.name) is None:
                definition(topic.type)
        except MessageError as error:
            found[topic.name] = f"left out {topic.name}: {error}"
    return found
