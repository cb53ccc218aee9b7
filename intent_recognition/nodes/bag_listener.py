# SPDX-License-Identifier: Apache-2.0
"""Raw subscriptions with the time stamps of the middleware, read by a thread of their own.

The message info holds the times of sending and reception, but the EventsExecutor of rclpy 7.1
raises SystemError for a callback that asks for it. So these subscriptions belong to no executor:
a thread waits for their messages and takes them, however busy the node is.
"""

import atexit
import threading
from collections.abc import Callable
from contextlib import ExitStack

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_is_valid_msg_type


class BagListener:
    """Calls `on_message(topic, data, received_ns, sent_ns)` for every message, in its thread.

    Times are 0 if the middleware does not know them. `on_error` is called with exceptions, such as
    those of `on_message`; listening goes on.
    """

    def __init__(
        self,
        node: Node,
        on_message: Callable[[str, bytes, int, int], None],
        on_error: Callable[[Exception], None],
    ):
        self._node = node
        self._on_message = on_message
        self._on_error = on_error
        self._lock = threading.Lock()
        self._handles: dict[str, tuple[_rclpy.Subscription, type]] = {}
        self._stopping = threading.Event()
        self._passes, self._passed = 0, threading.Condition()
        self._thread = threading.Thread(target=self._listen, name="bag_listener", daemon=True)

    def subscribe(self, topic: str, kind: type, profile: QoSProfile) -> None:
        """Subscribe to a topic; replaces an earlier subscription to it."""
        check_is_valid_msg_type(kind)
        with self._node.handle:
            handle = _rclpy.Subscription(
                self._node.handle, kind, topic, profile.get_c_qos_profile()
            )
        with self._lock:
            previous = self._handles.pop(topic, None)
            self._handles[topic] = (handle, kind)
        if previous is not None:
            previous[0].destroy_when_not_in_use()
        if self._thread.ident is None:  # a thread started earlier would keep a failed node
            self._thread.start()
            atexit.register(self.close)  # Python aborts where a daemon thread is in C++

    def catch_up(self) -> None:
        """Wait until all messages received before this call are passed on, for at most 1 s."""
        with self._passed:
            enough = self._passes + 2  # the pass under way may have left a topic behind
            listening = self._thread.is_alive
            self._passed.wait_for(lambda: self._passes >= enough or not listening(), timeout=1.0)

    def close(self) -> None:
        """End the thread and the subscriptions."""
        atexit.unregister(self.close)
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        for handle, _ in self._handles.values():
            handle.destroy_when_not_in_use()
        self._handles.clear()

    def _listen(self) -> None:
        while self._node.context.ok() and not self._stopping.is_set():
            with self._passed:
                self._passes += 1
                self._passed.notify_all()
            with self._lock:
                sources = list(self._handles.items())
            try:
                self._wait_and_take(sources)
            except (_rclpy.RCLError, _rclpy.InvalidHandle) as error:
                # While waiting the context was shut down, or a subscription replaced.
                if self._node.context.ok() and not isinstance(error, _rclpy.InvalidHandle):
                    self._on_error(error)

    def _wait_and_take(self, sources: list[tuple[str, tuple[_rclpy.Subscription, type]]]) -> None:
        with ExitStack() as in_use:  # handles are not destroyed while the thread waits for them
            if (context := self._node.context.handle) is None:
                return
            in_use.enter_context(context)
            for _, (handle, _) in sources:
                in_use.enter_context(handle)
            wait_set = _rclpy.WaitSet(len(sources), 0, 0, 0, 0, 0, context)
            in_use.enter_context(wait_set)
            wait_set.clear_entities()
            places = [wait_set.add_subscription(handle) for _, (handle, _) in sources]
            wait_set.wait(20_000_000)  # [ns], until a new or closed one is noticed
            ready = [wait_set.is_ready("subscription", place) for place in places]
        for is_ready, (topic, (handle, kind)) in zip(ready, sources, strict=True):
            if is_ready:
                self._drain(topic, handle, kind)

    def _drain(self, topic: str, handle: _rclpy.Subscription, kind: type) -> None:
        with handle:
            while not self._stopping.is_set():
                taken = handle.take_message(kind, True)
                if taken is None:
                    return
                data, info = taken
                received_ns = int(info.get("received_timestamp") or 0)
                sent_ns = int(info.get("source_timestamp") or 0)
                try:
                    self._on_message(topic, data, received_ns, sent_ns)
                except Exception as error:  # the thread must outlive one message
                    self._on_error(error)
