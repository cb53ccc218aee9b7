# SPDX-License-Identifier: Apache-2.0
"""Small chunks read as one: a recorder writes two a second, each too small to be worth columns."""

import mmap
import zlib
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np
import zstandard

from intent_recognition.storage.mcap_chunk import (
    CHECKSUM,
    Block,
    MessageTable,
    block_size,
    chunk_content,
    decompress,
    message_table,
)
from intent_recognition.storage.mcap_records import record_positions

GROUP_BYTES = 2**20
LARGE_BYTES = 2**18
"""From this size on, to decompress in place is faster than to copy."""
LARGEST_RATIO = 2**16
"""No compression does better; a larger size is damage, not worth the memory."""


def groups(view: bytes | mmap.mmap, blocks: Iterable[Block]) -> Iterator[list[Block]]:
    """Blocks that follow one another, about `GROUP_BYTES` of records each; a larger one alone."""
    group: list[Block] = []
    total = 0
    for block in blocks:
        size = block_size(view, block)
        if group and (total + size > GROUP_BYTES or block.is_cut or group[-1].is_cut):
            yield group
            group, total = [], 0
        group.append(block)
        total += size
    if group:
        yield group


class GroupReader:
    """Reads groups of blocks to the same memory again and again, which is faster than new memory.

    Args:
        view: bytes of the file.
    """

    def __init__(self, view: bytes | mmap.mmap):
        self._view = view
        self._buffer = bytearray()
        self._zstd = zstandard.ZstdDecompressor()

    def read(self, blocks: Sequence[Block]) -> MessageTable:
        """The messages of whole blocks; the table's `data` is valid until the next call.

        Raises:
            ValueError and others: one of them is damaged; see `read_messages`.
        """
        sizes = [block_size(self._view, block) for block in blocks]
        for block, size in zip(blocks, sizes, strict=True):
            if size > LARGEST_RATIO * block.length:
                raise ValueError(f"{block.length} bytes say they are {size} decompressed")
        if sum(sizes) > len(self._buffer):
            self._buffer = bytearray(max(sum(sizes), GROUP_BYTES))
        data = memoryview(self._buffer)[: sum(sizes)]
        edges = np.cumsum([0, *sizes])
        for block, (start, stop) in zip(blocks, pairwise(edges.tolist()), strict=True):
            self._fill(block, data[start:stop])
        positions = record_positions(data, is_cut=False)
        begins = edges[:-1][np.diff(edges) > 0]
        if np.any(positions[np.searchsorted(positions, begins, side="right") - 1] != begins):
            raise ValueError("a chunk ends inside of a record")
        table = message_table(data, positions)
        counts = np.diff(np.searchsorted(table.starts, edges))
        first_ns = np.repeat(np.array([block.start_ns for block in blocks], np.uint64), counts)
        last_ns = np.repeat(np.array([block.end_ns for block in blocks], np.uint64), counts)
        if np.any((table.log_times_ns < first_ns) | (table.log_times_ns > last_ns)):
            raise ValueError("times of a chunk and of its messages disagree")
        return table

    def _fill(self, block: Block, target: memoryview) -> None:
        """Write the records of a block to its place."""
        if not block.is_chunk:
            target[:] = self._view[block.offset : block.offset + len(target)]
            return
        compression, content, crc = chunk_content(self._view, block)
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
