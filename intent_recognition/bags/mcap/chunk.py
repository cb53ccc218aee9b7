# SPDX-License-Identifier: Apache-2.0
"""Decompress and check an MCAP chunk, and read its messages as columns."""

import mmap
import struct
import zlib
from collections.abc import Iterator
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
CHECKSUM = "checksum of the chunk does not match"
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
    """The messages of one block in file order; n rows."""

    data: bytes | memoryview  # bytes of the block, decompressed
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


def read_messages(view: bytes | mmap.mmap, block: McapBlock) -> MessageTable:
    """The messages of one block, after verifying its checksum.

    From a chunk that the end of the file cuts off, everything that can be decompressed is returned.

    Raises:
        ValueError, McapError, zstandard.ZstdError, struct.error, RuntimeError: the block is
            damaged. `PARSE_ERRORS` lists all these errors.
    """
    data = _block_data(view, block)
    return message_table(data, message_positions(data, record_positions(data, block.is_cut)))


def message_positions(data: bytes | memoryview, positions: NDArray) -> NDArray:
    """The `positions` (n,) whose records are messages."""
    return positions[np.frombuffer(data, np.uint8)[positions] == MESSAGE]


def message_table(data: bytes | memoryview, positions: NDArray) -> MessageTable:
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
    return definitions_in(_block_data(view, block), block.is_cut)


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


def chunk_content(view: bytes | mmap.mmap, block: McapBlock) -> tuple[str, bytes, int]:
    """Compression, compressed records and checksum (0 for none) of a chunk."""
    start = block.offset + RECORD_HEADER.size
    _, _, _, crc, name_length = CHUNK_HEADER.unpack_from(view, start)
    at = start + CHUNK_HEADER.size
    compression = bytes(view[at : at + name_length]).decode()
    return compression, view[at + name_length + 8 : start + block.length], crc


def _block_data(view: bytes | mmap.mmap, block: McapBlock) -> bytes:
    """The records of a block, decompressed; a message outside of chunks is its own record."""
    size = block.size
    if not block.is_chunk:
        return bytes(view[block.offset : block.offset + size])
    compression, content, crc = chunk_content(view, block)
    data = decompress(compression, content, size, block.is_cut)
    if not block.is_cut:
        if len(data) != size:
            raise ValueError(f"a chunk of {len(data)} bytes that states {size}")
        if crc and zlib.crc32(data) != crc:
            raise ValueError(CHECKSUM)
    return data


def decompress(compression: str, data: bytes, size: int, is_cut: bool = False) -> bytes:
    """Decompress the records of a chunk, or as many of a truncated chunk as possible."""
    if size > MOST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, more than {MOST_CHUNK}")
    if compression == "zstd":
        check_frame(data, size)
        if is_cut:
            return _cut_zstd(data, size)
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    if compression == "":
        return data
    raise ValueError(f"unknown compression {compression!r}")


def check_frame(data: bytes, size: int) -> None:
    """Raise ValueError if a zstd frame states another size than its chunk; zstd allocates it."""
    said = zstandard.frame_content_size(data)
    if said not in (-1, size):
        raise ValueError(f"a frame of {said} bytes in a chunk that states {size}")


def _cut_zstd(data: bytes, size: int) -> bytes:
    """Decompress a truncated frame piece by piece, as far as possible."""
    found = bytearray()
    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
        while len(found) < size:
            piece = reader.read(min(size - len(found), 2**16))
            if not piece:
                break
            found += piece
    return bytes(found)
