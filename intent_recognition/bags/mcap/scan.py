# SPDX-License-Identifier: Apache-2.0
"""Walk an MCAP file record by record, through damage: what is whole, what is not, and where."""

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
INDEX_RECORD = struct.Struct("<BQHI")  # the same with opcode and length before
CHUNK, MESSAGE_INDEX, CHUNK_INDEX = (
    int(code) for code in (Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX)
)
LONGEST_METADATA = 2**20
"""Bytes of a metadata record that is read. Convention: rosbag2's have some kilobytes."""
LONGEST_COMPRESSION = 16
"""Bytes of the name of a compression. Convention: longer than any, short enough to tell damage."""
MOST_EXPANSION = 100
"""Bytes of messages for one of the file, beside those of one chunk. Convention: the shipped
recordings have up to 5."""
CHUNK_START = re.compile(
    rb"(?=\x06.{36}(?:\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4|\x00\x00\x00\x00))", re.DOTALL
)
"""Bytes that may be the beginning of a chunk: opcode and compression are where they must be."""


@dataclass(frozen=True)
class Damage:
    """A part of the file that cannot be read."""

    offset: int  # where it begins [bytes]
    reason: str
    start_ns: int = 0  # log time of the last message before it, or of its first; 0 when unknown
    end_ns: int = 0  # log time of its last message, 0 when unknown


@dataclass
class FileScan:
    """What a walk over the file found.

    Attributes:
        blocks: where the messages are, in file order.
        damage: what is broken, in file order; empty for a whole file.
        schemas: by id. From the checked summary, else from wherever they stood.
        channels: by id.
        is_finished: the recording was closed in good order.
        statistics: of the summary, None without it.
        metadata: key-value pairs of the metadata records, by their names; the last of a name.
    """

    blocks: list[McapBlock] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    is_finished: bool = False
    statistics: Statistics | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    def define(self, found: Schema | Channel, *, again: bool = True) -> None:
        """Note a definition; one of the same id is replaced if `again`."""
        if isinstance(found, Schema):
            if again or found.id not in self.schemas:
                self.schemas[found.id] = found
        elif again or found.id not in self.channels:
            self.channels[found.id] = found

    @property
    def span_ns(self) -> tuple[int, int]:
        """Log times of the first message and of the last; chunks without one say 0 and 0."""
        blocks = [block for block in self.blocks if block.end_ns] or self.blocks
        starts, ends = [b.start_ns for b in blocks], [b.end_ns for b in blocks]
        return min(starts, default=0), max(ends, default=0)

    def channel_ids(self, topic: str) -> list[int]:
        """Channels of a topic, its name without leading slash."""
        return [c.id for c in self.channels.values() if c.topic.lstrip("/") == topic]


def scan_file(path: Path) -> FileScan:
    """Find all chunks and definitions of a file; chunks are not decompressed yet."""
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
    """Refuse a file whose chunks say that they are far larger than it, before one is read."""
    sizes = (block.size for block in scan.blocks if not block.is_cut)
    said = sum(size for size in sizes if size <= MOST_CHUNK)  # larger ones are not read
    most = MOST_CHUNK + MOST_EXPANSION * len(view)
    if said > most:
        expected = f"at most {most} bytes of messages in {len(view)}"
        cure = "No recorder writes such a file; record again."
        raise BagError.about(str(path), expected, said, cure)


def open_view(path: Path) -> mmap.mmap:
    """The bytes of a file for `read_messages`; close it after use."""
    with path.open("rb") as stream:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)


def _walk(view: mmap.mmap, scan: FileScan) -> None:
    position = previous = len(MAGIC)
    if view[: len(MAGIC)] != MAGIC:
        scan.damage.append(Damage(0, "the file does not begin as an MCAP file"))
    while position < len(view):
        after, previous = _pass_chunks(view, position, previous, scan)
        if after != position:
            position = after
            continue
        end = _read_record(view, position, scan)
        if end is None:
            found = _resynchronise(view, min(previous, position + 1), position)
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
        previous, position = position + 1, end  # only what follows shows that the length is right


