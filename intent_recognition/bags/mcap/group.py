# SPDX-License-Identifier: Apache-2.0
"""Read small chunks together. A recorder writes two per second; reading them singly is slow."""

import mmap
import zlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import zstandard

from intent_recognition.bags.mcap.chunk import (
    CHECKSUM,
    CHUNK_BYTES,
    MOST_CHUNK,
    McapBlock,
    MessageTable,
    check_frame,
    chunk_content,
    decompress,
    message_positions,
    message_table,
)
from intent_recognition.bags.mcap.records import gather, record_positions

LARGE_BYTES = 2**18
"""Size from which decompressing in place is faster than copying [bytes], measured."""
UNKNOWN, KNOWN, WANTED = range(3)
CHANNEL = 9
"""Offset of the channel in a message record [bytes]."""


def groups(blocks: Iterable[McapBlock]) -> Iterator[list[McapBlock]]:
    """Group successive blocks up to `CHUNK_BYTES` of records; larger and cut blocks are alone."""
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


class GroupReader:
    """Reads groups of blocks into one reused buffer, which is faster than allocating anew."""

    def __init__(self, view: bytes | mmap.mmap, known: Collection[int], wanted: Collection[int]):
        self._view = view
        self._kinds = np.full(2**16, UNKNOWN, np.uint8)  # by channel id
        self._kinds[list(known)] = KNOWN
        self._kinds[list(wanted)] = WANTED
        self._buffer = bytearray()
        self._zstd = zstandard.ZstdDecompressor()

    def read(self, blocks: Sequence[McapBlock]) -> MessageTable:
        """The wanted messages of whole blocks. The table's `data` is valid until the next call."""
        sizes = [block.size for block in blocks]
        if max(sizes) > MOST_CHUNK:
            raise ValueError(f"a chunk that states {max(sizes)} bytes decompressed")
        if sum(sizes) > len(self._buffer):
            self._buffer = bytearray(max(sum(sizes), CHUNK_BYTES))
        data = memoryview(self._buffer)[: sum(sizes)]
        edges = np.cumsum([0, *sizes])
        for block, (start, stop) in zip(blocks, pairwise(edges.tolist()), strict=True):
            self._fill(block, data[start:stop])
        positions = record_positions(data, is_cut=False)
        begins = edges[:-1][np.diff(edges) > 0]
        if np.any(positions[np.searchsorted(positions, begins, side="right") - 1] != begins):
            raise ValueError("a chunk ends inside of a record")
        positions = message_positions(data, positions)
        kinds = self._kinds[gather(data, positions + CHANNEL, 2).view("<u2")]
        if not kinds.all():
            raise ValueError("the topic of a channel is unknown")
        return message_table(data, positions[kinds == WANTED])

    def _fill(self, block: McapBlock, target: memoryview) -> None:
        """Decompress the records of a block into `target`."""
        if not block.is_chunk:
            target[:] = self._view[block.offset : block.offset + len(target)]
            return
        compression, content, crc = chunk_content(self._view, block)
        if compression == "zstd":
            check_frame(content, len(target))
        if compression == "zstd" and len(target) >= LARGE_BYTES:
            with self._zstd.stream_reader(content) as reader:
                if reader.readinto(target) != len(target) or reader.read(1):
                    raise ValueError(f"chunk of another size than {len(target)} bytes")
        elif compression == "zstd":
            target[:] = self._zstd.decompress(content, max_output_size=len(target))
        else:
            target[:] = decompress(compression, content, len(target))
        if crc and zlib.crc32(target) != crc:
            raise ValueError(CHECKSUM)
