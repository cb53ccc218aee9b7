# SPDX-License-Identifier: Apache-2.0
"""Read a bag of ROS 1 without its index, which a recorder writes at the end."""

import os
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import (
    ChunkInfo,
    Header,
    IndexData,
    RecordType,
    read_bytes,
    read_uint32,
)


class UnindexedReader(Reader):
    """As its base of a bag whose end, with the index, is missing or damaged: it reads whole chunks
    from the start to the first that is none, and of one still open the messages in it.
    """

    def open(self) -> None:
        """Open it, and make the index anew."""
        self.bio = file = self.path.open("rb")
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        file.readline()
        known: dict[int, Connection] = {}
        indexes: dict[int, list[IndexData]] = defaultdict(list)
        with suppress(Exception):  # the library raises what it meets: the end, or damage
            while True:
                at = file.tell()
                if Header.read(file).get_uint8("op") != RecordType.CHUNK:
                    file.seek(read_uint32(file), os.SEEK_CUR)
                    continue
                file.seek(at)
                chunk = self.read_chunk()
                if not chunk.datasize or chunk.datapos + chunk.datasize > size:  # it is open
                    chunk = chunk._replace(datasize=size - chunk.datapos)
                file.seek(chunk.datapos)
                content = chunk.decompressor(read_bytes(file, chunk.datasize))
                self.chunks[at], self.bio = chunk, BytesIO(content)
                with suppress(Exception):
                    for number, entry in self._records(at, known):
                        indexes[number].append(entry)
                self.bio = file
        self.indexes = {number: sorted(indexes[number]) for number in known}
        counts = {number: len(index) for number, index in self.indexes.items()}
        self.connections = [one._replace(msgcount=counts[one.id]) for one in known.values()]
        if times_ns := [entry.time for index in self.indexes.values() for entry in index]:
            self.chunk_infos = [ChunkInfo(0, min(times_ns), max(times_ns) + 1, counts)]

    def _records(self, chunk: int, known: dict[int, Connection]) -> Iterator[tuple[int, IndexData]]:
        """Connection and place of each message in a chunk; its connections become known."""
        while self.bio is not None:
            at = self.bio.tell()
            header = Header.read(self.bio)
            if header.get_uint8("op") == RecordType.CONNECTION:
                self.bio.seek(at)
                one = self.read_connection()
                known[one.id] = one
                continue
            read_bytes(self.bio, read_uint32(self.bio))
            if header.get_uint8("op") == RecordType.MSGDATA:
                number = header.get_uint32("conn")
                yield number, IndexData(header.get_time("time"), chunk, at)
