# SPDX-License-Identifier: Apache-2.0
"""Scan an MCAP file record by record, past damage, and note what is whole and what is not."""

import mmap
import re
import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema, Statistics

from intent_recognition.bags.mcap.chunk import (
    CHUNK_HEADER,
    LATEST_NS,
    MOST_CHUNK,
    PARSE_ERRORS,
    McapBlock,
    definitions_in,
    parse_definition,
    read_definitions,
)
from intent_recognition.bags.mcap.records import RECORD_HEADER
from intent_recognition.errors import BagError

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of an MCAP file."""
FOOTER = struct.Struct("<QQI")
INDEX_HEADER = struct.Struct("<HI")  # channel, bytes of the index that follows
CHUNK, MESSAGE, MESSAGE_INDEX = (
    int(code) for code in (Opcode.CHUNK, Opcode.MESSAGE, Opcode.MESSAGE_INDEX)
)
LONGEST_METADATA = 2**20
"""Longest metadata record that is read [bytes]; rosbag2's have a few kilobytes."""
LONGEST_COMPRESSION = 16
"""Longest accepted name of a compression [bytes]; real names are shorter, so more means damage."""
MOST_EXPANSION = 100
"""Most bytes of messages per byte of file, beyond one `MOST_CHUNK`; shipped recordings reach 5."""
RECORD_START = re.compile(
    rb"(?=\x06.{36}(?:\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4|\x00\x00\x00\x00)"
    rb"|\x05.{4}\x00{4})",
    re.DOTALL,
)
"""Bytes that may begin a chunk, with opcode and compression in the right places, or a message."""


@dataclass(frozen=True)
class Damage:
    """A part of the file that cannot be read."""

    offset: int  # where the damage begins [bytes]
    reason: str
    start_ns: int = 0  # log time of the last message before it, or of its first; 0 if unknown
    end_ns: int = 0  # log time of its last message, 0 if unknown


@dataclass
class FileScan:
    """Content of a scanned file."""

    # chunks and messages outside of chunks, in file order
    blocks: list[McapBlock] = field(default_factory=list)
    # damaged parts, in file order; empty for a whole file
    damage: list[Damage] = field(default_factory=list)
    # by id, from the verified summary or else from anywhere in the file
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)  # by id, from the same source
    is_finished: bool = False  # whether the recording was closed properly
    statistics: Statistics | None = None  # statistics of the summary, None without one
    # key-value pairs of the metadata records by name; the last record of a name counts
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    def define(self, found: Schema | Channel, *, again: bool = True) -> None:
        """Note a definition; an earlier one with the same id is replaced if `again`."""
        if isinstance(found, Schema):
            if again or found.id not in self.schemas:
                self.schemas[found.id] = found
        elif again or found.id not in self.channels:
            self.channels[found.id] = found

    @property
    def span_ns(self) -> tuple[int, int]:
        """Log times of the first and last message, ignoring chunks without messages (0 and 0)."""
        blocks = [block for block in self.blocks if block.end_ns] or self.blocks
        starts, ends = [b.start_ns for b in blocks], [b.end_ns for b in blocks]
        return min(starts, default=0), max(ends, default=0)

    def channel_ids(self, topic: str) -> list[int]:
        """Channel ids of a topic, given without leading slash."""
        return [c.id for c in self.channels.values() if c.topic.lstrip("/") == topic]


def scan_file(path: Path) -> FileScan:
    """Find all chunks and definitions of a file, decompressing chunks only for definitions."""
    scan = FileScan()
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, 2)
            if size == 0:
                raise BagError.about(str(path), "an MCAP file", "an empty file", "Record again.")
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as view:
                _walk(view, scan)
                _check_expansion(path, view, scan)
                _read_summary(view, scan)
    except OSError as error:
        raise BagError.about(str(path), "a readable file", error, "Check the path.") from error
    return scan


def _check_expansion(path: Path, view: mmap.mmap, scan: FileScan) -> None:
    """Refuse a file whose chunks state a far larger size than its own, before reading them."""
    sizes = (block.size for block in scan.blocks if not block.is_cut)
    said = sum(size for size in sizes if size <= MOST_CHUNK)  # larger chunks are never read
    most = MOST_CHUNK + MOST_EXPANSION * len(view)
    if said > most:
        expected = f"at most {most} bytes of messages in {len(view)}"
        cure = "No recorder writes such a file; record again."
        raise BagError.about(str(path), expected, said, cure)


