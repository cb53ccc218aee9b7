# SPDX-License-Identifier: Apache-2.0
"""Read a recording of ROS 2 or ROS 1: raw or decoded messages in the order of log time."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from heapq import merge
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.records import Channel, Schema

from intent_recognition.bags.cdr.columns import Columns, ColumnsBuilder
from intent_recognition.bags.definitions import Definition
from intent_recognition.bags.files import (
    PACKED,
    find_files,
    find_metadata,
    is_bag,
    kind_of,
    storage_files,
    unpack,
)
from intent_recognition.bags.mcap.file import Item, McapFile
from intent_recognition.bags.mcap.scan import Damage
from intent_recognition.bags.messages import (
    RECOVER,
    ROS_ENCODINGS,
    BagMessage,
    Decoder,
    RawMessage,
    converter,
    decode,
    is_standard,
    schema_decoder,
)
from intent_recognition.bags.metadata import (
    FILE_NAME,
    RECORD_KEY,
    RECORD_NAME,
    TopicInfo,
    parse_custom_data,
    parse_qos,
)
from intent_recognition.bags.rosbags_file import RosbagsFile
from intent_recognition.errors import BagError, MessageError, as_path, one_line


class BagReader:
    """Reads a rosbag2 recording (MCAP or SQLite) or a ROS 1 bag without ROS.

    Messages are ordered by log time: raw (`raw_messages`), decoded (`messages`) or, for PoseStamped
    and JointState, as arrays (`columns`), which is ten times as fast as decoding one by one. Files
    whose times do not overlap keep their own order. No file stays open between calls.

    Args:
        path: bag directory or single file, which may be compressed by zstd or gzip.
        tolerant: skip damaged parts instead of raising; `damage` lists them.

    Attributes:
        path: as given.
        metadata: content of metadata.yaml, None without that file (see `notes`).
        is_finished: False when the recorder was killed.
        damage: parts that cannot be read; the list grows while a tolerant reader reads.
        notes: harmless oddities, as sentences.

    Raises:
        BagError: no file can be read, or metadata.yaml does not describe a bag.
    """

    def __init__(self, path: str | Path, *, tolerant: bool = False):
        self.path = as_path("path", path)
        self.notes: list[str] = []
        self.damage: list[Damage] = []
        self._tolerant = tolerant
        self._unpacked: TemporaryDirectory[str] | None = None
        self.metadata, notes = find_metadata(self.path, tolerant=tolerant)
        files, more, renamed = find_files(self.path, self.metadata, tolerant=tolerant)
        self.notes.extend([*notes, *more])
        said = {t.name: t.type for t in self.metadata.topics} if self.metadata else {}
        self._files = [self._file(f, said) for f in files]
        said_ns = self.metadata.start_ns if self.metadata else 0
        if renamed and not tolerant and said_ns not in (0, self.start_ns):
            got, cure = f"files that do not fit {FILE_NAME}", "Copy the whole directory of the bag."
            raise BagError.about(str(self.path), "the files of the bag", got, cure)
        self._groups = _overlapping(self._files)
        self.is_finished = all(file.scan.is_finished for file in self._files)
        if not self.is_finished:
            self.notes.append("the recording was not closed; its end may be missing")

    def _file(self, path: Path, types: Mapping[str, str]) -> McapFile | RosbagsFile:
        """Open a file by its kind; a compressed one is unpacked until the reader is deleted."""
        if kind_of(path) in PACKED:
            self._unpacked = self._unpacked or TemporaryDirectory(prefix="intent_bag_")
            path = unpack(path, Path(self._unpacked.name))
        if (kind := kind_of(path)) in (".db3", ".bag"):
            return RosbagsFile(path, kind, tolerant=self._tolerant, damage=self.damage)
        return McapFile(path, tolerant=self._tolerant, damage=self.damage, types=types)

    @property
    def custom_data(self) -> dict[str, str]:
        """Texts that the recorder stored with the bag, by key, read from metadata.yaml or else from
        the last MCAP file.
        """
        if self.metadata is not None:
            return dict(self.metadata.custom_data)
        texts = [file.scan.metadata.get(RECORD_NAME, {}).get(RECORD_KEY) for file in self._files]
        return parse_custom_data(texts[-1] or "{}")

    @property
    def start_ns(self) -> int:
        """Log time of the first message, 0 for an empty bag."""
        return min((f.scan.span_ns[0] for f in self._files if f.scan.blocks), default=0)

    @property
    def end_ns(self) -> int:
        """Log time of the last message, 0 for an empty bag."""
        return max((f.scan.span_ns[1] for f in self._files), default=0)

    @cached_property
    def topics(self) -> dict[str, TopicInfo]:
        """All topics by recorded name, with message counts and QoS profiles."""
        said = {t.name: t for t in self.metadata.topics} if self.metadata else {}
        topics: dict[str, TopicInfo] = {}
        for file in self._files:
            counts = file.counts()
            for channel in file.scan.channels.values():
                schema = file.schemas[channel.id]
                before = topics.get(channel.topic)
                known = said.get(channel.topic) or TopicInfo(channel.topic, "")
                topics[channel.topic] = TopicInfo(
                    channel.topic,
                    schema.name if schema else "",
                    counts.get(channel.id, 0) + (before.message_count if before else 0),
                    channel.metadata.get("topic_type_hash") or known.type_hash,
                    known.offered_qos_profiles
                    or parse_qos(channel.metadata.get("offered_qos_profiles")),
                )
        return topics

    @property
    def message_count(self) -> int:
        """Number of messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    def raw_messages(self, topics: Iterable[str] | None = None) -> Iterator[RawMessage]:
        """All messages, or those of `topics`, ordered by log time, ties in recorded order.

        Raises:
            BagError: the file is damaged; the message names file, topics and time. It is raised
                after all messages before the damage.
        """
        wanted = None if topics is None else {topic.lstrip("/") for topic in topics}
        for group in self._groups:
            streams = [self._of_file(file, wanted) for file in group]
            merged = merge(*streams, key=itemgetter(0))
            yield from (message for _, message in merged if message is not None)

    def _of_file(
        self, file: McapFile | RosbagsFile, wanted: set[str] | None
    ) -> Iterator[tuple[int, RawMessage | None]]:
        """Log times and messages of a file. The first pair has the file's start time and no
        message, so that a merge does not read the file, or meet its damage, before that time.
        """
        converters = {
            c.id: converter(c.message_encoding, file.scan.schemas.get(c.schema_id))
            for c in file.scan.channels.values()
        }
        yield file.scan.span_ns[0], None
        for item in file.items(wanted):
            schema = file.schemas[item.channel.id]
            data = self._converted(item, converters[item.channel.id])
            if data is None:
                continue
            kind, at_ns = schema.name if schema else "", item.log_time_ns
            about = (item.channel.topic, kind, at_ns, item.publish_time_ns)
            yield at_ns, RawMessage(*about, data, item.sequence)

    def _converted(self, item: Item, convert: Callable[[bytes], bytes]) -> bytes | None:
        """A message as CDR bytes; None for a damaged message if the reader is tolerant."""
        try:
            return convert(item.data)
        except Exception as error:  # rosbags and zstd may raise anything
            place = f"{self.path}: topic {item.channel.topic} at {item.log_time_ns} ns"
            damage = Damage(item.offset, f"{place}: {one_line(error)}", item.log_time_ns)
            if not self._tolerant:
                raise MessageError.about(place, "a message", error, RECOVER) from error
            if damage not in self.damage:
                self.damage.append(damage)
            return None

    def columns(self, topics: Iterable[str]) -> dict[str, Columns | None]:
        """All messages of some topics as arrays, for PoseStamped and JointState.

        The values are those of `messages`, bit for bit, in the same order.

        Returns:
            By topic name without leading slash: `PoseColumns`, `JointColumns`, or None for a topic
            that must be read with `messages` because of another type or definition, big endian,
            more than 16 layouts, or bytes that do not fit the type.

        Raises:
            BagError: the file is damaged.
        """
        names = dict.fromkeys(topic.lstrip("/") for topic in topics)
        builders = {name: self._builder(name) for name in names}
        numbered = [(number, file) for number, group in enumerate(self._groups) for file in group]
        for number, file in numbered:
            ids = {
                name: file.scan.channel_ids(name) for name, builder in builders.items() if builder
            }
            wanted = [i for own in ids.values() for i in own]
            for table in file.tables(wanted) if wanted else ():
                for name, own in ids.items():
                    builder, part = builders[name], table
                    if len(own) < len(wanted):
                        part = table.rows(np.flatnonzero(np.isin(table.channels, own)))
                    if builder and part.starts.size and not builder.add(number, part):
                        builders[name] = None
        return {name: builder.columns() if builder else None for name, builder in builders.items()}

    def messages(self, topics: Iterable[str] | None = None) -> Iterator[BagMessage]:
        """Decoded messages of any type the bag defines, in the order of `raw_messages`.

        Raises:
            BagError: the file is damaged, as in `raw_messages`.
            MessageError: a message cannot be decoded with the definition in the bag.
        """
        decoders: dict[tuple[str, str], Decoder] = {}
        for raw in self.raw_messages(topics):
            key = (raw.topic, raw.type)
            if key not in decoders:
                decoders[key] = self.decoder(*key)
            yield decode(raw, decoders[key])

    def decoder(self, topic: str, type_name: str) -> Decoder:
        """Function from CDR bytes to a message with the attributes of its type.

        Raises:
            MessageError: the definition in the bag cannot be used.
        """
        why, cure = "no ros2msg definition of it", RECOVER
        try:
            for channel, schema in self._defined():
                if channel.topic != topic or schema.name != type_name:
                    continue
                if channel.message_encoding not in ROS_ENCODINGS:
                    why, cure = f"messages in {channel.message_encoding}", "Record it from ROS."
                elif found := schema_decoder(schema):
                    return found
        except Exception as error:  # the definition parser may raise anything
            raise self._no_decoder(topic, type_name, error) from error
        raise self._no_decoder(topic, type_name, why, cure)

    def definition_of(self, topic: str) -> Definition | None:
        """The bag's own definition of a topic's type, None if it has none."""
        for channel, one in self._defined():
            if channel.topic == topic:
                text = one.data.decode(errors="surrogateescape")
                said = channel.message_encoding
                messages = "cdr" if said in ROS_ENCODINGS else said
                type_hash = self.topics[topic].type_hash
                return Definition(one.name, text, type_hash, one.encoding, messages)
        return None

    def _defined(self) -> Iterator[tuple[Channel, Schema]]:
        """Channels with the definitions of their types.

        A channel without definition is left out, unless its encoding needs none.
        """
        for file in self._files:
            for channel in file.scan.channels.values():
                schema = file.schemas[channel.id]
                if schema is None and channel.message_encoding not in ROS_ENCODINGS:
                    schema = Schema(id=0, data=b"", encoding="", name="")
                if schema is not None:
                    yield channel, schema

    def _no_decoder(
        self, topic: str, type_name: str, error: object, cure: str = RECOVER
    ) -> MessageError:
        expected = f"a usable definition of {type_name or 'its type'}"
        return MessageError.about(f"{self.path}: topic {topic}", expected, error, cure)

    def _builder(self, name: str) -> ColumnsBuilder | None:
        """Builder for the columns of a topic, None unless all its files have one type."""
        types = set()
        for file in self._files:
            for number in file.scan.channel_ids(name):
                schema = file.schemas[number]
                is_ros1 = file.scan.channels[number].message_encoding == "ros1"
                types.add(schema.name if schema and is_standard(schema) and not is_ros1 else "")
        return ColumnsBuilder(types.pop()) if len(types) == 1 else None


