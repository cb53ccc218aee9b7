# SPDX-License-Identifier: Apache-2.0
"""Read the messages of one MCAP file by log time, up to the first damage or skipping it."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Schema

from intent_recognition.bags.mcap.chunk import (
    PARSE_ERRORS,
    McapBlock,
    MessageTable,
    groups,
    read_messages,
)
from intent_recognition.bags.mcap.scan import Damage, FileScan, open_view, scan_file
from intent_recognition.bags.messages import RECOVER, ROS_ENCODINGS, complete_schema
from intent_recognition.errors import BagError

ITEM_BYTES = 400
"""Measured memory overhead of one message [bytes]."""


class Item(NamedTuple):
    """One message; sorts by log time, then in recorded order, by block and row."""

    log_time_ns: int
    offset: int  # of its block in the file [bytes]
    row: int  # index in the block
    publish_time_ns: int
    sequence: int
    data: bytes
    channel: Channel


def complete_schemas(scan: FileScan, types: Mapping[str, str]) -> dict[int, Schema | None]:
    """The definition of each channel's type, converted to the ros2msg format where possible if its
    messages are ROS messages.
    """
    return {
        c.id: complete_schema(scan.schemas.get(c.schema_id), types.get(c.topic, ""))
        if c.message_encoding in ROS_ENCODINGS
        else scan.schemas.get(c.schema_id)
        for c in scan.channels.values()
    }


class McapFile:
    """A scanned file; a tolerant reader adds what it skips to `damage` instead of raising.

    Attributes:
        schemas: definition of each channel's type, in the ros2msg format where possible. If the
            file has no definition, it is looked up by the topic's type in `types`.
    """

    def __init__(
        self,
        path: Path,
        *,
        tolerant: bool,
        damage: list[Damage],
        types: Mapping[str, str] | None = None,
    ):
        self.path = path
        self.scan = scan_file(path)
        self.schemas = complete_schemas(self.scan, types or {})
        self._tolerant = tolerant
        self._damage = damage
        damage.extend(self.scan.damage)

    def counts(self) -> Mapping[int, int]:
        """Number of messages by channel, counted if the summary does not state it."""
        said = self.scan.statistics.channel_message_counts if self.scan.statistics else {}
        if said and not self.scan.damage:  # empty if the writer did not count
            return dict(said)
        counts: Counter[int] = Counter()
        with open_view(self.path) as view:
            for block in self.scan.blocks:
                with suppress(*PARSE_ERRORS):
                    counts.update(read_messages(view, block).channels.tolist())
        return counts

    def tables(self, wanted: Collection[int]) -> Iterator[MessageTable]:
        """The messages of some channels block by block, in recorded order.

        Small blocks are read together.
        """
        is_known, is_wanted = np.zeros((2, 2**16), bool)  # by channel id
        is_known[list(self.scan.channels)] = is_wanted[list(wanted)] = True
        with open_view(self.path) as view:
            for group in groups(sorted(self._usable(), key=lambda b: b.offset)):
                try:
                    table = read_messages(view, *group)
                    if group[-1].is_cut or not is_known[table.channels].all():
                        raise ValueError("one that is cut off, or of a channel that is unknown")
                    yield table.rows(is_wanted[table.channels])
                except PARSE_ERRORS:  # read each block of the group by itself
                    for block in group:
                        table = self._table(view, block)
                        yield table.rows(is_wanted[table.channels])
        self._raise_damage()

    def items(self, wanted: set[str] | None) -> Iterator[Item]:
        """Messages of all or the `wanted` topics (no leading slash), ordered by log time."""
        waiting: list[Item] = []
        with open_view(self.path) as view:
            # Blocks that overlap in time are merged; only these are in memory at once.
            for block in sorted(self._usable(), key=lambda b: (b.start_ns, b.offset)):
                before = bisect_left(waiting, block.start_ns, key=lambda i: i.log_time_ns)
                yield from waiting[:before]
                del waiting[:before]
                table = self._table(view, block)
                held = sum(ITEM_BYTES + len(item.data) for item in waiting)
                if held + len(table.data) + ITEM_BYTES * table.starts.size > 2**29:
                    reason = "too many messages whose times overlap"
                    raise self._error(Damage(block.offset, reason, block.start_ns, block.end_ns))
                waiting += self._block_items(block, table, wanted)
                waiting.sort()
            yield from waiting
        self._raise_damage()

    def _usable(self) -> list[McapBlock]:
        """All blocks, or those before the first damage if the reader is not tolerant."""
        scan = self.scan
        if self._tolerant or not scan.damage:
            return scan.blocks
        return [b for b in scan.blocks if b.offset < scan.damage[0].offset and not b.is_cut]

    def _block_items(
        self, block: McapBlock, table: MessageTable, wanted: set[str] | None
    ) -> list[Item]:
        """The wanted messages of a block."""
        channels = {
            number: channel
            for number, channel in self.scan.channels.items()
            if wanted is None or channel.topic.lstrip("/") in wanted
        }
        rows = np.flatnonzero(np.isin(table.channels, list(channels)))
        _, *columns = table.rows(rows)
        data = table.data
        return [
            Item(log_ns, block.offset, i, publish_ns, sequence, data[at : at + n], channels[c])
            for i, c, sequence, log_ns, publish_ns, at, n in zip(
                rows.tolist(), *(column.tolist() for column in columns), strict=True
            )
        ]

    def _table(self, view: mmap, block: McapBlock) -> MessageTable:
        """Messages of a block whose topics are known; none from a damaged block if tolerant."""
        try:
            table = read_messages(view, block)
        except PARSE_ERRORS as error:
            self._note(block, str(error), error)
            return MessageTable.empty()
        times_ns = table.log_times_ns
        if np.any((times_ns < block.start_ns) | (times_ns > block.end_ns)):
            self._note(block, "times of the chunk and of its messages disagree")
        unknown = set(np.unique(table.channels).tolist()) - self.scan.channels.keys()
        for number in sorted(unknown):
            self._note(block, f"the topic of channel {number} is unknown")
        if unknown:
            return table.rows(~np.isin(table.channels, list(unknown)))
        return table

    def _note(self, block: McapBlock, reason: str, cause: Exception | None = None) -> None:
        damage = Damage(block.offset, reason, block.start_ns, block.end_ns)
        if not self._tolerant:
            raise self._error(damage) from cause
        if damage not in self._damage:
            self._damage.append(damage)

    def _raise_damage(self) -> None:
        if self.scan.damage and not self._tolerant:
            raise self._error(self.scan.damage[0])

    def _error(self, damage: Damage) -> BagError:
        topics = ", ".join(sorted(c.topic for c in self.scan.channels.values())) or "unknown"
        until = f" to {damage.end_ns}" if damage.end_ns else ""
        place = f"{self.path}: topics {topics}: time {damage.start_ns}{until} ns"
        got = f"a damaged one ({damage.reason})"
        return BagError.about(f"{place}: byte {damage.offset}", "a whole recording", got, RECOVER)