def open_view(path: Path) -> mmap.mmap:
    """Map a file into memory for `read_messages`; close the map after use."""
    with path.open("rb") as stream:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)


def _walk(view: mmap.mmap, scan: FileScan) -> None:
    position = previous = len(MAGIC)
    if view[: len(MAGIC)] != MAGIC:
        scan.damage.append(Damage(0, "the file does not begin as an MCAP file"))
    while position < len(view):
        end = _read_record(view, position, scan)
        if end is None:
            found = _resynchronise(view, min(previous, position + 1), position, scan)
            if found and scan.blocks and scan.blocks[-1].offset < found < position:
                position = scan.blocks.pop().offset  # its wrong length led here
            _note_damage(view, position, found, scan)
            if found is None:
                return
            previous = position = found
            continue
        if view[position] == Opcode.FOOTER:
            scan.is_finished = True
            if view[end : end + len(MAGIC)] != MAGIC:
                scan.damage.append(Damage(end, "the file does not end as an MCAP file"))
            return
        # a chunk states its length twice; that of others is confirmed by the next record
        previous, position = end if view[position] == CHUNK else position + 1, end


def _note_damage(view: mmap.mmap, position: int, found: int | None, scan: FileScan) -> None:
    last_ns = scan.blocks[-1].end_ns if scan.blocks else 0
    if found is not None:
        scan.damage.append(Damage(position, f"unreadable up to byte {found}", last_ns))
        return
    block = _cut_chunk(view, position)
    if block:
        scan.blocks.append(block)
        last_ns = block.start_ns
    reason = f"truncated or unreadable after byte {position} of {len(view)}"
    scan.damage.append(Damage(position, reason, last_ns))


def _read_record(view: mmap.mmap, position: int, scan: FileScan) -> int | None:
    """Note the record at `position`; returns its end, or None if it is not a sound record."""
    start = position + RECORD_HEADER.size
    if start > len(view):
        return None
    opcode, length = RECORD_HEADER.unpack_from(view, position)
    if start + length > len(view):
        return None
    try:
        sound = _take_record(view, position, opcode, length, scan)
    except PARSE_ERRORS:
        return None
    return start + length if sound else None


def _take_record(view: mmap.mmap, position: int, opcode: int, length: int, scan: FileScan) -> bool:
    start = position + RECORD_HEADER.size
    if opcode == MESSAGE_INDEX:
        _, size = INDEX_HEADER.unpack_from(view, start)
        return size == length - INDEX_HEADER.size
    if opcode == CHUNK:
        block = _chunk_block(view, position, length)
        scan.blocks += [block] if block else []
        return block is not None
    if opcode == MESSAGE:
        (log_ns,) = struct.unpack_from("<Q", view, start + 6)
        if length < 22 or log_ns >= LATEST_NS:
            return False
        size = RECORD_HEADER.size + length
        scan.blocks.append(McapBlock(position, length, log_ns, log_ns, size, is_chunk=False))
    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        scan.define(parse_definition(opcode, bytes(view[start : start + length])), again=False)
    elif opcode == Opcode.FOOTER:
        return length == FOOTER.size
    elif opcode == Opcode.DATA_END:
        return length == 4
    elif opcode == Opcode.METADATA:
        _take_metadata(view[start : start + min(length, LONGEST_METADATA + 1)], scan)
    elif opcode == Opcode.STATISTICS:
        scan.statistics = Statistics.read(ReadDataStream(BytesIO(view[start : start + length])))
    else:
        return Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= 0x80
    return True


def _take_metadata(data: bytes, scan: FileScan) -> None:
    """Note a metadata record; an unreadable one is ignored, since no message depends on it."""
    with suppress(*PARSE_ERRORS):
        if len(data) <= LONGEST_METADATA:
            record = Metadata.read(ReadDataStream(BytesIO(data)))
            scan.metadata[record.name] = record.metadata


