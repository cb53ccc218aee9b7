# SPDX-License-Identifier: Apache-2.0
"""Node: plays a bag, with the recorded bytes on the recorded topics at the recorded times."""

import gc
import struct
import threading
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock

from intent_recognition.bags import BagReader, RawMessage, TopicInfo
from intent_recognition.demonstrations import STAMPED_ELEMENTS, clock_shift_ns
from intent_recognition.errors import BagError, one_line
from intent_recognition.nodes.conversions import message_class, stamp_ns, to_stamp
from intent_recognition.nodes.diagnostics import Diagnostics, Level, Readiness
from intent_recognition.nodes.parameters import Changes, declare, keep_live, live_parameters
from intent_recognition.nodes.qos import recorded_profile
from intent_recognition.nodes.runtime import now_ns, run
from intent_recognition.nodes.services import serve


class _Anchor(NamedTuple):
    """A recorded time [ns], and when it is played by monotonic [s] and the node's clock [ns]."""

    log_ns: int
    played_s: float
    stamp_ns: int


class BagPlayer(Node):
    """Publishes a bag from its own thread, on an absolute schedule so that delays do not add up.

    Topic names are taken as relative, so that namespace and remapping apply. The player first
    waits until the nodes in `wait_for_nodes` are ready, however long that takes. Then it waits at
    most `wait_for_subscribers` seconds: until every played topic has a subscriber or, if only some
    have one, until their number has not changed for a second. It starts 0.2 s later. Stamps are
    those of the recording unless `restamp` is set; with `loop` they begin again in each round.

    It is `done` at the end if `exit_at_end` is set. `position_s` and `duration_s` are recorded
    times since the bag's first message.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("bag_player", **kwargs)
        self._values = values = declare(self, "bag_player")
        self._wanted = {topic.lstrip("/") for topic in values["topics"]}
        self._unwanted = [topic.lstrip("/") for topic in values["without"] if topic]
        self.done = False
        self.exit_code = 0
        self.published = 0
        self._latest_s = 0.0
        self.position_s = 0.0
        self.finished = threading.Event()
        self._stopping = threading.Event()
        self._running = threading.Event()
        self._rate_changed = threading.Event()
        keep_live(self, live_parameters("bag_player"), lambda _: None, self._change)
        if not values["start_paused"]:
            self._running.set()
        self._diagnostics = Diagnostics(self)
        self._readiness = Readiness(self, values["wait_for_nodes"])
        if not values["bag"]:
            raise BagError.about("bag", "the path of a bag", "nothing", "Set the parameter `bag`.")
        self._reader = BagReader(values["bag"], tolerant=True)
        self._start_ns = self._reader.start_ns
        self.duration_s = (self._reader.end_ns - self._start_ns) * 1e-9
        self._outputs: dict[str, Publisher] = {}
        self._stamped: set[str] = set()
        self._arrays: dict[str, tuple[Any, str]] = {}  # type, and its field of stamped elements
        self._apart_ns: dict[str, int] = {}  # from a topic's stamps to their reception
        for info in self._reader.topics.values():
            self._add_publisher(info)
        clock = values["clock"]
        self._clock_publisher = self.create_publisher(Clock, "/clock", 1) if clock else None
        serve(self, "pause", self._pause)
        serve(self, "resume", self._resume)
        self._messages = self._load()
        self._thread = threading.Thread(target=self._play, name="bag_player", daemon=True)
        self._thread.start()

    def destroy_node(self) -> None:
        """Stop the thread, then close the node."""
        self._stopping.set()
        self._running.set()
        self._thread.join()
        super().destroy_node()

    def _change(self, changes: Changes) -> None:
        self._values |= changes
        if "rate" in changes:
            self._rate_changed.set()

    def _add_publisher(self, info: TopicInfo) -> None:
        if info.message_count == 0 or not self._is_wanted(info.name):
            return
        topic = info.name.lstrip("/")
        name = info.name if topic in ("clock", "diagnostics") else topic
        if topic == "clock" and self._values["clock"]:
            return
        try:
            kind: Any = message_class(info.type)
            self._outputs[info.name] = self.create_publisher(kind, name, recorded_profile(info))
        except (BagError, NameValidationException) as error:
            reason = "unknown_type" if isinstance(error, BagError) else "unwritable"
            self._diagnostics.reject(reason, f"{info.name} is not played: {one_line(error)}")
            return
        fields = list(kind.get_fields_and_field_types().items())
        if info.type in STAMPED_ELEMENTS:
            self._arrays[info.name] = kind, fields[0][0]
        elif fields and fields[0] == ("header", "std_msgs/Header"):
            self._stamped.add(info.name)

    def _is_wanted(self, topic: str) -> bool:
        name = topic.lstrip("/")
        if any(name.startswith(u) if u.endswith("/") else name == u for u in self._unwanted):
            return False
        return not self._wanted or name in self._wanted

    def _load(self) -> Iterable[RawMessage]:
        """Messages read ahead, to save time later; empty for a big bag, which is streamed."""
        path = self._reader.path
        files = [path] if path.is_file() else filter(Path.is_file, path.iterdir())
        if sum(file.stat().st_size for file in files) > 2**26:
            return ()
        messages = list(self._reader.raw_messages(self._outputs))
        gc.freeze()
        return messages

    def _play(self) -> None:
        try:
            self._play_all()
        except Exception as error:
            self.exit_code = 1
            self.get_logger().error(one_line(error))
            self._diagnostics.status(Level.ERROR, one_line(error))
            if not isinstance(error, BagError):
                raise
        finally:  # also after a failure, since others wait for it
            self.finished.set()
            self.done = self._values["exit_at_end"]

    def _play_all(self) -> None:
        try:
            self._wait_for_nodes()
            self._wait_for_subscribers()
            self.get_logger().info(f"playing {self._reader.path}")
            while not self._stopping.is_set():
                self._play_once()
                if not (self._values["loop"] and self.published):
                    break
            for publisher in self._outputs.values():
                if not self._stopping.is_set():
                    publisher.wait_for_all_acked(Duration(seconds=1.0))
        finally:
            for damage in self._reader.damage:
                self.get_logger().warning(f"not played: {damage.reason} (byte {damage.offset})")
            self._diagnostics.value("published", self.published)
            self.get_logger().info(f"{self.published} messages played")
        if not self._stopping.is_set():
            self._diagnostics.end("played")

    def _play_once(self) -> None:
        begin_ns = self._start_ns + round(self._values["start_offset"] * 1e9)
        anchor: _Anchor | None = None
        self._latest_s = 0.0
        for message in self._messages or self._reader.raw_messages(self._outputs):
            if message.log_time_ns >= begin_ns:
                anchor = self._wait_until_due(message.log_time_ns, anchor)
                if anchor is None:
                    return
                self._publish(message, anchor)
        self._diagnostics.value("largest lateness [ms]", f"{self._latest_s * 1e3:.2f}")

    def _wait_until_due(self, log_ns: int, anchor: _Anchor | None) -> _Anchor | None:
        """Wait for a message's time; returns the anchor, new after a pause, or None if stopped."""
        while True:
            if anchor is None or self._interrupted:
                self._running.wait()
                self._rate_changed.clear()
                anchor = _Anchor(log_ns, time.monotonic(), now_ns(self))
            if self._stopping.is_set():
                return None
            rate = self._values["rate"]
            if rate <= 0.0:
                return anchor
            due_s = anchor.played_s + (log_ns - anchor.log_ns) * 1e-9 / rate
            if self._sleep_until(due_s, log_ns):
                self._latest_s = max(self._latest_s, time.monotonic() - due_s)
                return anchor

    def _publish(self, message: RawMessage, anchor: _Anchor) -> None:
        data = message.data
        if self._values["restamp"]:
            try:
                data = self._restamped(message, anchor)
            except BagError as error:
                self._diagnostics.reject("malformed", f"{message.topic}: {error}")
                return
        if self._values["rate"] <= 0.0:
            self._publish_clock(message.log_time_ns)
        self._outputs[message.topic].publish(data)
        self.position_s = (message.log_time_ns - self._start_ns) * 1e-9
        self.published += 1
        self._diagnostics.tick(message.topic.lstrip("/"))

    def _restamped(self, message: RawMessage, anchor: _Anchor) -> bytes:
        """The message with its stamps moved as if it were sent now; stamps of zero stay."""

        def shift(recorded_ns: int) -> int:
            if not recorded_ns:
                return 0
            apart_ns = clock_shift_ns(np.array([message.log_time_ns - recorded_ns]))
            after_ns = recorded_ns + self._apart_ns.setdefault(message.topic, apart_ns)
            rate = self._values["rate"] or 1.0
            return anchor.stamp_ns + round((after_ns - anchor.log_ns) / rate)

        if message.topic in self._stamped:
            return shift_stamp(message.data, shift)
        if message.topic not in self._arrays:
            return message.data
        kind, field = self._arrays[message.topic]
        try:
            array: Any = deserialize_message(message.data, kind)
            for element in getattr(array, field):
                element.header.stamp = to_stamp(shift(stamp_ns(element)))
            return bytes(serialize_message(array))
        except Exception as error:  # rclpy raises exceptions of many types
            raise _unmoved(error) from error

    @property
    def _interrupted(self) -> bool:
        """Whether the schedule no longer holds, because of a pause or a new rate."""
        return self._rate_changed.is_set() or not self._running.is_set()

    def _sleep_until(self, due_s: float, log_time_ns: int) -> bool:
        """Sleep while publishing the clock; returns False if stopped or interrupted."""
        while not self._stopping.is_set() and not self._interrupted:
            remaining_s = due_s - time.monotonic()
            recorded_s = max(remaining_s, 0.0) * self._values["rate"]
            self._publish_clock(log_time_ns - round(recorded_s * 1e9))
            if remaining_s <= 0.0:
                return True
            time.sleep(min(remaining_s, 0.01 if self._values["clock"] else 0.05))
        return False

    def _publish_clock(self, time_ns: int) -> None:
        if self._clock_publisher is not None:
            self._clock_publisher.publish(Clock(clock=to_stamp(max(time_ns, 0))))

    def _wait_for_nodes(self) -> None:
        reported: list[str] = []
        while not self._stopping.is_set() and (missing := self._readiness.missing()):
            if missing != reported:
                reported = missing
                text = f"waiting for {', '.join(missing)} (wait_for_nodes)"
                self.get_logger().info(text)
                self._diagnostics.status(Level.OK, text)
            self._stopping.wait(0.05)
        if reported:
            self._diagnostics.status(Level.OK, "running")

    def _wait_for_subscribers(self) -> None:
        wait_s = self._values["wait_for_subscribers"]
        end_s = time.monotonic() + wait_s
        matched, changed_s = 0, time.monotonic()
        while not self._stopping.is_set() and time.monotonic() < end_s:
            now = sum(p.get_subscription_count() > 0 for p in self._outputs.values())
            if now != matched:
                matched, changed_s = now, time.monotonic()
            steady = matched and time.monotonic() - changed_s > 1.0
            if steady or matched == len(self._outputs):
                break
            self._stopping.wait(0.01)
        if wait_s > 0.0:
            self._stopping.wait(min(0.2, wait_s))  # the subscribers' side must be ready, too
        alone = [t for t, p in self._outputs.items() if p.get_subscription_count() == 0]
        if alone:
            self.get_logger().info(f"no subscribers of {', '.join(sorted(alone))}")

    def _pause(self) -> str:
        self._running.clear()
        return f"paused after {self.published} messages"

    def _resume(self) -> str:
        self._running.set()
        return "playing"


def shift_stamp(data: bytes, shift: Callable[[int], int]) -> bytes:
    """CDR bytes, whose first field is a Header, with the stamp replaced by `shift(stamp_ns)`.

    Raises:
        BagError: the bytes hold no stamp, or the shifted stamp is out of range.
    """
    try:
        layout = struct.Struct("<iI" if data[1] & 1 else ">iI")
        seconds, nanoseconds = layout.unpack_from(data, 4)
        stamp_ns = shift(seconds * 1_000_000_000 + nanoseconds)
        return data[:4] + layout.pack(*divmod(stamp_ns, 1_000_000_000)) + data[12:]
    except (struct.error, IndexError) as error:
        raise _unmoved(error) from error


def _unmoved(error: Exception) -> BagError:
    expected = "a stamp between 1901 and 2038, after the shift too"
    return BagError.about("header.stamp", expected, error, "Play it without restamp.")


main = partial(run, BagPlayer)
