# SPDX-License-Identifier: Apache-2.0
"""Write a rosbag2 directory with MCAP storage; a killed recorder loses less than a second."""

from __future__ import annotations

import contextlib
import errno
import math
import operator
import os
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, TypeVar, cast

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import Writer

from intent_recognition.bags.definitions import Definition, definition, serialize
from intent_recognition.bags.mcap.chunk import CHUNK_BYTES
from intent_recognition.bags.messages import RawMessage
from intent_recognition.bags.metadata import (
    RECORD_KEY,
    RECORD_NAME,
    BagMetadata,
    TopicInfo,
    dump_metadata,
    dump_yaml,
    write_metadata,
)
from intent_recognition.errors import ArgumentError, BagError, ResourceBusyError, as_path, one_line

FLUSH_PERIOD_S = 0.5
"""Longest time a message stays in memory [s], so that a killed recorder loses less than 1 s."""
Result = TypeVar("Result")


class DiskFullError(BagError):
    """The disk is full, nearly full or gone; the bag keeps everything written before."""


class BagWriter:
    """Writes a rosbag2 recording with MCAP storage into a new directory, without ROS.

    Use it as a context manager, or call `close`. Every `flush_period_s` the current chunk is
    compressed and handed to the operating system, and every two seconds metadata.yaml is updated,
    so that rosbag2's tools can read what a killed recorder leaves. With `flush_period_s=None`
    chunks end by size alone, so that equal input gives equal files. Definitions are also written
    outside of the chunks: a damaged chunk makes no other unreadable. Labels are repeated in the
    MCAP file, where `ros2 bag reindex` finds them. Recording stops and the bag is closed when less
    than `min_free_bytes` is left on the disk.

    Raises:
        ResourceBusyError: the directory exists already or cannot be made.
        DiskFullError: there is too little space to begin.
    """

    def __init__(
        self,
        path: str | Path,
        custom_data: Mapping[str, str] | None = None,
        *,
        flush_period_s: float | None = FLUSH_PERIOD_S,
        min_free_bytes: int = 16 * 2**20,
        clock: Callable[[], float] = time.monotonic,
        disk_usage: Callable[[Path], Any] = shutil.disk_usage,
    ):
        self.path = as_path("path", path)
        self.custom_data = {str(k): str(v) for k, v in (custom_data or {}).items()}
        self._flush_period_s = flush_period_s
        self._min_free_bytes = min_free_bytes
        self._clock = clock
        self._disk_usage = disk_usage
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, str], int] = {}
        self._topics: dict[str, TopicInfo] = {}
        self._counts: dict[str, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._pending = 0
        self._pending_bytes = 0
        self._described_s = -math.inf
        self.closed = True
        self._open()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def message_count(self) -> int:
        """Number of messages of all topics written so far."""
        return sum(self._counts.values())

    def add_topic(
        self,
        topic: str,
        type_name: str,
        qos: Sequence[Mapping] = (),
        found: Definition | None = None,
    ) -> str:
        """Declare a topic and return its absolute name; `write` declares topics without QoS.

        The definition of the type "package/msg/Name" is looked up when not given. `qos` holds the
        publishers' profiles in rosbag2's form.

        Raises:
            MessageError: the type is unknown.
            BagError: the topic was declared with another type.
        """
        name = "/" + topic.lstrip("/")
        known = self._topics.get(name)
        if known is None:
            found = found or definition(type_name)
            self._topics[name] = TopicInfo(name, type_name, 0, found.type_hash, tuple(qos))
            self._counts[name] = 0
            self._register(name, found, qos)
        elif known.type != type_name:
            cure = "Record the two under different names."
            raise BagError.about(f"topic {name}", f"type {known.type}", type_name, cure)
        return name

    def write(
        self,
        topic: str,
        type_name: str,
        data: bytes,
        log_time_ns: int,
        publish_time_ns: int | None = None,
        *,
        sequence: int = 0,
    ) -> None:
        """Append one serialized message unchanged; arguments as in `RawMessage`.

        Raises:
            DiskFullError: the disk is nearly full; the bag has been closed and is complete.
            BagError: the bag is closed, or the topic has another type.
            ArgumentError: a time is no whole number from 0 to 2^64 - 1.
        """
        if self.closed:
            raise BagError.about(str(self.path), "an open bag", "a closed one", "Start anew.")
        log_time_ns = _checked_ns("log_time_ns", log_time_ns)
        sent = log_time_ns
        if publish_time_ns is not None:
            sent = _checked_ns("publish_time_ns", publish_time_ns)
        known = self._topics.get(topic)
        name = topic if known and known.type == type_name else self.add_topic(topic, type_name)
        self._guard(
            lambda: self._writer.add_message(
                self._channels[name], log_time_ns, data, sent, sequence
            )
        )
        self._counts[name] += 1
        self._first_ns = log_time_ns if self._first_ns is None else min(self._first_ns, log_time_ns)
        self._last_ns = max(self._last_ns, log_time_ns)
        self._pending += 1
        self._pending_bytes += len(data)
        self._flush_when_due()

    def write_raw(self, message: RawMessage) -> None:
        """Append a raw message; raises the errors of `write`."""
        at_ns = message.log_time_ns, message.publish_time_ns
        self.write(message.topic, message.type, message.data, *at_ns, sequence=message.sequence)

    def write_message(self, topic: str, type_name: str, message: object, log_time_ns: int) -> None:
        """Serialize and append a message, without ROS.

        `message` is an object of rosbags' Jazzy type store or a nested mapping of fields, in which
        missing fields are zero and times are integer nanoseconds.

        Raises:
            MessageError: the message does not fit the type.
        """
        self.write(topic, type_name, serialize(type_name, message), log_time_ns)

    def flush(self) -> None:
        """Hand everything written so far to the operating system.

        Raises:
            DiskFullError: the disk is nearly full; the bag has been closed and is complete.
        """
        if self.closed:
            return
        self._guard(self._writer.flush)
        self._flushed_s = self._clock()
        if self._pending and self._flushed_s - self._described_s >= 2.0:  # writing takes 10 ms
            self._guard(self._write_metadata)
            self._described_s = self._flushed_s
        self._pending = self._pending_bytes = 0
        self._check_disk()

    def close(self) -> None:
        """Finish the file and write metadata.yaml; a second call does nothing.

        Raises:
            DiskFullError: the end of the file did not fit on the disk; everything flushed before
                stays readable.
        """
        if self.closed:
            return
        self._guard(self._writer.finish)
        self._pending = 0
        self._stream.close()
        self._guard(self._write_metadata)
        self.closed = True

    def _open(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.mkdir()
        except OSError as error:
            cure = "Choose another output; existing recordings are never overwritten."
            there = isinstance(error, FileExistsError)
            got = f"{error.filename}, which exists" if there else error
            expected = "a directory that can be made"
            raise ResourceBusyError.about("output", expected, got, cure) from error
        try:
            self._check_disk()
            path = self.path / f"{self.path.name}_0.mcap"
            self._stream = self._guard(lambda: _SafeStream(path))
        except DiskFullError:
            self.path.rmdir()
            raise
        self.closed = False
        self._writer = Writer(cast(IO[bytes], self._stream), chunk_size=CHUNK_BYTES)
        self._guard(lambda: self._writer.start("ros2", "intent_recognition"))
        self._flushed_s = self._clock()
        self._guard(self._write_metadata)
        labels = {RECORD_KEY: dump_metadata(self._metadata())}
        self._guard(lambda: self._writer.add_metadata(RECORD_NAME, labels))

    def _register(self, name: str, found: Definition, qos: Sequence[Mapping]) -> None:
        """Write schema and channel in the current chunk and again outside of it."""
        builder = RecordBuilder()
        text, encoding = found.text.encode(errors="surrogateescape"), found.encoding
        key, number = (found.type, encoding), 0
        if encoding:
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(found.type, encoding, text)
            number = self._schemas[key]
            Schema(data=text, encoding=encoding, id=number, name=found.type).write(builder)
        metadata = {
            "offered_qos_profiles": dump_yaml([dict(p) for p in qos]).strip(),
            "topic_type_hash": self._topics[name].type_hash,
        }
        channel = self._writer.register_channel(name, found.messages, number, metadata)
        Channel(channel, name, found.messages, metadata, number).write(builder)
        self._channels[name] = channel
        self._guard(self._writer.flush)
        self._guard(lambda: self._stream.write(builder.end()))

    def _flush_when_due(self) -> None:
        if self._flush_period_s is not None and (
            self._clock() - self._flushed_s >= self._flush_period_s
        ):
            self.flush()
        elif self._pending_bytes >= CHUNK_BYTES:
            self._pending = self._pending_bytes = 0
            self._check_disk()

    def _check_disk(self) -> None:
        free = self._guard(lambda: self._disk_usage(self.path).free)
        if free < self._min_free_bytes:
            self.close()
            need = f"at least {self._min_free_bytes / 2**20:.0f} MiB free"
            cure = f"Free space. All {self.message_count} messages received until now are saved."
            raise DiskFullError.about(str(self.path), need, f"{free / 2**20:.1f} MiB", cure)

    def _guard(self, action: Callable[[], Result]) -> Result:
        """Run a disk operation; if it fails, close the bag and leave a readable file."""
        try:
            return action()
        except OSError as error:
            if not self.closed:
                self._stream.close()
            self.closed = True
            expected, cure = "a writable directory", "Choose another output, record again."
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                expected, cure = "room on the disk", "Free space, record again."
            got = f"{one_line(error)}; the last {self._pending} messages are lost"
            raise DiskFullError.about(str(self.path), expected, got, cure) from error

    def _write_metadata(self) -> None:
        write_metadata(self.path, self._metadata())

    def _metadata(self) -> BagMetadata:
        start = self._first_ns or 0
        topics = tuple(
            TopicInfo(t.name, t.type, self._counts[t.name], t.type_hash, t.offered_qos_profiles)
            for t in self._topics.values()
        )
        return BagMetadata(
            files=(f"{self.path.name}_0.mcap",),  # as rosbag2 names it
            start_ns=start,
            duration_ns=max(0, self._last_ns - start),
            topics=topics,
            custom_data=self.custom_data,
        )


class _SafeStream:
    """An unbuffered file that a failing write leaves unchanged."""

    def __init__(self, path: Path):
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._position = 0

    def tell(self) -> int:
        """Number of bytes written."""
        return self._position

    def flush(self) -> None:
        """Do nothing, since writes are unbuffered."""

    def write(self, data: bytes) -> int:
        """Write all of `data`, or nothing and raise OSError."""
        view = memoryview(data)
        done = 0
        try:
            while done < len(view):
                done += os.write(self._descriptor, view[done:])
        except OSError:
            os.ftruncate(self._descriptor, self._position)
            raise
        self._position += done
        return done

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):  # pipes and some network drives cannot sync
                os.fsync(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = -1


def _checked_ns(name: str, stamp_ns: int) -> int:
    """An MCAP timestamp as a Python integer; numpy integers are converted."""
    try:
        whole = operator.index(stamp_ns)
    except TypeError:
        whole = -1
    if not 0 <= whole < 2**64:
        cure = "Give nanoseconds since 1970, as an integer."
        raise ArgumentError.about(name, "an integer from 0 to 2^64 - 1", stamp_ns, cure)
    return whole
