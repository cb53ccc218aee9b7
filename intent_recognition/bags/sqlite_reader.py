# SPDX-License-Identifier: Apache-2.0
"""Read a `.db3` of rosbag2, of any distribution and also one that its recorder never closed."""

import os
import shutil
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat

FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
TABLES = "SELECT name FROM sqlite_master WHERE type = 'table'"


def is_open(path: Path) -> bool:
    """Whether messages wait in a write-ahead log, which closing empties."""
    log = path.with_name(f"{path.name}-wal")
    return log.is_file() and log.stat().st_size > 0


def _page(head: bytes | bytearray) -> int:
    """Bytes of a page, by the head of a file; 1 stands for 2^16."""
    size = int.from_bytes(head[16:18], "big")
    return 2**16 if size == 1 else max(size, 1)


class SqliteReader:
    """As `rosbags.rosbag1.Reader`. That of rosbags passes over the write-ahead log, and refuses
    files with a type that the recorder knew no definition of.
    """

    table = "messages"

    def __init__(self, path: Path):
        self.path = path

    def open(self) -> None:
        """Open it; what its topics are, and how many messages there are when."""
        self._file = self._connect()
        tables = {name for (name,) in self._file.execute(TABLES)}
        if not {"topics", "messages"} <= tables:
            raise ValueError(f"tables {', '.join(sorted(tables))}, not topics and messages")
        asked = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        definitions = self._file.execute(asked) if "message_definitions" in tables else ()
        said = {name: (form, text) for name, form, text in definitions}
        counted = f"SELECT topic_id, COUNT(*) FROM {self.table} GROUP BY topic_id"
        counts = dict(self._file.execute(counted).fetchall())
        self.connections = []
        topics = self._file.execute("SELECT * FROM topics ORDER BY id")
        names = [column[0] for column in topics.description]
        for row in topics:
            one = dict(zip(names, row, strict=True))
            if not (isinstance(one["name"], str) and isinstance(one["type"], str)):
                raise ValueError(f"topic {one['id']} without a name and a type")
            form, text = said.get(one["type"], ("", ""))  # both may be anything
            definition = MessageDefinition(
                FORMATS.get(form, MessageDefinitionFormat.NONE), str(text)
            )
            digest, count = one.get("type_description_hash", ""), counts.get(one["id"], 0)
            more = (definition, digest, count, one.get("offered_qos_profiles", ""), self)
            self.connections.append(Connection(one["id"], one["name"], one["type"], *more))
        self.message_count = sum(counts.values())
        times = self._file.execute(f"SELECT MIN(timestamp), MAX(timestamp) + 1 FROM {self.table}")
        self.start_time, self.end_time = (int(time_ns or 0) for time_ns in times.fetchone())

    def _connect(self) -> sqlite3.Connection:
        folder = self.path.resolve().parent  # with the log SQLite writes another file beside it
        mode = "mode=ro" if is_open(self.path) and os.access(folder, os.W_OK) else "immutable=1"
        with self.path.open("rb") as file:
            head = file.read(32)
        size = int.from_bytes(head[28:32], "big") * _page(head)
        if mode != "mode=ro" and self.path.stat().st_size < size:  # a log may have the rest
            raise ValueError("a database that is cut off")
        return sqlite3.connect(f"file:{quote(str(self.path.resolve()))}?{mode}", uri=True)

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def messages(self, wanted: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages of some topics in the order of their times."""
        topics = {one.id: one for one in wanted}
        asked = (
            f"SELECT topic_id, timestamp, data FROM {self.table} WHERE topic_id IN"
            f" ({', '.join('?' * len(topics))}) ORDER BY timestamp, id"
        )
        for number, at_ns, data in self._file.execute(asked, list(topics)):
            yield topics[number], int(at_ns), bytes(data)


class DamagedSqliteReader(SqliteReader):
    """As its base of a copy of a file that is cut off or damaged: of the messages it has those from
    both ends of their table up to the first that cannot be read.
    """

    table = "kept"

    def _connect(self) -> sqlite3.Connection:
        self._folder = TemporaryDirectory(prefix="intent_read_")  # removed with this object
        copy = Path(shutil.copyfile(self.path, Path(self._folder.name) / "copy.db3"))
        with copy.open("r+b") as stream:
            head = bytearray(stream.read(32))
            head[18:20] = b"\1\1"  # without a log
            pages = copy.stat().st_size // _page(head)
            head[28:32] = pages.to_bytes(4, "big")  # those that are there
            stream.seek(0)
            stream.write(head)
        name = f"file:{quote(str(copy))}?immutable=1"  # in a transaction an error ends all reading
        file = sqlite3.connect(name, uri=True, isolation_level=None)
        columns = "id, topic_id, timestamp, data"
        file.execute(f"CREATE TEMP TABLE kept ({columns}, PRIMARY KEY (id))")
        for order in ("ASC", "DESC"):
            asked = f"SELECT {columns} FROM messages NOT INDEXED ORDER BY id {order}"
            with suppress(sqlite3.DatabaseError):
                for row in file.execute(asked):
                    file.execute("INSERT OR IGNORE INTO kept VALUES (?, ?, ?, ?)", row)
                break
        return file
