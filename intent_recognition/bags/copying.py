# SPDX-License-Identifier: Apache-2.0
"""Copy a recording, or parts of it, byte for byte."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags.definitions import definition
from intent_recognition.bags.mcap.chunk import LATEST_NS
from intent_recognition.bags.mcap.scan import Damage
from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter
from intent_recognition.errors import BagError, MessageError, as_path


class BagPart(NamedTuple):
    """A part of a recording that becomes a bag in a new directory."""

    start_ns: int  # at or before the log time of its first message
    end_ns: int  # at or after the log time of its last message, before the next part begins
    path: Path
    custom_data: Mapping[str, str]


def cut_bag(
    reader: BagReader, parts: Sequence[BagPart], leave_out: Collection[str] = ()
) -> list[dict[str, int]]:
    """Write parts of a recording, ordered by time, as bags with unchanged messages.

    Topics whose absolute names are in `leave_out` are not copied.

    Returns:
        Message counts by topic for each part. A part without messages has none and makes no bag.

    Raises:
        ResourceBusyError: a directory exists already or cannot be made.
        DiskFullError: there is too little space; everything written before is complete.
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
    """Saved messages by topic, their first and last log times (0 for none), and the damage skipped;
    `notes` describe other oddities in sentences.
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
        """Number of saved messages of all topics."""
        return sum(self.message_counts.values())


def recover(source: str | Path, output: str | Path) -> RecoveryReport:
    """Write every message of the recording `source` whose checksum is right to a new bag.

    Damaged parts are skipped up to the next whole chunk. From a chunk that the end of the file cuts
    off, everything that can be decompressed is kept. Labels come from metadata.yaml if readable.
    Topics whose type neither the recording nor ROS defines are left out.

    Raises:
        BagError: no message of `source` can be read.
        ResourceBusyError: `output`, the directory of the new bag, exists already.
    """
    reader = BagReader(source, tolerant=True)
    undefined = _undefined(reader)
    everything = BagPart(0, LATEST_NS, as_path("output", output), reader.custom_data)
    (counts,) = cut_bag(reader, [everything], undefined)
    if not counts:
        reasons = [*(found.reason for found in reader.damage), *undefined.values()]
        why = next(iter(reasons), "the bag is empty")
        cure = "Record it again."
        raise BagError.about(str(source), "a message that can be read", f"none: {why}", cure)
    damage = tuple(sorted(reader.damage, key=lambda found: found.offset))
    notes, saved = (*reader.notes, *undefined.values()), BagReader(everything.path)
    found = {topic: count for topic, count in counts.items() if count}
    times_ns = saved.start_ns, saved.end_ns
    return RecoveryReport(str(source), str(output), found, *times_ns, damage, notes)


def _undefined(reader: BagReader) -> dict[str, str]:
    """Topics whose types are not defined, each with the reason for leaving it out."""
    found = {}
    for topic in reader.topics.values():
        try:
            if reader.definition_of(topic.name) is None:
                definition(topic.type)
        except MessageError as error:
            found[topic.name] = f"left out {topic.name}: {error}"
    return found