def _overlapping(files: Iterable[McapFile | RosbagsFile]) -> list[list[McapFile | RosbagsFile]]:
    """Group successive files that overlap in time, in their order."""
    groups: list[list[McapFile | RosbagsFile]] = []
    first_ns, last_ns = 0, -1
    for file in files:
        start_ns, end_ns = file.scan.span_ns
        if groups and start_ns <= last_ns and end_ns >= first_ns:
            groups[-1].append(file)
            first_ns, last_ns = min(first_ns, start_ns), max(last_ns, end_ns)
        else:
            groups.append([file])
            first_ns, last_ns = start_ns, end_ns
    return groups


SPLIT_NS = (-100_000_000, 1_000_000_000)
"""Accepted gap from the end of one file to the start of the next one of a recording [ns]: rosbag2
continues with the next message, whereas starting a new recording takes longer."""


def recordings_in(folder: Path) -> list[Path]:
    """The folder itself if it is one ROS 2 bag, else its files, each a recording of its own.

    Without metadata.yaml, numbered files are one bag if each continues the one before. A killed
    recorder may leave the last file empty or without messages.
    """
    files = storage_files(folder)
    if not is_bag(folder):
        return files
    if len(files) > 1 and not (folder / FILE_NAME).exists():
        try:
            some = [file for file in files if file.stat().st_size]
            parts = [part for file in some if (part := BagReader(file, tolerant=True)).end_ns]
        except BagError:
            return files
        gaps = [after.start_ns - part.end_ns for part, after in pairwise(parts)]
        if not all(SPLIT_NS[0] <= gap <= SPLIT_NS[1] for gap in gaps):
            return files
    return [folder]
