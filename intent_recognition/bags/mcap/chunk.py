# SPDX-License-Identifier: Apache-2.0
"""Decompress and check an MCAP chunk, and read its messages as columns."""

import mmap
import struct
import zlib
from collections.abc import Iterable, Iterator
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from intent_recognition.bags.mcap.records import (
    LEAST_MESSAGE,
    MESSAGE,
    MESSAGE_HEADER,
    RECORD_HEADER,
    gather,
    record_positions,
)

CHUNK_HEADER = struct.Struct("<QQQII")  # start, end, uncompressed size, crc, compression length
PARSE_ERRORS = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError)
CHUNK_BYTES = 2**20
"""Size of a written chunk before compression, and of records read together [bytes]: the default
of MCAP."""
MOST_CHUNK = 2**26
"""Largest accepted chunk, decompressed [bytes]; rosbag2 writes 0.8 MB or one larger message."""
LATEST_NS = 2**63
"""Upper bound of log times [ns], in the year 2262, so that they fit signed integers."""


class McapBlock(NamedTuple):
    """One chunk, or one message outside of chunks, with its first and last log time."""

    offset: int  # of the record in the file [bytes]
    length: int  # of its content [bytes], without the 9 bytes of opcode and length
    start_ns: int
    end_ns: int
    # decompressed size that the chunk states [bytes]; it may be wrong, so `decompress` bounds it
    size: int
    is_chunk: bool = True
    is_cut: bool = False  # whether the file ends inside this chunk


class MessageTable(NamedTuple):
    """The messages of one or more blocks in file order; n rows."""

    data: bytes  # bytes of the block, decompressed
    channels: NDArray  # channel ids, uint16 (n,)
    sequences: NDArray  # uint32 (n,)
    log_times_ns: NDArray  # uint64 (n,)
    publish_times_ns: NDArray  # uint64 (n,)
    starts: NDArray  # offsets of the payloads in `data`, int64 (n,)
    lengths: NDArray  # of the payloads, int64 (n,)

    @classmethod
    def empty(cls) -> "MessageTable":
        """A table without messages."""
        kinds = (np.uint16, np.uint32, np.uint64, np.uint64, np.int64, np.int64)
        return cls(b"", *(np.empty(0, kind) for kind in kinds))

    def rows(self, keep: NDArray) -> "MessageTable":
        """The messages selected by a mask (n,) or by indices."""
        return MessageTable(self.data, *(column[keep] for column in self[1:]))


def groups(blocks: Iterable[McapBlock]) -> Iterator[list[McapBlock]]:
    """Group successive blocks up to `CHUNK_BYTES` of records; larger and cut blocks are alone.

    A recorder writes two chunks per second; reading them singly takes five times as long.
    """
    group: list[McapBlock] = []
    total = 0
    for block in blocks:
        if group and (total + block.size > CHUNK_BYTES or block.is_cut or group[-1].is_cut):
            yield group
            group, total = [], 0
        group.append(block)
        total += block.size
    if group:
        yield group


def read_messages(view: bytes | mmap.mmap, *blocks: McapBlock) -> MessageTable:
    """The messages of successive blocks, after verifying their checksums.

    From a chunk that the end of the file cuts off, everything that can be decompressed is returned.

    Raises:
        ValueError, McapError, zstandard.ZstdError, struct.error, RuntimeError: a block is
            damaged. `PARSE_ERRORS` lists all these errors.
    """
    zstd = zstandard.ZstdDecompressor()  # making one takes as long as reading a small chunk
    parts = [_block_data(view, block, zstd) for block in blocks]
    data = parts[0] if len(parts) == 1 else b"".join(parts)
    positions = record_positions(data, blocks[-1].is_cut)
    ends = np.cumsum([len(part) for part in parts if part])[:-1]
    if np.any(positions[np.searchsorted(positions, ends, side="right") - 1] != ends):
        raise ValueError("a chunk ends inside of a record")
    return message_table(data, positions[np.frombuffer(data, np.uint8)[positions] == MESSAGE])


def message_table(data: bytes, positions: NDArray) -> MessageTable:
    """The messages whose records begin at `positions` (n,)."""
    heads = gather(data, positions, MESSAGE_HEADER.itemsize).view(MESSAGE_HEADER)
    if np.any(heads["log_ns"] >= LATEST_NS):
        raise ValueError("a log time after the year 2262")
    return MessageTable(
        data,
        heads["channel"],
        heads["sequence"],
        heads["log_ns"],
        heads["publish_ns"],
        positions + MESSAGE_HEADER.itemsize,
        heads["length"].astype(np.int64) - LEAST_MESSAGE,
    )


def payloads(table: MessageTable, length: int) -> NDArray:
    """Payloads of a table whose messages all have this length, uint8 (n, length).

    Payloads at equal distances are a view, valid only as long as `table.data`.
    """
    steps = np.diff(table.starts)
    if length and steps.size and np.all(steps == steps[0]):
        shape, strides = (table.starts.size, length), (int(steps[0]), 1)
        return np.ndarray(shape, np.uint8, table.data, int(table.starts[0]), strides)
    found = gather(table.data, table.starts, length).view(np.uint8)
    return found.reshape(table.starts.size, length)


def read_definitions(view: bytes | mmap.mmap, block: McapBlock) -> Iterator[Schema | Channel]:
    """Schemas and channels inside one block, in file order."""
    zstd = zstandard.ZstdDecompressor()
    return definitions_in(_block_data(view, block, zstd), block.is_cut)


def definitions_in(data: bytes, is_cut: bool) -> Iterator[Schema | Channel]:
    """Schemas and channels among the records in `data`, which may be truncated if `is_cut`."""
    for position in record_positions(data, is_cut).tolist():
        opcode, length = RECORD_HEADER.unpack_from(data, position)
        start = position + RECORD_HEADER.size
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield parse_definition(opcode, data[start : start + length])


def parse_definition(opcode: int, data: bytes) -> Schema | Channel:
    """Parse a schema or channel from the content of its record."""
    stream = ReadDataStream(BytesIO(data))
    return Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)


def _block_data(
    view: bytes | mmap.mmap, block: McapBlock, zstd: zstandard.ZstdDecompressor
) -> bytes:
    """The records of a block, decompressed; a message outside of chunks is its own record."""
    size = block.size
    if not block.is_chunk:
        return bytes(view[block.offset : block.offset + size])
    start = block.offset + RECORD_HEADER.size
    _, _, _, crc, name_length = CHUNK_HEADER.unpack_from(view, start)
    at = start + CHUNK_HEADER.size
    compression = bytes(view[at : at + name_length]).decode()
    content = view[at + name_length + 8 : start + block.length]
    data = _decompress(compression, content, size, zstd, block.is_cut)
    if not block.is_cut:
        if len(data) != size:
            raise ValueError(f"a chunk of {len(data)} bytes that states {size}")
        if crc and zlib.crc32(data) != crc:
            raise ValueError("checksum of the chunk does not match")
    return data


def _decompress(
    compression: str, data: bytes, size: int, zstd: zstandard.ZstdDecompressor, is_cut: bool
) -> bytes:
    """Decompress the records of a chunk, or as many of a truncated chunk as possible."""
    if size > MOST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, more than {MOST_CHUNK}")
    if compression == "zstd":
        said = zstandard.frame_content_size(data)
        if said not in (-1, size):  # zstd allocates it
            raise ValueError(f"a frame of {said} bytes in a chunk that states {size}")
        if is_cut:
            return zstd.stream_reader(data).read(size)
        return zstd.decompress(data, max_output_size=size)
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    if compression == "":
        return data
    raise ValueError(f"unknown compression {compression!r}")
