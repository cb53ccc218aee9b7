# SPDX-License-Identifier: Apache-2.0
"""What stands inside of an MCAP chunk: decompressed, checked, its messages as columns."""

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from intent_recognition.storage.mcap_records import (
    LEAST_MESSAGE,
    MESSAGE,
    MESSAGE_HEADER,
    RECORD_HEADER,
    gather,
    record_positions,
)

CHUNK_HEADER = struct.Struct("<QQQII")  # start, end, uncompressed size, crc, compression length
PARSE_ERRORS = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError)
LARGEST_RATIO = 2**16
"""No compression does better; a larger size is damage, not worth the memory."""


@dataclass(frozen=True)
class Block:
    """One chunk, or one message outside of chunks.

    Attributes:
        offset: of the record in the file.
        length: of its content, the 9 bytes of opcode and length not counted.
        start_ns: log time of the first message, as the record's header says.
        end_ns: log time of the last message.
        is_chunk: chunk or bare message.
        is_cut: the file ends inside of this chunk.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    is_chunk: bool = True
    is_cut: bool = False


class MessageTable(NamedTuple):
    """The messages of one block in file order; n rows.

    Attributes:
        data: bytes of the block, decompressed.
        channels: channel ids, uint16 (n,).
        sequences: uint32 (n,).
        log_times_ns: uint64 (n,).
        publish_times_ns: uint64 (n,).
        starts: where in `data` each payload begins, int64 (n,).
        lengths: of the payloads, int64 (n,).
    """

    data: bytes | memoryview
    channels: np.ndarray
    sequences: np.ndarray
    log_times_ns: np.ndarray
    publish_times_ns: np.ndarray
    starts: np.ndarray
    lengths: np.ndarray

    @classmethod
    def empty(cls) -> "MessageTable":
        """No message."""
        kinds = (np.uint16, np.uint32, np.uint64, np.uint64, np.int64, np.int64)
        return cls(b"", *(np.empty(0, kind) for kind in kinds))

    def rows(self, keep: np.ndarray) -> "MessageTable":
        """The messages that the mask (n,) or the indices name."""
        return MessageTable(self.data, *(column[keep] for column in self[1:]))


class Scratch:
    """Memory to decompress to, again and again: much faster than new memory for each chunk."""

    def __init__(self):
        self._buffer = bytearray()

    def decompress(self, content: bytes, size: int) -> memoryview:
        """What a zstd frame holds; valid until the next call.

        Raises:
            ValueError: it is not `size` bytes long.
            zstandard.ZstdError: it is damaged.
        """
        if size > LARGEST_RATIO * len(content):
            raise ValueError(f"{len(content)} bytes say they are {size} decompressed")
        if size > len(self._buffer):
            self._buffer = bytearray(size)
        target = memoryview(self._buffer)[:size]
        with zstandard.ZstdDecompressor().stream_reader(content) as reader:
            if reader.readinto(target) != size or reader.read(1):
                raise ValueError(f"chunk of another size than {size} bytes")
        return target


def read_messages(
    view: bytes | mmap.mmap, block: Block, scratch: Scratch | None = None
) -> MessageTable:
    """The messages of one block, its checksum verified.

    Of a chunk cut off by the end of the file all that can be decompressed is returned.

    Args:
        view: bytes of the file.
        block: which part of it.
        scratch: where to decompress to; the table's `data` is then valid until the next block is
            read to the same place.

    Raises:
        ValueError, McapError, zstandard.ZstdError, struct.error, RuntimeError: it is damaged.
            `PARSE_ERRORS` lists them all.
    """
    data = _block_data(view, block, scratch)
    positions = record_positions(data, block.is_cut)
    octets = np.frombuffer(data, np.uint8)
    positions = positions[octets[positions] == MESSAGE]
    heads = gather(data, positions, MESSAGE_HEADER.itemsize).view(MESSAGE_HEADER)
    return MessageTable(
        data,
        heads["channel"],
        heads["sequence"],
        heads["log_ns"],
        heads["publish_ns"],
        positions + MESSAGE_HEADER.itemsize,
        heads["length"].astype(np.int64) - LEAST_MESSAGE,
    )


def payloads(table: MessageTable, length: int) -> np.ndarray:
    """Payloads of a table whose messages all have this length, uint8 (n, length)."""
    return gather(table.data, table.starts, length).view(np.uint8).reshape(-1, length)


def read_definitions(view: bytes | mmap.mmap, block: Block) -> Iterator[Schema | Channel]:
    """Schemas and channels inside of one block, in file order.

    Raises:
        ValueError and others: as `read_messages`.
    """
    data = _block_data(view, block)
    for position in record_positions(data, block.is_cut).tolist():
        opcode, length = RECORD_HEADER.unpack_from(data, position)
        start = position + RECORD_HEADER.size
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            yield parse_definition(opcode, data[start : start + length])


def parse_definition(opcode: int, data: bytes) -> Schema | Channel:
    """The schema or channel of a record's content.

    Raises:
        ValueError and others: as `read_messages`.
    """
    stream = ReadDataStream(BytesIO(data))
    return Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)


def _block_data(
    view: bytes | mmap.mmap, block: Block, scratch: Scratch | None = None
) -> bytes | memoryview:
    """The records of a block; that of a bare message is its own."""
    start = block.offset + RECORD_HEADER.size
    if not block.is_chunk:
        return bytes(view[block.offset : start + block.length])
    _, _, size, crc, name_length = CHUNK_HEADER.unpack_from(view, start)
    at = start + CHUNK_HEADER.size
    compression = bytes(view[at : at + name_length]).decode()
    content = view[at + name_length + 8 : start + block.length]
    if scratch is not None and compression == "zstd" and not block.is_cut:
        data = scratch.decompress(content, size)
    else:
        data = _decompress(compression, content, size, block.is_cut)
    if not block.is_cut:
        if len(data) != size:
            raise ValueError(f"chunk of {len(data)} bytes says it has {size}")
        if crc and zlib.crc32(data) != crc:
            raise ValueError("checksum of the chunk does not match")
    return data


def _decompress(compression: str, data: bytes, size: int, is_cut: bool) -> bytes:
    if compression == "zstd":
        if is_cut:
            return zstandard.ZstdDecompressor().decompressobj().decompress(data)
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        if is_cut:
            return lz4.frame.LZ4FrameDecompressor().decompress(data)
        return lz4.frame.decompress(data)
    if compression == "":
        return data
    raise ValueError(f"unknown compression {compression!r}")
