# SPDX-License-Identifier: Apache-2.0
"""Read a ROS 1 bag whose index, written when recording ends, is missing or damaged."""

import os
import re
from collections import defaultdict
from contextlib import suppress
from io import BytesIO
from mmap import ACCESS_READ, mmap
from typing import BinaryIO

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import ChunkInfo, Header, IndexData, RecordType, read_bytes, read_uint32

CHUNK = re.compile(rb"(?s)....(?:....compression=|\x04\0\0\0op=\x05)")
"""Start of a chunk: its header's length and the first field, in the order of either writer."""


class IndexedReader(Reader):
    """A reader that refuses an incomplete index; its base would skip the missing messages."""

    def open(self) -> None:
        """Open the bag.

        Raises:
            ReaderError: the index is missing or damaged.
        """
        super().open()
        said = sum(sum(info.connection_counts.values()) for info in self.chunk_infos)
        if said != (found := sum(map(len, self.indexes.values()))):
            raise ReaderError(f"its index names {found} of {said} messages")


class UnindexedReader(Reader):
    """A reader for a bag whose index is missing or damaged. It reads all whole chunks, and from a
    damaged chunk the messages before the damage.
    """

    def open(self) -> None:
        """Open the bag and rebuild its index."""
        self.bio = file = self.path.open("rb")
        file.readline()
        at = file.tell()
        self._known: dict[int, Connection] = {}
        self.indexes = defaultdict(list)
        with mmap(file.fileno(), 0, access=ACCESS_READ) as view:
            while 0 <= at < len(view):
                try:
                    at = self._pass(file, at, len(view))
                except Exception:  # the library may raise anything at damage or at the end
                    at = found.start() if (found := CHUNK.search(view, at + 1)) else -1
        self.indexes = {number: sorted(self.indexes[number]) for number in self._known}
        counts = {number: len(index) for number, index in self.indexes.items()}
        self.connections = [one._replace(msgcount=counts[one.id]) for one in self._known.values()]
        if times_ns := [entry.time for index in self.indexes.values() for entry in index]:
            self.chunk_infos = [ChunkInfo(0, min(times_ns), max(times_ns) + 1, counts)]

    def _pass(self, file: BinaryIO, at: int, size: int) -> int:
        """Index the record at `at` if it is a chunk, and return where the next record begins."""
        file.seek(at)
        if Header.read(file).get_uint8("op") != RecordType.CHUNK:
            return file.seek(read_uint32(file), os.SEEK_CUR)
        file.seek(at)
        chunk = self.read_chunk()
        if not chunk.datasize or chunk.datapos + chunk.datasize > size:  # it was not closed
            chunk = chunk._replace(datasize=size - chunk.datapos)
        file.seek(chunk.datapos)
        content = read_bytes(file, chunk.datasize)
        with suppress(Exception):
            self.bio = BytesIO(chunk.decompressor(content))
            self.chunks[at] = chunk
            self._take_in(at)
        self.bio = file
        return chunk.datapos + chunk.datasize

    def _take_in(self, chunk: int) -> None:
        """Note the connections of a chunk and the offset of each message."""
        while self.bio is not None:
            at = self.bio.tell()
            header = Header.read(self.bio)
            if header.get_uint8("op") == RecordType.CONNECTION:
                self.bio.seek(at)
                one = self.read_connection()
                self._known[one.id] = one
                continue
            read_bytes(self.bio, read_uint32(self.bio))
            if header.get_uint8("op") == RecordType.MSGDATA:
                entry = IndexData(header.get_time("time"), chunk, at)
                self.indexes[header.get_uint32("conn")].append(entry)
