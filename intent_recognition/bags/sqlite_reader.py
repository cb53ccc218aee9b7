# SPDX-License-Identifier: Apache-2.0
"""Read a rosbag2 `.db3` file of any distribution, even one that its recorder never closed."""

import os
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat

FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
TABLES = {
    "topics": "id, name, type, serialization_format, offered_qos_profiles, type_description_hash",
    "messages": "id, topic_id, timestamp, data",
    "message_definitions": "id, topic_type, encoding, encoded_message_definition, hash",
}
"""rosbag2's tables and their columns; older releases have fewer columns."""
LEAF = 13
"""Type of a page that holds table rows."""
WIDTHS = (0, 1, 2, 3, 4, 6, 8, 8, 0, 0, 0, 0)
"""Size of a number by its serial type [bytes]."""


def is_open(path: Path) -> bool:
    """Whether messages are left in a write-ahead log, which closing would have emptied."""
    log = path.with_name(f"{path.name}-wal")
    return log.is_file() and log.stat().st_size > 0


def _page(head: bytes) -> int:
    """Page size [bytes] from the file header, where 1 means 2^16; the default if it is invalid."""
    size = int.from_bytes(head[16:18], "big")
    return {1: 2**16}.get(size, size if size in (2**k for k in range(9, 16)) else 2**12)


