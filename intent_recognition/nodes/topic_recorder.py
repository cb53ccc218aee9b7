# SPDX-License-Identifier: Apache-2.0
"""Base of the nodes that write topics to bags: any topic of any installed type, bit for bit."""

import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy

from intent_recognition.bags import (
    FLUSH_PERIOD_S,
    BagWriter,
    DiskFullError,
    RawMessage,
    rosbag2_profile,
)
from intent_recognition.demonstrations import check_label
from intent_recognition.errors import BagError, IntentError, ResourceBusyError
from intent_recognition.nodes.bag_listener import BagListener
from intent_recognition.nodes.conversions import message_class
from intent_recognition.nodes.diagnostics import PATIENCE_S, Diagnostics, Level
from intent_recognition.nodes.parameters import Changes, keep_live
from intent_recognition.nodes.qos import keep_last
from intent_recognition.nodes.runtime import simulated_ns, steady_timer
from intent_recognition.registry import ANSWERS

ABSOLUTE_TOPICS = ("/clock", "/diagnostics")


@dataclass
class _RecordedTopic:
    """A topic subscribed to: what all its publishers offer, and its last message if latched."""

    name: str
    type: str
    reliable: bool
    latched: bool
    profiles: list[dict]
    last: RawMessage | None = None


class TopicRecorder(Node):
    """Listens to topics all the time and writes them to a bag between `open_bag` and `close_bag`.

    Topics are stored by their name relative to the node's namespace, before remapping, so that a
    bag can be learned from and played under another namespace or other remappings. Log time is the
    time of reception and publish time that of the publisher, both as the middleware gives them;
    with `use_sim_time` both are the simulated time of reception, and nothing is written before the
    clock runs. A bag begins with the last message of each latched topic.

    A subclass calls `listen` once its parameters are known.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._wanted: tuple[str, ...] = ()
        self._sources: dict[str, _RecordedTopic] = {}
        self._writer: BagWriter | None = None
        self._begun = False
        self._lock = threading.RLock()
        self.diagnostics = Diagnostics(self)
        self.diagnostics.status(Level.OK, "idle")
        self._listener = BagListener(
            self, self._on_message, lambda error: self.diagnostics.reject("unexpected", repr(error))
        )

    def listen(self, topics: Sequence[str]) -> None:
        """Subscribe to topics as they appear; if none are given, to all in the namespace.

        Raises:
            BagError: two topics would have the same name in the bag.
        """
        self._check_names(topics)
        self._wanted = tuple(topics)
        keep_live(self, ["task"], check_task, lambda _: None)
        steady_timer(self, 0.1, self.discover)
        steady_timer(self, FLUSH_PERIOD_S, self._flush)
        self.discover()
        self._patience = steady_timer(self, PATIENCE_S, self._warn_of_silent)

    @property
    def listening(self) -> tuple[str, ...]:
        """Resolved names of the topics subscribed to."""
        return tuple(self._sources)

    @property
    def wanted(self) -> tuple[str, ...]:
        """Resolved names of the topics asked for; empty if all are recorded."""
        return tuple(map(self.resolve_topic_name, self._wanted))

    @property
    def recording(self) -> Path | None:
        """The bag being written, None between recordings."""
        return None if self._writer is None else self._writer.path

    def open_bag(self, path: str | Path, metadata: Mapping[str, str]) -> None:
        """Begin to record.

        Raises:
            ResourceBusyError: a recording is under way, or the bag exists.
            BagError: the disk is full.
        """
        if self._writer is not None:
            cure = "Stop it first."
            raise ResourceBusyError.about("~/start", "no recording", self._writer.path, cure)
        with self._lock:
            self._writer = writer = BagWriter(path, dict(metadata))
            for source in self._sources.values():
                self._declare(writer, source)
            self._begun = False
            self._begin(writer)
        self.diagnostics.status(Level.OK, f"recording to {path}")
        self.get_logger().info(f"recording to {path}")

    def close_bag(self, asked_by: str = "~/stop") -> BagWriter:
        """End the recording that a service asked to end; returns its closed writer.

        The bag holds everything received before.

        Raises:
            BagError: nothing is being recorded, or the end did not fit on the disk.
        """
        if self._writer is not None:
            self._listener.catch_up()
        with self._lock:
            writer, self._writer = self._writer, None
            if writer is None:
                raise BagError.about(asked_by, "a recording", "none", "Start one first.")
            self._begin(writer)
            self.diagnostics.status(Level.OK, "idle")
            writer.close()
        self.get_logger().info(f"{writer.message_count} messages in {writer.path}")
        return writer

    def heard(self, message: RawMessage) -> None:
        """Hook that is called with every message, recorded or not."""

    def gave_up(self) -> None:
        """Hook that is called when a full disk has ended the recording."""

    def destroy_node(self) -> None:
        """Close the bag, then the node."""
        if self._writer is not None:
            try:
                self.close_bag()
            except IntentError as error:
                self.get_logger().error(str(error))
        self._listener.close()
        super().destroy_node()

    def discover(self) -> None:
        """Subscribe to topics that have appeared; adapt to publishers that offer less."""
        found = dict(self.get_topic_names_and_types())
        for resolved, stored in self._wanted_topics(found).items():
            types = found.get(resolved, [])
            if len(types) > 1:
                self.diagnostics.reject("ambiguous_type", f"{resolved} has {', '.join(types)}")
            elif types:
                self._follow(resolved, stored, types[0])

    def _warn_of_silent(self) -> None:
        self._patience.cancel()
        silent = sorted(set(self.wanted) - set(self._sources))
        if silent or not (self.wanted or set(self._sources) - set(ABSOLUTE_TOPICS)):
            topics = f"to {', '.join(silent)}" if silent else "anything"
            self.get_logger().warning(f"nobody publishes {topics} yet; what comes is recorded")

    def _check_names(self, topics: Sequence[str]) -> None:
        stored: dict[str, str] = {}
        for topic in topics:
            other = stored.setdefault(self._stored_name(self._expanded(topic)), topic)
            if other != topic:
                cure = "Record one of them, or record both without a namespace."
                found = f"{other} and {topic}"
                raise BagError.about("topics", "names that differ in the bag", found, cure)

    def _wanted_topics(self, found: Iterable[str]) -> dict[str, str]:
        """Stored name of every topic to record, by its resolved name."""
        if self._wanted:
            names = zip(self.wanted, map(self._expanded, self._wanted), strict=True)
            return {resolved: self._stored_name(expanded) for resolved, expanded in names}
        space = self.get_namespace().rstrip("/") + "/"
        hidden = [t for t in found if any(part.startswith("_") for part in t.split("/"))]
        return {
            t: self._stored_name(t)
            for t in found
            if t not in ("/rosout", "/parameter_events")
            and t.rpartition("/")[2] != ANSWERS  # of nodes in any namespace
            and (t.startswith(space) or t in ABSOLUTE_TOPICS)
            and t not in hidden
            and (self.count_publishers(t) or t in self._sources)
        }

    def _expanded(self, topic: str) -> str:
        """Full name of a topic as the user means it, before remapping."""
        return str(self.resolve_topic_name(topic, only_expand=True))

    def _stored_name(self, topic: str) -> str:
        space = self.get_namespace().rstrip("/") + "/"
        return "/" + topic.removeprefix(space).lstrip("/")

    def _follow(self, resolved: str, stored: str, type_name: str) -> None:
        publishers = self.get_publishers_info_by_topic(resolved)
        if not publishers:
            return
        offers = [p.qos_profile for p in publishers]
        reliable = all(o.reliability == QoSReliabilityPolicy.RELIABLE for o in offers)
        latched = all(o.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for o in offers)
        known = self._sources.get(resolved)
        if known is not None and reliable >= known.reliable and latched >= known.latched:
            return
        try:
            kind = message_class(type_name)
        except BagError as error:
            self.diagnostics.reject("unknown_type", str(error))
            return
        profiles = [
            rosbag2_profile(o.reliability.name.lower(), o.durability.name.lower(), o.depth)
            for o in offers
        ]
        with self._lock:
            source = _RecordedTopic(stored, type_name, reliable, latched, profiles)
            self._sources[resolved] = source
            if self._writer is not None:
                self._declare(self._writer, source)
        profile = keep_last(2000, reliable=reliable, latched=latched)
        self._listener.subscribe(resolved, kind, profile)

    def _begin(self, writer: BagWriter) -> None:
        """Write the last message of each latched topic, once the clock runs."""
        if self._begun:
            return
        simulated = simulated_ns(self)
        now_ns = time.time_ns() if simulated is None else simulated
        if now_ns == 0:
            return
        self._begun = True
        for source in self._sources.values():
            if (last := source.last) is not None:
                sent_ns = last.publish_time_ns or now_ns
                self._write(writer, replace(last, log_time_ns=now_ns, publish_time_ns=sent_ns))

    def _on_message(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        now_ns = simulated_ns(self)
        if now_ns is not None:
            received_ns = sent_ns = now_ns
        else:
            received_ns = received_ns or time.time_ns()
            sent_ns = sent_ns or received_ns
        with self._lock:
            source = self._sources[topic]
            message = RawMessage(source.name, source.type, received_ns, sent_ns, data)
            if self._writer is not None:
                self._begin(self._writer)
            if source.latched:
                source.last = message
            elif received_ns == 0 and self._writer is not None:
                self.diagnostics.reject("no_clock", f"{topic}, before /clock")
            if received_ns == 0:
                return
            self.heard(message)
            if self._writer is not None:
                self._write(self._writer, message)

    def _declare(self, writer: BagWriter, source: _RecordedTopic) -> None:
        with self.diagnostics.rejecting("undeclared_topic"):
            writer.add_topic(source.name, source.type, source.profiles)

    def _write(self, writer: BagWriter, message: RawMessage) -> None:
        try:
            writer.write_raw(message)
        except DiskFullError as error:
            self._give_up(error)
        except IntentError as error:
            self.diagnostics.reject("unwritable", str(error))
        else:
            self.diagnostics.tick(message.topic.lstrip("/"))

    def _flush(self) -> None:
        with self._lock:
            if self._writer is None:
                return
            try:
                self._writer.flush()
            except DiskFullError as error:
                self._give_up(error)
            else:
                self.diagnostics.value("messages", self._writer.message_count)

    def _give_up(self, error: DiskFullError) -> None:
        self._writer = None
        self.diagnostics.status(Level.ERROR, str(error))
        self.get_logger().error(str(error))
        self.gave_up()


def check_task(changes: Changes) -> None:
    """Refuse a parameter `task` that cannot name a task; empty means none."""
    if changes["task"]:
        check_label(changes["task"])
