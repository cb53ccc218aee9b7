# SPDX-License-Identifier: Apache-2.0
"""Read a `.db3` of rosbag2, of any distribution and also one that its recorder never closed."""

import os
import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from urllib.parse import quote

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat

FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
TABLES = "SELECT name FROM sqlite_master WHERE type = 'table'"


def is_open(path: Path) -> bool:
    """Whether messages wait in a write-ahead log, which closing empties."""
    log = path.with_name(f"{path.name}-wal")
    return log.is_file() and log.stat().st_size > 0


class SqliteReader:
    """As `rosbags.rosbag1.Reader`. That of rosbags passes over the write-ahead log, and refuses
    files with a type that the recorder knew no definition of.
    """

    def __init__(self, path: Path):
        self.path = path

    def open(self) -> None:
        """Open it; what its topics are, and how many messages there are when."""
        folder = self.path.resolve().parent  # with the log SQLite writes another file beside it
        mode = "mode=ro" if is_open(self.path) and os.access(folder, os.W_OK) else "immutable=1"
        self._file = sqlite3.connect(f"file:{quote(str(self.path.resolve()))}?{mode}", uri=True)
        tables = {name for (name,) in self._file.execute(TABLES)}
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
                raise ValueError(f"topic {one['id']} without a name and a type")
            form, text = said.get(one["type"], ("", ""))  # both may be anything
            definition = MessageDefinition(
                FORMATS.get(form, MessageDefinitionFormat.NONE), str(text)
            )
            digest, count = one.get("type_description_hash", ""), counts.get(one["id"], 0)
            more = (definition, digest, count, one.get("offered_qos_profiles", ""), self)
            self.connections.append(Connection(one["id"], one["name"], one["type"], *more))
        self.message_count = sum(counts.values())
        times = self._file.execute("SELECT MIN(timestamp), MAX(timestamp) + 1 FROM messages")
        self.start_time, self.end_time = (int(time_ns or 0) for time_ns in times.fetchone())

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def messages(self, wanted: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages of some topics in the order of their times."""
        topics = {one.id: one for one in wanted}
        asked = (
            "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN"
            f" ({', '.join('?' * len(topics))}) ORDER BY timestamp, id"
        )
        for number, at_ns, data in self._file.execute(asked, list(topics)):
            yield topics[number], int(at_ns), bytes(data)
