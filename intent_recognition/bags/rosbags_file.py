# SPDX-License-Identifier: Apache-2.0
"""One file of a recording that is not MCAP: SQLite of ROS 2, or a ROS 1 bag."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path

import numpy as np
from mcap.records import Channel, Schema
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader

from intent_recognition.bags.mcap.chunk import LATEST_NS, McapBlock, MessageTable
from intent_recognition.bags.mcap.file import Item, complete_schemas
from intent_recognition.bags.mcap.scan import Damage, FileScan
from intent_recognition.bags.messages import RECOVER
from intent_recognition.bags.ros1_reader import IndexedReader, UnindexedReader
from intent_recognition.bags.sqlite_reader import DamagedSqliteReader, SqliteReader, is_open
from intent_recognition.errors import BagError, one_line

NOT_CLOSED = "not indexed"
"""The library's error for a ROS 1 bag that was not closed but is otherwise whole."""
RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""ROS 1 types that have another name in ROS 2."""
READERS: dict[bool, tuple[Callable[[Path], Reader | SqliteReader], ...]] = {
    False: (SqliteReader, DamagedSqliteReader),
    True: (IndexedReader, UnindexedReader),
}
"""By whether a bag is of ROS 1: readers for a whole file, and for a truncated or damaged one."""
ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}


class RosbagsFile:
    """A `.db3` or `.bag` file with the methods and attributes of `McapFile`.

    A tolerant reader notes the first damage and continues with the undamaged parts.
    """

    def __init__(self, path: Path, kind: str, *, tolerant: bool, damage: list[Damage]):
        self.path = path
        self._is_ros1 = kind == ".bag"
        self.scan = FileScan(is_finished=self._is_ros1 or not is_open(path))
        self._readers = list(READERS[self._is_ros1])
        self._tolerant, self._damage = tolerant, damage
        self._counts: Counter[int] = Counter()
        self._ids: dict[tuple[int, str], int] = {}
        with self._open() as reader:
            for number, one in enumerate(reader.connections, 1):
                self._define(number, one)
            self.schemas = complete_schemas(self.scan, {})
            if reader.message_count:
                end_ns = reader.end_time - 1  # the library's end is exclusive
                self.scan.blocks.append(McapBlock(0, 0, reader.start_time, end_ns, 0))

    def counts(self) -> Mapping[int, int]:
        """Number of messages by channel."""
        return self._counts

    def tables(self, wanted: Collection[int]) -> Iterator[MessageTable]:
        """See `McapFile.tables`."""
        names = {c.topic.lstrip("/") for c in self.scan.channels.values() if c.id in wanted}
        items = self.items(names)
        while part := list(islice(items, 4096)):
            lengths = np.array([len(item.data) for item in part], np.int64)
            times_ns = np.array([item.log_time_ns for item in part], np.uint64)
            yield MessageTable(
                b"".join(item.data for item in part),
                np.array([item.channel.id for item in part], np.uint16),
                np.zeros(len(part), np.uint32),
                times_ns,
                times_ns,
                np.concatenate([[0], np.cumsum(lengths)[:-1]]),
                lengths,
            )

    def items(self, wanted: set[str] | None) -> Iterator[Item]:
        """See `McapFile.items`."""
        last_ns = given = 0
        with self._open() as reader:
            picked = [
                one
                for one in reader.connections
                if wanted is None or one.topic.lstrip("/") in wanted
            ]
            messages = enumerate(reader.messages(picked) if picked else ())
            while True:
                try:
                    row, (one, last_ns, data) = next(messages)
                except StopIteration:
                    return
                except Exception as error:  # the library may raise anything
                    damage = Damage(0, one_line(error), last_ns)
                    if not self._tolerant:
                        raise self._error(error, last_ns) from error
                    if damage not in self._damage:
                        self._damage.append(damage)
                    if make := self._readers[1:]:
                        self._readers = make
                        yield from islice(self.items(wanted), given, None)
                    return
                if not 0 <= last_ns < LATEST_NS:
                    continue
                channel = self.scan.channels[self._ids[one.id, one.topic]]
                given += 1
                yield Item(last_ns, 0, row, last_ns, 0, bytes(data), channel)

    @contextmanager
    def _open(self) -> Iterator[Reader | SqliteReader]:
        errors: list[Exception] = []
        for make in self._readers:
            try:
                reader = make(self.path)
                reader.open()
                if reader.message_count or not errors:
                    break
            except Exception as error:  # the library may raise anything
                errors.append(error)
        else:
            raise self._error(errors[0], 0) from errors[0]
        if errors:
            self._readers, self.scan.is_finished = [make], False
            if self._tolerant and NOT_CLOSED not in str(errors[0]):
                self._damage.append(Damage(0, one_line(errors[0])))
        try:
            yield reader
        finally:
            with suppress(Exception):
                reader.close()

    def _define(self, number: int, one: Connection) -> None:
        form = "ros1msg" if self._is_ros1 else ENCODINGS.get(one.msgdef.format, "")
        kind = RENAMED.get(one.msgtype, one.msgtype)
        said = Schema(data=one.msgdef.data.encode(), encoding=form, id=number, name=kind)
        self.scan.schemas[number] = said
        more = {"topic_type_hash": one.digest, "offered_qos_profiles": str(one.ext)}
        self.scan.channels[number] = Channel(
            id=number,
            topic=one.topic,
            message_encoding="ros1" if self._is_ros1 else "cdr",
            metadata={} if self._is_ros1 else more,
            schema_id=number,
        )
        self._counts[number] = one.msgcount
        self._ids[one.id, one.topic] = number

    def _error(self, error: Exception, last_ns: int) -> BagError:
        place = f"{self.path}: after {last_ns} ns" if last_ns else str(self.path)
        expected = "a bag of ROS 1" if self._is_ros1 else "a bag in SQLite"
        cure = RECOVER if last_ns else "Record it again."
        return BagError.about(place, expected, one_line(error), cure)