def _pass_chunks(view: mmap.mmap, position: int, previous: int, scan: FileScan) -> tuple[int, int]:
    """Take in sound chunks and all indices from `position` on, most of a file, quickly.

    Returns:
        Where the first other record begins, and where to look for a chunk if it is none.
    """
    head, index, read = RECORD_HEADER.size, INDEX_HEADER.size, INDEX_RECORD.unpack_from
    size, last = len(view), len(view) - INDEX_RECORD.size
    while position <= last:
        opcode, length, _, index_bytes = read(view, position)
        end = position + head + length
        if end > size:
            break
        if opcode in (MESSAGE_INDEX, CHUNK_INDEX):
            if opcode == MESSAGE_INDEX and index_bytes != length - index:
                break
            previous = position + 1
        elif opcode == CHUNK and (block := _chunk_block(view, position, length)):
            scan.blocks.append(block)
            previous = end
        else:
            break
        position = end
    return position, previous


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
    """Take in the record at `position`; its end, or None when there is no sound record."""
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
    if opcode in (CHUNK, MESSAGE_INDEX):
        return False  # `_pass_chunks` takes in the sound ones
    if opcode == Opcode.MESSAGE:
        if length < 22:
            return False
        (log_ns,) = struct.unpack_from("<Q", view, start + 6)
        if log_ns >= LATEST_NS:
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
    """Note a metadata record; no message depends on one that cannot be read."""
    with suppress(*PARSE_ERRORS):
        if len(data) <= LONGEST_METADATA:
            record = Metadata.read(ReadDataStream(BytesIO(data)))
            scan.metadata[record.name] = record.metadata


def _chunk_block(view: mmap.mmap, position: int, length: int) -> McapBlock | None:
    """The chunk at `position` when its own lengths agree with `length`."""
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
    """The chunk at `position` that the end of the file cuts off."""
    start = position + RECORD_HEADER.size
    if len(view) < start + CHUNK_HEADER.size + LONGEST_COMPRESSION + 8:
        return None
    opcode, length = RECORD_HEADER.unpack_from(view, position)
    if (
        opcode != Opcode.CHUNK
        or start + length <= len(view)
        or not CHUNK_START.match(view, position)
    ):
        return None
    block = _chunk_block(view, position, length)
    return block and block._replace(length=len(view) - start, is_cut=True)


def _resynchronise(view: mmap.mmap, position: int, failed: int) -> int | None:
    """Offset of the next chunk at or after `position`, but for the one that `failed`."""
    for match in CHUNK_START.finditer(view, position):
        at = match.start()
        _, length = RECORD_HEADER.unpack_from(view, at)
        if at == failed:
            continue
        whole = at + RECORD_HEADER.size + length <= len(view)
        if (whole and _chunk_block(view, at, length)) or _cut_chunk(view, at):
            return at
    return None


def _read_summary(view: mmap.mmap, scan: FileScan) -> None:
    """Trust the summary's definitions when its checksum holds; where it has none, or not all of
    them, those inside the chunks count too.
    """
    summary = _checked_summary(view) if scan.is_finished else b""
    if summary is None:
        scan.damage.append(Damage(len(view), "checksum of the summary does not match"))
    if not summary:
        scan.statistics = None
    for found in definitions_in(summary or b"", is_cut=True):
        scan.define(found)
    if not _is_complete(scan):
        _definitions_of_chunks(view, scan)
    said = scan.statistics.chunk_count if scan.statistics else 0
    if said not in (0, sum(block.is_chunk for block in scan.blocks)) and not scan.damage:
        why = f"{said} chunks were written, not all of them are found"
        scan.damage.append(Damage(len(view), why))


def _is_complete(scan: FileScan) -> bool:
    """Whether all definitions are known: writers may leave some or all out of the summary."""
    said, channels = scan.statistics, scan.channels.values()
    return (
        said is not None
        and (said.schema_count, said.channel_count) == (len(scan.schemas), len(channels))
        and all(channel.schema_id in scan.schemas for channel in channels if channel.schema_id)
    )


def _checked_summary(view: mmap.mmap) -> bytes | None:
    """The summary, empty where the file has none; None if it is damaged."""
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


def _definitions_of_chunks(view: mmap.mmap, scan: FileScan) -> None:
    for block in filter(lambda block: block.is_chunk, scan.blocks):
        with suppress(*PARSE_ERRORS):
            for found in list(read_definitions(view, block)):
                scan.define(found)
