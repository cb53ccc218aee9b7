# SPDX-License-Identifier: Apache-2.0
"""Save what can be saved from a truncated or damaged recording."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from intent_recognition.bags.copying import copy_message, declare_topics
from intent_recognition.bags.mcap.scan import Damage
from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter
from intent_recognition.errors import BagError


@dataclass(frozen=True)
class RecoveryReport:
    """What was saved and what was not.

    Attributes:
        message_counts: messages saved, by topic.
        start_ns: log time of the first message saved, 0 for none.
        end_ns: log time of the last message saved.
        damage: what was left out.
        notes: other oddities, as sentences.
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
    """Write a new bag with every message of `source` whose checksum is right.

    Damaged parts are skipped up to the next whole chunk. Of a chunk cut off by the end of the file,
    whatever can be decompressed is kept. Labels come from metadata.yaml where it is readable.

    Args:
        source: bag directory or .mcap file; it is not changed.
        output: directory of the new bag; must not exist.

    Returns:
        What was saved and what was not.

    Raises:
        BagError: there is no MCAP file, or not one message in it can be read.
        ResourceBusyError: `output` exists already.
    """
    reader = BagReader(source, tolerant=True)
    messages = reader.raw_messages()
    first = next(messages, None)
    if first is None:
        why = reader.damage[0].reason if reader.damage else "the bag is empty"
        cure = "Record it again."
        raise BagError.about(str(source), "a message that can be read", f"none: {why}", cure)
    counts: Counter[str] = Counter()
    last_ns = first.log_time_ns
    with BagWriter(output, reader.custom_data, flush_period_s=None) as writer:
        declare_topics(writer, reader)
        for message in chain([first], messages):
            copy_message(writer, message)
            counts[message.topic] += 1
            last_ns = max(last_ns, message.log_time_ns)
    damage = tuple(sorted(reader.damage, key=lambda found: found.offset))
    notes = tuple(reader.notes)
    return RecoveryReport(
        str(source), str(output), dict(counts), first.log_time_ns, last_ns, damage, notes
    )
