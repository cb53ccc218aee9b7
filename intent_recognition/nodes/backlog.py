# SPDX-License-Identifier: Apache-2.0
"""What to do when observations come faster than they can be used: thin them, the newest stays."""

from collections.abc import Callable, Sequence
from functools import partial
from heapq import merge
from typing import TypeVar

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from intent_recognition.bags import header_stamp_ns
from intent_recognition.nodes.conversions import stamp_ns

LATEST_NS = 2**63 - 1
MAX_WAITING = 16
"""More waiting messages than these, twice on end, mean that the node cannot keep up."""

Item = TypeVar("Item")


class _Source:
    """One topic: its subscription, and what takes its messages."""

    def __init__(self, use: Callable[[object], None], raw: bool):
        self.use, self.raw = use, raw
        self.subscription: Subscription | None = None
        self.behind = False


class Backlog:
    """Subscriptions that are looked at together, all messages that wait, not one.

    The executor hands over one message at a time, the oldest of its topic. Whatever waits behind
    it, there and on the other topics, is taken at once and used in the order of the stamps. Where
    more than `MAX_WAITING` wait on a topic although the last ones were only just worked off, the
    queue would grow: evenly spaced ones are used, the newest always. Observations close in time
    share one piece of evidence (`TaskLibrary.noise_covariance`), so little is lost. A queue that
    has grown once, while a model was loaded, say, is worked off whole.

    Args:
        dropped: told how many were not used.
    """

    def __init__(self, dropped: Callable[[int], None]):
        self._dropped = dropped
        self._sources: list[_Source] = []

    def subscribe(
        self,
        node: Node,
        kind: type,
        topic: str,
        use: Callable[[object], None],
        qos: QoSProfile,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Subscribe to one more topic.

        Args:
            node: subscribes.
            kind: of the messages.
            topic: its name.
            use: takes each message that is used.
            qos: of the subscription.
            raw: whether it takes bytes, of messages with a header.
        """
        source = _Source(use, raw)
        callback = partial(self._on_message, len(self._sources))
        self._sources.append(source)
        source.subscription = node.create_subscription(kind, topic, callback, qos, raw=raw)
        return source.subscription

    @property
    def subscriptions(self) -> list[Subscription]:
        """Those made, in order."""
        return [source.subscription for source in self._sources if source.subscription]

    def close(self, node: Node) -> None:
        """Unsubscribe from everything."""
        while self._sources:
            source = self._sources.pop()
            node.destroy_subscription(source.subscription)
            source.subscription = None

    def _on_message(self, number: int, message: object) -> None:
        """Use a message and whatever waits, behind it or elsewhere."""
        waiting = [self._take_waiting(source) for source in self._sources]
        waiting[number].insert(0, message)
        used = [
            [(source, one) for one in self._thinned(source, messages)]
            for source, messages in zip(self._sources, waiting, strict=True)
            if messages
        ]
        for source, one in used[0] if len(used) == 1 else merge(*used, key=_time_ns):
            if source.subscription is not None:  # what came before may have closed it
                source.use(one)

    def _thinned(self, source: _Source, waiting: list[object]) -> list[object]:
        too_many = len(waiting) > MAX_WAITING
        used = thin(waiting, MAX_WAITING) if too_many and source.behind else waiting
        source.behind = too_many
        if len(used) < len(waiting):
            self._dropped(len(waiting) - len(used))
        return used

    def _take_waiting(self, source: _Source) -> list[object]:
        taken: list[object] = []
        if source.subscription is None:
            return taken
        kind = source.subscription.msg_type
        with (handle := source.subscription.handle):
            while (found := handle.take_message(kind, source.raw)) is not None:
                taken.append(found[0])
        return taken


def _time_ns(arrival: tuple[_Source, object]) -> int:
    """Stamp of a message; without one it is of now, so it comes last."""
    source, message = arrival
    if source.raw:
        return header_stamp_ns(message)
    stamped = hasattr(message, "header") or hasattr(message, "stamp")
    return stamp_ns(message) if stamped else LATEST_NS


def thin(items: Sequence[Item], most: int) -> list[Item]:
    """At most so many of the items, evenly spaced, the last one always."""
    n = len(items)
    if n <= most:
        return list(items)
    return [items[(k + 1) * n // most - 1] for k in range(most)]