def _chunk_block(view: mmap.mmap, position: int, length: int) -> McapBlock | None:
    """The chunk at `position` if the lengths it states agree with `length`."""
    start = position + RECORD_HEADER.size
    head = CHUNK_HEADER.size
    if length < head + 8:
        return None
    first, last, size, _, name_length = CHUNK_HEADER.unpack_from(view, start)
    if name_length > LONGEST_COMPRESSION or length < head + name_length + 8:
        return None
    (data_length,) = struct.unpack_from("<Q", view, start + head + name_length)
    if head + name_length + 8 + data_length != length or max(first, last) >= LATEST_NS:
        return None
    return McapBlock(position, length, first, last, size)


def _cut_chunk(view: mmap.mmap, position: int) -> McapBlock | None:
    """The chunk at `position` if the end of the file cuts it off."""
    start = position + RECORD_HEADER.size
    if len(view) < start + CHUNK_HEADER.size + LONGEST_COMPRESSION + 8:
        return None
    opcode, length = RECORD_HEADER.unpack_from(view, position)
    if (
        opcode != Opcode.CHUNK
        or start + length <= len(view)
        or not RECORD_START.match(view, position)
    ):
        return None
    block = _chunk_block(view, position, length)
    return block and block._replace(length=len(view) - start, is_cut=True)


def _resynchronise(view: mmap.mmap, position: int, failed: int, scan: FileScan) -> int | None:
    """Offset of the next chunk, or message outside of chunks, at or after `position`, other than
    the one at `failed`.
    """
    for match in RECORD_START.finditer(view, position):
        at = match.start()
        opcode, length = RECORD_HEADER.unpack_from(view, at)
        if at == failed:
            continue
        whole = at + RECORD_HEADER.size + length <= len(view)
        if opcode == Opcode.MESSAGE:
            if whole and _is_message(view, at, length, scan):
                return at
        elif (whole and _chunk_block(view, at, length)) or _cut_chunk(view, at):
            return at
    return None


def _is_message(view: mmap.mmap, at: int, length: int, scan: FileScan) -> bool:
    """Whether a message of a known channel is at `at`, and another record after it."""
    start = at + RECORD_HEADER.size
    after = start + length + RECORD_HEADER.size
    if length < 22 or after > len(view):
        return False
    channel, _, log_ns = struct.unpack_from("<HIQ", view, start)
    opcode, length = RECORD_HEADER.unpack_from(view, start + length)
    follows = Opcode.HEADER <= opcode <= Opcode.DATA_END and after + length <= len(view)
    return follows and channel in scan.channels and log_ns < LATEST_NS


def _read_summary(view: mmap.mmap, scan: FileScan) -> None:
    """Read the definitions of a summary whose checksum is right; if some are missing, also those
    inside the chunks.
    """
    summary = _checked_summary(view) if scan.is_finished else b""
    if summary is None:
        scan.damage.append(Damage(len(view), "checksum of the summary does not match"))
    if not summary:
        scan.statistics = None
    for found in definitions_in(summary or b"", is_cut=True):
        scan.define(found)
    if not _is_complete(scan):
        for block in filter(lambda block: block.is_chunk, scan.blocks):
            with suppress(*PARSE_ERRORS):
                for found in list(read_definitions(view, block)):
                    scan.define(found)
    said = scan.statistics.chunk_count if scan.statistics else 0
    if said not in (0, sum(block.is_chunk for block in scan.blocks)) and not scan.damage:
        why = f"{said} chunks were written, not all of them are found"
        scan.damage.append(Damage(len(view), why))


def _is_complete(scan: FileScan) -> bool:
    """Whether all definitions are known; writers may omit some or all from the summary."""
    said, channels = scan.statistics, scan.channels.values()
    return (
        said is not None
        and (said.schema_count, said.channel_count) == (len(scan.schemas), len(channels))
        and all(channel.schema_id in scan.schemas for channel in channels if channel.schema_id)
    )


def _checked_summary(view: mmap.mmap) -> bytes | None:
    """The summary, empty if the file has none and None if it is damaged."""
    footer = len(view) - len(MAGIC) - FOOTER.size
    if footer < RECORD_HEADER.size:
        return None
    start, _, crc = FOOTER.unpack_from(view, footer)
    if not start:
        return b""
    if start > footer - RECORD_HEADER.size:
        return None
    summary = bytes(view[start : footer - RECORD_HEADER.size])
    covered = bytes(view[start : footer + FOOTER.size - 4])
    return summary if crc == 0 or zlib.crc32(covered) == crc else None
