# SPDX-License-Identifier: Apache-2.0
"""Read a rosbag2 directory with MCAP storage: raw or decoded messages in the order of log time."""

import heapq
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mcap.records import Channel, Message, Schema
from mcap_ros2.decoder import DecoderFactory

from intent_recognition.errors import BagError, MessageError, describe
from intent_recognition.storage.bag_metadata import (
    FILE_NAME,
    BagMetadata,
    TopicInfo,
    parse_qos,
    read_metadata,
)
from intent_recognition.storage.definitions import Definition, definition
from intent_recognition.storage.fast_decode import fast_decoder
from intent_recognition.storage.mcap_scan import (
    PARSE_ERRORS,
    Block,
    Damage,
    Scan,
    open_view,
    read_block,
    scan_file,
)

RECOVER = "Save what is left with `intent recover`."


@dataclass(frozen=True)
class RawMessage:
    """One message as it was recorded; `data` are its CDR bytes."""

    topic: str
    type: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes
    sequence: int = 0


@dataclass(frozen=True)
class BagMessage:
    """One decoded message; `stamp_ns` is its header's stamp, or the log time without a header."""

    topic: str
    type: str
    log_time_ns: int
    stamp_ns: int
    message: object


class BagReader:
    """A recorded bag; holds no file open between calls.

    Args:
        path: bag directory, or a single .mcap file.
        tolerant: go on behind damage instead of raising; `damage` tells what was left out.

    Attributes:
        path: as given.
        metadata: of metadata.yaml, or None when there is none (see `notes`).
        is_finished: False when the recorder was killed.
        damage: places that cannot be read; grows while a tolerant reader reads.
        notes: what is odd but does no harm, as sentences.

    Raises:
        BagError: there is no readable MCAP file, or metadata.yaml is not a bag's.
    """

    def __init__(self, path: str | Path, *, tolerant: bool = False):
        self.path = Path(path)
        self.notes: list[str] = []
        self.damage: list[Damage] = []
        self._tolerant = tolerant
        self.metadata = self._read_metadata()
        self._scans = [(file, scan_file(file)) for file in self._files()]
        self.is_finished = all(scan.is_finished for _, scan in self._scans)
        self.damage.extend(damage for _, scan in self._scans for damage in scan.damage)
        if not self.is_finished:
            self.notes.append("the recording was not closed; up to a second may be missing")

    @property
    def custom_data(self) -> dict[str, str]:
        """Labels of the recording."""
        return dict(self.metadata.custom_data) if self.metadata else {}

    @property
    def task(self) -> str | None:
        """Label of the demonstration, None when it has none."""
        return self.custom_data.get("task") or None

    @property
    def start_ns(self) -> int:
        """Log time of the first message, 0 for an empty bag."""
        return min((b.start_ns for b in self._blocks()), default=0)

    @property
    def end_ns(self) -> int:
        """Log time of the last message, 0 for an empty bag."""
        return max((b.end_ns for b in self._blocks()), default=0)

    @cached_property
    def topics(self) -> dict[str, TopicInfo]:
        """All topics by their recorded name, with message counts."""
        hashes = {t.name: t.type_hash for t in self.metadata.topics} if self.metadata else {}
        topics: dict[str, TopicInfo] = {}
        for file, scan in self._scans:
            counts = self._counts(file, scan)
            for channel in scan.channels.values():
                schema = scan.schemas.get(channel.schema_id)
                before = topics.get(channel.topic)
                topics[channel.topic] = TopicInfo(
                    channel.topic,
                    schema.name if schema else "",
                    counts.get(channel.id, 0) + (before.message_count if before else 0),
                    channel.metadata.get("topic_type_hash") or hashes.get(channel.topic, ""),
                    parse_qos(channel.metadata.get("offered_qos_profiles")),
                )
        return topics

    @property
    def message_count(self) -> int:
        """Messages over all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    def raw_messages(self, topics: Iterable[str] | None = None) -> Iterator[RawMessage]:
        """All messages, or those of `topics`, ordered by log time, then as recorded.

        Raises:
            BagError: damage; names the file, topics and time. Raised when it is reached, so
                that what stands before it has been given out.
        """
        wanted = None if topics is None else {topic.lstrip("/") for topic in topics}
        for file, scan in self._scans:
            for message, channel, schema in self._ordered(file, scan, wanted):
                yield RawMessage(
                    channel.topic,
                    schema.name if schema else "",
                    message.log_time,
                    message.publish_time,
                    message.data,
                    message.sequence,
                )
            if scan.damage and not self._tolerant:
                raise self._damaged(file, scan, scan.damage[0])

    def messages(self, topics: Iterable[str] | None = None) -> Iterator[BagMessage]:
        """Decoded messages in the same order, of any type the bag defines.

        Raises:
            BagError: damage, as in `raw_messages`.
            MessageError: a message cannot be decoded with the definition in the bag.
        """
        decoders: dict[tuple[str, str], Callable[[bytes], object]] = {}
        for raw in self.raw_messages(topics):
            key = (raw.topic, raw.type)
            if key not in decoders:
                decoders[key] = self.decoder(*key)
            yield decode(raw, decoders[key])

    def decoder(self, topic: str, type_name: str) -> Callable[[bytes], object]:
        """Function from CDR bytes to a message with the attributes of its type.

        Raises:
            MessageError: the definition in the bag cannot be used.
        """
        try:
            for _, scan in self._scans:
                for schema in scan.schemas.values():
                    if schema.name == type_name:
                        found = DecoderFactory().decoder_for("cdr", schema)
                        if found is not None:
                            standard = schema.data.decode() == _jazzy_text(type_name)
                            return fast_decoder(type_name, found) if standard else found
        except Exception as error:  # the parser of definitions raises what it meets
            raise self._no_decoder(topic, type_name, error) from error
        raise self._no_decoder(topic, type_name, "no ros2msg definition of it")

    def definition_of(self, topic: str) -> Definition | None:
        """The definition the bag itself holds of a topic's type, None when it holds none."""
        for _, scan in self._scans:
            for channel in scan.channels.values():
                schema = scan.schemas.get(channel.schema_id)
                if channel.topic == topic and schema is not None:
                    text = schema.data.decode(errors="replace")
                    return Definition(
                        schema.name, text, self.topics[topic].type_hash, schema.encoding
                    )
        return None

    def _no_decoder(self, topic: str, type_name: str, error: object) -> MessageError:
        expected = f"a usable definition of {type_name or 'its type'}"
        return MessageError(describe(f"{self.path}: topic {topic}", expected, error, RECOVER))

    def _read_metadata(self) -> BagMetadata | None:
        if not self.path.exists():
            raise BagError(describe(str(self.path), "a bag", "nothing there", "Check the path."))
        if self.path.is_file():
            return None
        try:
            metadata = read_metadata(self.path)
        except BagError as error:
            if not any(self.path.glob("*.mcap")):
                cure = "Record with MCAP storage (`ros2 bag record -s mcap`)."
                raise BagError(describe(str(self.path), "a bag", error, cure)) from error
            if (self.path / FILE_NAME).exists() and not self._tolerant:
                raise
            self.notes.append(f"no usable {FILE_NAME}: no labels")
            return None
        if metadata.storage != "mcap" or metadata.compression:
            got = f"storage {metadata.storage} {metadata.compression}".strip()
            cure = "Convert it: `ros2 bag convert` to storage_id mcap without compression."
            raise BagError(describe(str(self.path), "uncompressed MCAP storage", got, cure))
        return metadata

    def _files(self) -> list[Path]:
        if self.path.is_file():
            return [self.path]
        if self.metadata is None or not self.metadata.files:
            files = sorted(self.path.glob("*.mcap"))
        else:
            files = [self.path / name for name in self.metadata.files]
        missing = [file.name for file in files if not file.is_file()]
        if self._tolerant and missing:
            self.notes.append(f"missing: {', '.join(missing)}")
            files = [file for file in files if file.is_file()] or sorted(self.path.glob("*.mcap"))
            missing = []
        if missing or not files:
            cure = "Copy the whole directory of the bag."
            got = f"no {', '.join(missing) or '.mcap file'}"
            raise BagError(describe(str(self.path), "the files of the bag", got, cure))
        return files

    def _blocks(self) -> Iterator[Block]:
        return (block for _, scan in self._scans for block in scan.blocks)

    def _counts(self, file: Path, scan: Scan) -> dict[int, int]:
        """Messages per channel; counted when the summary does not say."""
        if scan.statistics and not scan.damage:
            return dict(scan.statistics.channel_message_counts)
        counts: Counter[int] = Counter()
        with open_view(file) as view:
            for block in scan.blocks:
                try:
                    records = read_block(view, block)
                except PARSE_ERRORS:
                    continue
                counts.update(r.channel_id for r in records if isinstance(r, Message))
        return counts

    def _ordered(
        self, file: Path, scan: Scan, wanted: set[str] | None
    ) -> Iterator[tuple[Message, Channel, Schema | None]]:
        """Merge blocks that overlap in time; only those are in memory at once."""
        waiting: list[tuple[int, int, int, Message, Channel]] = []
        with open_view(file) as view:
            for block in sorted(self._usable(scan), key=lambda b: (b.start_ns, b.offset)):
                while waiting and waiting[0][0] < block.start_ns:
                    *_, message, channel = heapq.heappop(waiting)
                    yield message, channel, scan.schemas.get(channel.schema_id)
                for i, message in enumerate(self._block_messages(view, file, scan, block)):
                    channel = self._channel(file, scan, block, message)
                    if channel and (wanted is None or channel.topic.lstrip("/") in wanted):
                        item = (message.log_time, block.offset, i, message, channel)
                        heapq.heappush(waiting, item)
            while waiting:
                *_, message, channel = heapq.heappop(waiting)
                yield message, channel, scan.schemas.get(channel.schema_id)

    def _usable(self, scan: Scan) -> list[Block]:
        """All blocks; a reader that is not tolerant stops at the first damage."""
        if self._tolerant or not scan.damage:
            return scan.blocks
        return [b for b in scan.blocks if b.offset < scan.damage[0].offset and not b.is_cut]

    def _block_messages(self, view, file: Path, scan: Scan, block: Block) -> list[Message]:
        try:
            found = [r for r in read_block(view, block) if isinstance(r, Message)]
            if any(not block.start_ns <= m.log_time <= block.end_ns for m in found):
                raise ValueError("times of the chunk and of its messages disagree")
        except PARSE_ERRORS as error:
            damage = Damage(block.offset, str(error), block.start_ns, block.end_ns)
            if not self._tolerant:
                raise self._damaged(file, scan, damage) from error
            if damage not in self.damage:
                self.damage.append(damage)
            return []
        return found

    def _channel(self, file: Path, scan: Scan, block: Block, message: Message) -> Channel | None:
        channel = scan.channels.get(message.channel_id)
        if channel is None:
            reason = f"nothing tells the topic of channel {message.channel_id}"
            damage = Damage(block.offset, reason, block.start_ns, block.end_ns)
            if not self._tolerant:
                raise self._damaged(file, scan, damage)
            if damage not in self.damage:
                self.damage.append(damage)
        return channel

    def _damaged(self, file: Path, scan: Scan, damage: Damage) -> BagError:
        topics = ", ".join(sorted(c.topic for c in scan.channels.values())) or "unknown"
        until = f" to {damage.end_ns}" if damage.end_ns else ""
        place = f"{file}: topics {topics}: time {damage.start_ns}{until} ns: byte {damage.offset}"
        return BagError(describe(place, "a whole recording", damage.reason, RECOVER))


def _jazzy_text(type_name: str) -> str | None:
    try:
        return definition(type_name).text
    except MessageError:
        return None


def decode(raw: RawMessage, decoder: Callable[[bytes], object]) -> BagMessage:
    """Decode one raw message.

    Raises:
        MessageError: the bytes do not fit the type; names topic and time.
    """
    try:
        message = decoder(raw.data)
    except Exception as error:  # the decoder raises what struct, numpy and utf-8 raise
        place = f"topic {raw.topic} at {raw.log_time_ns} ns"
        raise MessageError(describe(place, f"a {raw.type}", error, RECOVER)) from error
    return BagMessage(raw.topic, raw.type, raw.log_time_ns, stamp_of(message, raw), message)


def stamp_of(message: object, raw: RawMessage) -> int:
    """Stamp of the header in nanoseconds; the log time for a type without header."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return raw.log_time_ns
    return stamp.sec * 1_000_000_000 + stamp.nanosec
