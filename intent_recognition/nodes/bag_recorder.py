# SPDX-License-Identifier: Apache-2.0
"""Record demonstrations and sessions: any topic of any installed type, bit for bit."""

import importlib
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)
from std_srvs.srv import Trigger

from intent_recognition.errors import BagError, IntentError, ResourceBusyError, describe
from intent_recognition.nodes.bag_listener import BagListener
from intent_recognition.nodes.runtime import Diagnostics, parameter, run
from intent_recognition.storage.bag_writer import BagWriter, DiskFullError
from intent_recognition.storage.qos_profiles import rosbag2_profile

DISCOVERY_PERIOD_S = 0.1
FLUSH_PERIOD_S = 0.5
QUEUE_DEPTH = 2000
NOISE_TOPICS = ("/rosout", "/parameter_events")
ABSOLUTE_TOPICS = ("/clock", "/diagnostics")
OK, WARN, ERROR = 0, 1, 2


@dataclass
class _Source:
    """One topic listened to."""

    name: str
    type: str
    reliability: QoSReliabilityPolicy
    durability: QoSDurabilityPolicy
    profiles: list[dict]
    latched: list[tuple[bytes, int]] = field(default_factory=list)


class BagRecorder(Node):
    """Subscribes at once, writes between `~/start` and `~/stop`; starts itself given `output`.

    Topics are stored by their name relative to the node's namespace, so that a bag recorded in
    one namespace trains, and plays in, any other. Log time is the time of reception, publish time
    that of the publisher, both as the middleware gives them. The last message of latched topics
    received before the start is written at the start.
    """

    def __init__(self, **kwargs):
        super().__init__("bag_recorder", **kwargs)
        parameter(self, "output", "", "directory of the new bag; recording starts when it is given")
        parameter(self, "task", "", "label of the demonstration; empty records without a label")
        self._wanted = parameter(
            self, "topics", [], "topics to record; none means all there are in the namespace"
        )
        self._check_names()
        self._sources: dict[str, _Source] = {}
        self._writer: BagWriter | None = None
        self._lock = threading.RLock()
        self.done = False
        self.exit_code = 0
        self._diagnostics = Diagnostics(self)
        self._diagnostics.status(OK, "idle")
        self._listener = BagListener(self, self._on_message, self._on_error)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(Trigger, "~/stop", self._on_stop)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DISCOVERY_PERIOD_S, self.discover, clock=steady)
        self.create_timer(FLUSH_PERIOD_S, self._flush, clock=steady)
        self._autostarted = bool(self.get_parameter("output").value)
        self.discover()
        if self._autostarted:
            self.start()

    @property
    def listening(self) -> tuple[str, ...]:
        """Resolved names of the topics subscribed to."""
        return tuple(self._sources)

    def start(self) -> str:
        """Open the bag named by the parameter `output`; returns its path.

        Raises:
            ResourceBusyError: it is recording already, or the bag exists.
            BagError: no output is given, or the disk is full.
        """
        if self._writer is not None:
            cure = "Stop it first."
            raise ResourceBusyError(describe("~/start", "no recording", self._writer.path, cure))
        output = self.get_parameter("output").value
        task = self.get_parameter("task").value
        if not output:
            cure = "Set the parameter `output`."
            raise BagError(describe("output", "the directory of a new bag", "nothing", cure))
        with self._lock:
            self._writer = BagWriter(output, {"task": task} if task else {})
            for source in self._sources.values():
                self._declare(source)
                for data, sent_ns in source.latched:
                    self._write(source, data, time.time_ns(), sent_ns)
        self._diagnostics.status(OK, f"recording to {output}")
        self.get_logger().info(f"recording to {output}")
        return str(output)

    def stop(self) -> str:
        """Close the bag; returns what was recorded.

        Raises:
            BagError: nothing is being recorded, or the end did not fit on the disk.
        """
        if self._writer is None:
            raise BagError(describe("~/stop", "a recording", "none", "Start one first."))
        with self._lock:
            writer, self._writer = self._writer, None
            self._diagnostics.status(OK, "idle")
            writer.close()
        text = f"{writer.message_count} messages in {writer.path}"
        self.get_logger().info(text)
        return text

    def destroy_node(self) -> None:
        """Close the bag, then the node."""
        self._listener.close()
        if self._writer is not None:
            try:
                self.stop()
            except IntentError as error:
                self.get_logger().error(str(error))
        super().destroy_node()

    def discover(self) -> None:
        """Subscribe to what has appeared; follow publishers that offer less than was asked for."""
        found = dict(self.get_topic_names_and_types())
        for resolved, stored in self._wanted_topics(found).items():
            types = found.get(resolved, [])
            if len(types) > 1:
                self._diagnostics.reject("ambiguous_type", f"{resolved} has {', '.join(types)}")
            elif types:
                self._follow(resolved, stored, types[0])

    def _check_names(self) -> None:
        """Refuse topics that would be one and the same in the bag."""
        stored: dict[str, str] = {}
        for topic in map(self.resolve_topic_name, self._wanted):
            other = stored.setdefault(self._stored_name(topic), topic)
            if other != topic:
                cure = "Record one of them, or record both without a namespace."
                found = f"{other} and {topic}"
                raise BagError(describe("topics", "names that differ in the bag", found, cure))

    def _wanted_topics(self, found: Sequence[str]) -> dict[str, str]:
        """Stored name of every topic to record, by its resolved name."""
        if self._wanted:
            resolved = map(self.resolve_topic_name, self._wanted)
            return {t: self._stored_name(t) for t in resolved}
        space = self.get_namespace().rstrip("/") + "/"
        hidden = [t for t in found if any(part.startswith("_") for part in t.split("/"))]
        return {
            t: self._stored_name(t)
            for t in found
            if t not in NOISE_TOPICS
            and (t.startswith(space) or t in ABSOLUTE_TOPICS)
            and t not in hidden
            and (self.count_publishers(t) or t in self._sources)
        }

    def _stored_name(self, topic: str) -> str:
        space = self.get_namespace().rstrip("/") + "/"
        return "/" + topic.removeprefix(space).lstrip("/")

    def _follow(self, resolved: str, stored: str, type_name: str) -> None:
        publishers = self.get_publishers_info_by_topic(resolved)
        if not publishers:
            return
        offers = [p.qos_profile for p in publishers]
        reliability = _weakest(
            [o.reliability for o in offers],
            QoSReliabilityPolicy.RELIABLE,
            QoSReliabilityPolicy.BEST_EFFORT,
        )
        durability = _weakest(
            [o.durability for o in offers],
            QoSDurabilityPolicy.TRANSIENT_LOCAL,
            QoSDurabilityPolicy.VOLATILE,
        )
        known = self._sources.get(resolved)
        if known is not None:
            weaker = (known.reliability, known.durability) != (reliability, durability)
            if not weaker or _is_stronger(reliability, durability, known):
                return
        self._subscribe(resolved, stored, type_name, reliability, durability, offers)

    def _subscribe(self, resolved, stored, type_name, reliability, durability, offers) -> None:
        try:
            kind = message_type(type_name)
        except BagError as error:
            self._diagnostics.reject("unknown_type", str(error))
            return
        profile = QoSProfile(
            history=QoSHistoryPolicy.KEEP_LAST,
            depth=QUEUE_DEPTH,
            reliability=reliability,
            durability=durability,
        )
        profiles = [
            rosbag2_profile(o.reliability.name.lower(), o.durability.name.lower(), o.depth)
            for o in offers
        ]
        with self._lock:
            source = _Source(stored, type_name, reliability, durability, profiles)
            self._sources[resolved] = source
            if self._writer is not None:
                self._declare(source)
        self._listener.subscribe(resolved, kind, resolved, profile)

    def _on_message(self, resolved: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        received_ns = received_ns or time.time_ns()
        with self._lock:
            source = self._sources[resolved]
            if source.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL:
                source.latched = [(data, sent_ns or received_ns)]
            if self._writer is not None:
                self._write(source, data, received_ns, sent_ns or received_ns)

    def _on_error(self, error: Exception) -> None:
        self._diagnostics.reject("unexpected", repr(error))

    def _declare(self, source: _Source) -> None:
        try:
            self._writer.add_topic(source.name, source.type, source.profiles)
        except IntentError as error:
            self._diagnostics.reject("undeclared_topic", str(error))

    def _write(self, source: _Source, data: bytes, received_ns: int, sent_ns: int) -> None:
        try:
            self._writer.write(source.name, source.type, data, received_ns, sent_ns)
        except DiskFullError as error:
            self._give_up(error)
        except IntentError as error:
            self._diagnostics.reject("unwritable", str(error))
        else:
            self._diagnostics.tick(source.name.lstrip("/"))

    def _flush(self) -> None:
        with self._lock:
            if self._writer is None:
                return
            try:
                self._writer.flush()
            except DiskFullError as error:
                self._give_up(error)
            else:
                self._diagnostics.value("messages", self._writer.message_count)

    def _give_up(self, error: DiskFullError) -> None:
        """Report and stop; what was written is a whole bag."""
        self._writer = None
        self._diagnostics.status(ERROR, str(error))
        self.get_logger().error(str(error))
        if self._autostarted:
            self.exit_code = 1
            self.done = True

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, self.start)

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, self.stop)


def message_type(type_name: str) -> type:
    """The class of "package/msg/Name", of any installed package.

    Raises:
        BagError: the package is not installed or has no such message.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError) as error:
        cure = "Install the package, or source its workspace."
        raise BagError(describe("type", "an installed message type", type_name, cure)) from error


def _weakest(offered, strong, weak):
    return strong if offered and all(policy == strong for policy in offered) else weak


def _is_stronger(reliability, durability, known: _Source) -> bool:
    """Whether every policy asks for at least what the subscription asks for already."""
    return reliability in (known.reliability, QoSReliabilityPolicy.RELIABLE) and durability in (
        known.durability,
        QoSDurabilityPolicy.TRANSIENT_LOCAL,
    )


def _answer(response: Trigger.Response, action) -> Trigger.Response:
    try:
        response.message = action()
        response.success = True
    except IntentError as error:
        response.success = False
        response.message = str(error)
    return response


def main(args: Sequence[str] | None = None) -> int:
    """Run the recorder."""
    return run(BagRecorder, args)