class SqliteReader:
    """A reader with the interface of `rosbags.rosbag1.Reader`. Unlike rosbags' own, it reads the
    write-ahead log and accepts files with a type whose definition the recorder did not know.
    """

    def __init__(self, path: Path):
        self.path = path

    def open(self) -> None:
        """Open the file; read its topics, message counts and time span."""
        self._file = self._connect()
        listed = "SELECT name FROM sqlite_master WHERE type = 'table'"
        tables = {name for (name,) in self._file.execute(listed)}
        if not {"topics", "messages"} <= tables:
            raise ValueError(f"tables {', '.join(sorted(tables))}, not topics and messages")
        asked = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        definitions = self._file.execute(asked) if "message_definitions" in tables else ()
        said = {name: (form, text) for name, form, text in definitions}
        counted = "SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"
        counts = dict(self._file.execute(counted).fetchall())
        self.connections = []
        topics = self._file.execute("SELECT * FROM topics ORDER BY id")
        names = [column[0] for column in topics.description]
        for row in topics:
            one = dict(zip(names, row, strict=True))
            if not (isinstance(one["name"], str) and isinstance(one["type"], str)):
                continue
            form, text = said.get(one["type"], ("", ""))  # either may have any type
            definition = MessageDefinition(
                FORMATS.get(form, MessageDefinitionFormat.NONE), str(text)
            )
            digest, count = one.get("type_description_hash", ""), counts.get(one["id"], 0)
            more = (definition, digest, count, one.get("offered_qos_profiles", ""), self)
            self.connections.append(Connection(one["id"], one["name"], one["type"], *more))
        for number in counts.keys() - {one.id for one in self.connections}:
            raise ValueError(f"topic {number} without a name and a type")
        self.message_count = sum(counts.values())
        times = self._file.execute("SELECT MIN(timestamp), MAX(timestamp) + 1 FROM messages")
        self.start_time, self.end_time = (int(time_ns or 0) for time_ns in times.fetchone())

    def _connect(self) -> sqlite3.Connection:
        folder = self.path.resolve().parent  # to read the log, SQLite writes a file beside it
        mode = "mode=ro" if is_open(self.path) and os.access(folder, os.W_OK) else "immutable=1"
        with self.path.open("rb") as file:
            head = file.read(32)
        size = int.from_bytes(head[28:32], "big") * _page(head)
        if mode != "mode=ro" and self.path.stat().st_size < size:  # a log may hold the rest
            raise ValueError("a database that is cut off")
        return sqlite3.connect(f"file:{quote(str(self.path.resolve()))}?{mode}", uri=True)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def messages(self, wanted: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages of the `wanted` topics, ordered by time."""
        topics = {one.id: one for one in wanted}
        asked = (
            "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN"
            f" ({', '.join('?' * len(topics))}) ORDER BY timestamp, id"
        )
        for number, at_ns, data in self._file.execute(asked, list(topics)):
            yield topics[number], int(at_ns), bytes(data)


class DamagedSqliteReader(SqliteReader):
    """A reader for a truncated or damaged file: it collects all whole rows wherever they are.

    Rows are in the leaves of table b-trees: https://sqlite.org/fileformat2.html, 1.6 and 2.1.
    """

    def _connect(self) -> sqlite3.Connection:
        file = sqlite3.connect("")  # a temporary file, removed with the connection
        for name, columns in TABLES.items():
            file.execute(f"CREATE TABLE {name} ({columns}, PRIMARY KEY (id))")
        with self.path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
            for number, row in _rows(data):
                match row:
                    case None, int(), int(), bytes():
                        name = "messages"
                    case None, str(), str(kind), str(), *_ if "/msg/" in kind:
                        name = "topics"
                    case None, str(), str(), str(), str():
                        name = "message_definitions"
                    case _:
                        continue
                values = [number, *row[1:], "", ""][: TABLES[name].count(",") + 1]
                marks = ", ".join("?" * len(values))
                file.execute(f"INSERT OR IGNORE INTO {name} VALUES ({marks})", values)
        return file


def _rows(data: mmap) -> Iterator[tuple[int, list[Any]]]:
    """Row id and values of each readable row of a file."""
    size = _page(data[:32])
    used: set[int] = set()
    for start in range(0, len(data), size):
        head = start + 100 * (start == 0)
        count = int.from_bytes(data[head + 3 : head + 5], "big") if data[head] == LEAF else 0
        for k in range(count):
            cell = int.from_bytes(data[head + 8 + 2 * k : head + 10 + 2 * k], "big")
            with suppress(IndexError, ValueError):
                length, at = _varint(data, start + cell)
                number, at = _varint(data, at)
                yield number, _values(_content(data, at, length, size, used))


def _content(data: mmap, at: int, length: int, size: int, used: set[int]) -> bytes:
    """Bytes of a row: a long row continues from its page in a chain of overflow pages."""
    least = (size - 12) * 32 // 255 - 23
    part = least + (length - least) % (size - 4)
    here = length if length <= size - 35 else part if part <= size - 35 else least
    pieces, after = [data[at : at + here]], data[at + here : at + here + 4]
    for _ in range(-(-(length - here) // (size - 4))):
        page = int.from_bytes(after, "big") - 1
        if not 0 <= page * size < len(data) or page in used:
            raise ValueError("no such page, or one of another row")
        used.add(page)
        after = data[page * size : page * size + 4]
        pieces.append(data[page * size + 4 : (page + 1) * size])
    return b"".join(pieces)[:length]


def _values(content: bytes) -> list[Any]:
    """Values of a row: integers, texts and bytes; None for other types."""
    end, at = _varint(content, 0)
    kinds: list[int] = []
    values: list[Any] = []
    while at < end:
        kind, at = _varint(content, at)
        kinds.append(kind)
    for kind in kinds:
        n = (kind - 12) // 2 if kind >= 12 else WIDTHS[kind]
        part, at = content[at : at + n], at + n
        if kind >= 12:
            values.append(part.decode() if kind % 2 else part)
        else:
            whole = kind - 8 if kind in (8, 9) else int.from_bytes(part, "big", signed=True)
            values.append(whole if kind not in (0, 7) else None)
    if at != len(content):
        raise ValueError("a row of another length than its values")
    return values


def _varint(data: bytes | mmap, at: int) -> tuple[int, int]:
    """Read a varint (up to nine bytes); returns its value and where it ends."""
    value = 0
    for k in range(at, at + 8):
        value = value << 7 | data[k] & 0x7F
        if data[k] < 0x80:
            return value, k + 1
    return value << 8 | data[at + 8], at + 9
