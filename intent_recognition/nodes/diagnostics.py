# SPDX-License-Identifier: Apache-2.0
"""Health of a node on `/diagnostics`: rates, rejected inputs, latencies; readiness of others."""

import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from enum import IntEnum
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState

from intent_recognition.errors import IntentError, one_line
from intent_recognition.nodes import qos
from intent_recognition.nodes.runtime import simulated_ns, steady_timer
from intent_recognition.registry import ANSWERS

PUBLISHERS, LIFECYCLE, ACTIVE, INACTIVE = "publishers ", "lifecycle", "active", "not active"
"""Keys of a report (the first is followed by a topic), and values of the key `LIFECYCLE`."""

ENDED = "ended"
"""Key of the last report of a node that ends because its work is done."""

MODEL = "model"
"""Key under which the estimator says which model file it has loaded."""

PATIENCE_S = 3.0
"""Time without /clock or a needed input after which a node warns [s]: three of its reports."""

UNANSWERED = "not waited for"
"""Key under which a simulation names the nodes that its clock no longer waits for."""


class Level(IntEnum):
    """Levels of a DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class RejectionError(IntentError):
    """An input that is not acted on, with the `reason` that it is counted under."""

    def __init__(self, reason: str, text: str):
        super().__init__(text)
        self.reason = reason


def answer_of(node: str, counts: Mapping[str, int]) -> JointState:
    """Message with the number of messages that a node has taken and sent, by topic.

    `frame_id` names the node. If `counts` is empty, simulated time does not wait for it.
    """
    message = JointState(name=list(counts))
    message.header.frame_id = node
    message.position = [float(n) for n in counts.values()]
    return message


def key_values(values: Mapping[str, str]) -> list[KeyValue]:
    """Rows of a DiagnosticStatus."""
    return [KeyValue(key=key, value=value) for key, value in values.items()]


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """The rows of a DiagnosticStatus by key."""
    return {row.key: row.value for row in status.values}


class Diagnostics:
    """Publishes one DiagnosticStatus a second, named after the node.

    Keys are `rate <stream> [Hz]` (measured over the last period), `received <stream>` (total),
    `rejected <reason>` (total), `latency p50|p95|p99 [ms]` (over the last 2000 samples),
    `publishers <stream>`, `lifecycle` of a lifecycle node, and what the node set with `value`.
    Publishing runs on a steady clock, so it continues while simulated time stands still.
    The status warns if /clock is missing for `PATIENCE_S`, if a needed stream is missing for as
    long while time (simulated, if used) goes on, and if several nodes publish /clock.

    A lifecycle node reports in every state. Tests pass a clock of their own [s].

    Attributes:
        ready: whether the node answers a simulated clock that waits.
    """

    def __init__(
        self, node: Node, *, period_s: float = 1.0, clock: Callable[[], float] = time.monotonic
    ):
        self._node = node
        self._clock = clock
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._counts: Counter[str] = Counter()
        self._totals: Counter[str] = Counter()
        self._in_period: Counter[str] = Counter()
        self._start_s = self._period_start_s = clock()
        self._heard_s: dict[str, float] = {}
        self._heard_ns: dict[str, int] = {}  # in simulated time
        self._latencies_s: deque[float] = deque(maxlen=2000)
        self._values: dict[str, str] = {}
        self._watched: list[tuple[Subscription, str]] = []
        self._needed: set[str] = set()
        self._simulated_ns: int | None = None  # at the last report
        self._stood_s = self._start_s  # when simulated time was last seen to stand still
        self._wrong_types: set[tuple[int, ...]] = set()
        self._logged_s: dict[str, float] = {}
        self._level = bytes([Level.OK])
        self._message = "running"
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._answers = node.create_publisher(JointState, ANSWERS, qos.FEEDBACK)
        self._answered, self.ready = -1, True
        steady_timer(node, period_s, self.publish)

    def count(self, reason: str, amount: int = 1) -> None:
        """Count rejected inputs under `reason`; the total is published as `rejected <reason>`."""
        self._counts[reason] += amount

    def reject(self, reason: str, text: str) -> None:
        """Count a rejected input and log it, at most once a second for each reason."""
        self.count(reason)
        now_s = self._clock()
        if now_s - self._logged_s.get(reason, -np.inf) >= 1.0:
            self._logged_s[reason] = now_s
            self._node.get_logger().warning(f"{reason}: {text} ({self._counts[reason]} so far)")

    @contextmanager
    def rejecting(self, reason: str, of: str = "") -> Iterator[None]:
        """Reject an input if the block raises an IntentError, for the error's reason or this one.

        The log names what the input was `of`.
        """
        try:
            yield
        except IntentError as error:
            text = f"{of}: {one_line(error)}" if of else one_line(error)
            self.reject(getattr(error, "reason", reason), text)

    def rejected(self, reason: str) -> int:
        """Number of inputs rejected for `reason` so far."""
        return self._counts[reason]

    def subscribe(
        self,
        kind: type,
        topic: str,
        take: Callable[[Any], object],
        profile: QoSProfile,
        stream: str = "",
        needed: bool = False,
        **options: Any,
    ) -> Subscription:
        """Subscribe to a topic, watch it, and count its messages as `stream` (default: its name).

        Simulated time waits until counted messages are processed, so its queues must keep them all.
        """

        def noted(message: Any) -> None:
            self.tick(stream or topic)
            take(message)

        if self._node.get_parameter("use_sim_time").value:
            profile = qos.each_of(profile)
        subscription = self._node.create_subscription(kind, topic, noted, profile, **options)
        self.watch(subscription, topic, needed=needed)
        return subscription

    def tick(self, stream: str) -> None:
        """Count one message of `stream`."""
        self._totals[stream] += 1
        self._in_period[stream] += 1
        self._note_time(stream)

    def silent_s(self, stream: str) -> float:
        """Time [s] since a message of `stream`; before any, since its watch or the start.

        Real time, or simulated time where a node publishes it and less has passed: it may run at a
        hundredth of real time.
        """
        real_s = self._clock() - self._heard_s.get(stream, self._start_s)
        passed_ns = (simulated_ns(self._node) or -1) - self._heard_ns.get(stream, 0)
        if passed_ns < 0 or not self._node.count_publishers("/clock"):
            return real_s
        return min(real_s, passed_ns * 1e-9)

    @property
    def answers(self) -> bool:
        """Whether simulated time waits until nodes have processed their messages."""
        return bool(self._answers.get_subscription_count())

    def answer(self) -> None:
        """Publish how many messages were taken and sent, if simulated time waits for that."""
        counts = dict(self._totals)  # a copy, since a recorder's thread goes on counting
        total = sum(counts.values())
        if self.ready and total != self._answered and self.answers:
            self._answered = total
            self._answers.publish(answer_of(self._node.get_name(), counts))

    def latency(self, seconds: float) -> None:
        """Record the time that one input took from arrival to output [s]."""
        self._latencies_s.append(float(seconds))

    def value(self, key: str, value: object) -> None:
        """Report `value` under `key` from now on; the latest wins."""
        self._values[key] = str(value)

    def watch(self, subscription: Subscription, stream: str, *, needed: bool = False) -> None:
        """Report how many publishers a subscription has, as `publishers <stream>`.

        The status warns while a `needed` stream is silent. Publishers of another message type,
        whose messages never arrive, are rejected once each as `wrong_type`.

        Publishers are counted at each report: the EventsExecutor of rclpy 7.1 loses a message of a
        subscription whose `matched` event is listened to. The stream is listed with a total of 0
        from the beginning, also for a simulated clock that waits for its messages.
        """
        self._watched.append((subscription, stream))
        self._totals[stream] += 0
        if needed:
            self._needed.add(stream)
            self._note_time(stream)

    def unwatch(self, subscriptions: Collection[Subscription]) -> None:
        """Stop watching subscriptions that are closed."""
        self._watched = [pair for pair in self._watched if pair[0] not in subscriptions]

    def status(self, level: int, message: str) -> None:
        """Set level (see `Level`) and message, until set again."""
        self._level = bytes([level])
        self._message = message

    def end(self, message: str) -> None:
        """Report at once that the work is done, so that silence afterwards is no failure."""
        self.status(Level.OK, message)
        self.value(ENDED, "yes")
        self.publish()

    def report(self) -> DiagnosticStatus:
        """Return the status at this moment, and start a new period for the rates."""
        now_s = self._clock()
        elapsed_s = max(now_s - self._period_start_s, 1e-9)
        rows: dict[str, str] = {}
        for stream in sorted(self._totals):
            rows[f"rate {stream} [Hz]"] = f"{self._in_period[stream] / elapsed_s:.1f}"
            rows[f"received {stream}"] = str(self._totals[stream])
        rows |= {f"rejected {reason}": str(n) for reason, n in sorted(self._counts.items())}
        if self._latencies_s:
            percentiles = np.percentile(np.array(self._latencies_s) * 1e3, (50, 95, 99))
            for name, value in zip(("p50", "p95", "p99"), percentiles, strict=True):
                rows[f"latency {name} [ms]"] = f"{value:.3f}"
        for subscription, stream in self._watched:
            rows[f"{PUBLISHERS}{stream}"] = str(subscription.get_publisher_count())
        if isinstance(active := getattr(self._node, "active", None), bool):
            rows[LIFECYCLE] = ACTIVE if active else INACTIVE
        rows |= self._values
        missing = self._missing(now_s)
        level, message = self._level, self._message
        if missing and level == bytes([Level.OK]):
            level, message = bytes([Level.WARN]), missing
        elif missing:
            message += f"; {missing}"
        self._in_period.clear()
        self._period_start_s = now_s
        return DiagnosticStatus(
            level=level,
            name=self._name,
            message=message,
            hardware_id=socket.gethostname(),
            values=key_values(rows),
        )

    def _note_time(self, stream: str) -> None:
        self._heard_s[stream] = self._clock()
        self._heard_ns[stream] = simulated_ns(self._node) or 0

    def _missing(self, now_s: float) -> str:
        """Text on what the node has lacked for a while, or on a second /clock; else empty."""
        before_ns, self._simulated_ns = self._simulated_ns, simulated_ns(self._node)
        if self._simulated_ns is not None and self._simulated_ns == before_ns:
            self._stood_s = now_s
        if self._simulated_ns == 0 and now_s - self._start_s > PATIENCE_S:
            return (
                "waiting for /clock: let one lwr_sim (publish_clock) or bag_player (clock) publish"
                " it, or unset use_sim_time"
            )
        found = []
        if self._simulated_ns is not None and (n := self._node.count_publishers("/clock")) > 1:
            found.append(f"{n} nodes publish /clock: end all but one")
        for subscription, stream in self._watched:
            silent_s = min(self.silent_s(stream), now_s - self._stood_s)
            if stream in self._needed and silent_s > PATIENCE_S:
                n = subscription.get_publisher_count()
                found.append(
                    f"nothing on {subscription.topic_name} for {silent_s:.0f} s (publishers: {n})"
                )
        return "; ".join(found)

    def publish(self) -> None:
        """Publish one report; the next answer is repeated, since a new clock may have missed it."""
        self._answered = -1
        self._reject_wrong_types()
        message = DiagnosticArray(status=[self.report()])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _reject_wrong_types(self) -> None:
        for subscription, _ in self._watched:
            topic = subscription.topic_name
            kind: Any = subscription.msg_type  # a class, though rclpy declares an instance
            expected = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            for publisher in self._node.get_publishers_info_by_topic(topic):
                found = tuple(publisher.endpoint_gid)  # its node may not be known by name yet
                if publisher.topic_type != expected and found not in self._wrong_types:
                    self._wrong_types.add(found)
                    text = f"{topic} is {publisher.topic_type}, expected {expected}"
                    self.reject("wrong_type", text)


class Readiness:
    """Finds out from `/diagnostics` whether nodes are ready, before something begins.

    A node is ready when it has reported, is active if it has a lifecycle, and has matched a
    publisher of every watched topic that has one in the graph.
    """

    def __init__(self, node: Node, names: Iterable[str]):
        self._node = node
        self._space = node.get_namespace().rstrip("/") + "/"
        self._names = [name for name in names if name]
        self._reports: dict[str, Mapping[str, str]] = {}
        if self._names:
            node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)

    def missing(self) -> list[str]:
        """Names of the nodes that are not ready yet."""
        return [name for name in self._names if not self._is_ready(name)]

    def forget(self, name: str) -> None:
        """Wait for a node again, after it has ended."""
        self._reports.pop(f"{self._space}{name}".lstrip("/"), None)

    def _is_ready(self, name: str) -> bool:
        report = self._reports.get(f"{self._space}{name}".lstrip("/"))
        if report is None or report.get(LIFECYCLE) == INACTIVE:
            return False
        return all(
            value != "0" or not self._node.count_publishers(key.removeprefix(PUBLISHERS))
            for key, value in report.items()
            if key.startswith(PUBLISHERS)
        )

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._reports[status.name] = values_of(status)
