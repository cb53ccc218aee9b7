# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that thin messages which arrive faster than they can be processed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import merge
from typing import TypeVar

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from intent_recognition.bags import header_stamp_ns
from intent_recognition.nodes.conversions import stamp_ns

MAX_WAITING = 16
"""Messages of a topic that may wait before the node counts as behind: 0.16 s at 100 Hz."""

BacklogItem = TypeVar("BacklogItem")


@dataclass(eq=False)
class _Source:
    """A topic: the callback for its messages, and whether too many waited the last time."""

    callback: Callable[[object], None]
    raw: bool
    subscription: Subscription | None = None
    behind: bool = False


class Backlog:
    """Subscriptions whose waiting messages are taken together, in the order of their stamps.

    The executor hands over one message at a time, the oldest of its topic. All messages that wait,
    on this topic and on the others, are taken with it. If more than `MAX_WAITING` messages wait on
    a topic twice in a row, the queue would grow; then only evenly spaced ones are used, including
    the newest. Little is lost, since observations close in time are correlated
    (`TaskLibrary.noise_covariance`). A queue that is long only once, for instance after a model
    was loaded, is used completely. `dropped` is called with the number of messages not used.
    """

    def __init__(self, dropped: Callable[[int], None]):
        self._dropped = dropped
        self._sources: list[_Source] = []

    def subscribe(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callable[[object], None],
        qos: QoSProfile,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Subscribe to one more topic."""
        source = _Source(callback, raw)
        arrival = partial(self._on_message, source)
        subscription = node.create_subscription(kind, topic, arrival, qos, raw=raw)
        source.subscription = subscription
        self._sources.append(source)
        return subscription

    def close(self, node: Node) -> list[Subscription]:
        """Unsubscribe from everything; returns the subscriptions that were closed."""
        closed = []
        while self._sources:
            source = self._sources.pop()
            if source.subscription is not None:
                node.destroy_subscription(source.subscription)
                closed.append(source.subscription)
            source.subscription = None
        return closed

    def _on_message(self, arrived: _Source, message: object) -> None:
        """Use a message and all that wait, on its topic and on the others."""
        used = []
        for source in self._sources:
            waiting = [message] * (source is arrived) + self._take_waiting(source)
            if waiting:
                used.append([(source, one) for one in self._thinned(source, waiting)])
        for source, one in used[0] if len(used) == 1 else merge(*used, key=_time_ns):
            if source.subscription is not None:  # an earlier callback may have closed it
                source.callback(one)

    def _thinned(self, source: _Source, waiting: list[object]) -> list[object]:
        too_many = len(waiting) > MAX_WAITING
        used = thin(waiting, MAX_WAITING) if too_many and source.behind else waiting
        source.behind = too_many
        if len(used) < len(waiting):
            self._dropped(len(waiting) - len(used))
        return used

    def _take_waiting(self, source: _Source) -> list[object]:
        if (subscription := source.subscription) is None:
            return []
        with (handle := subscription.handle):
            found = iter(lambda: handle.take_message(subscription.msg_type, source.raw), None)
            return [message for message, _ in found]


def _time_ns(arrival: tuple[_Source, object]) -> int:
    """Stamp of a message [ns]; one without a stamp is of the present and comes last."""
    _, message = arrival
    if isinstance(message, bytes):
        return header_stamp_ns(message)
    stamped = hasattr(message, "header") or hasattr(message, "stamp")
    return stamp_ns(message) if stamped else 2**63 - 1


def thin(items: Sequence[BacklogItem], most: int) -> list[BacklogItem]:
    """At most `most` of the items, evenly spaced and including the last."""
    n = len(items)
    return [items[(k + 1) * n // most - 1] for k in range(most)] if n > most else list(items)
