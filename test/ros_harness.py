# SPDX-License-Identifier: Apache-2.0
"""Spins nodes of a test in one process until something has happened; never sleeps."""

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import rclpy
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from std_srvs.srv import Trigger

from intent_recognition.nodes.runtime import make_executor, spin_until

DEADLINE_S = 30.0
LEAVE_S = 1.0
"""How long nodes of ended processes may stay to be seen [s]; killed ones stay longer."""


class Harness:
    """rclpy up, one executor for all nodes, everything destroyed at the end.

    Use as a context manager, or through the fixture `harness`.
    """

    def __enter__(self):
        rclpy.init(args=["--ros-args", "--log-level", "info"])  # others may have left it at warn
        self.executor = make_executor()
        self.nodes: list[Node] = []
        self.probe = self.add(Node("probe"))
        return self

    def __exit__(self, *_):
        gc.collect()  # a node whose constructor raised would stay in the graph
        spin_until(self.executor, self._is_alone, LEAVE_S)
        for node in self.nodes:
            self.executor.remove_node(node)
        for _ in range(20):  # what it took it also runs: else it would keep clients of actions
            self.executor.spin_once(timeout_sec=0.0)
        for node in self.nodes:
            node.destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown()

    def _is_alone(self) -> bool:
        """Whether no other process is seen: Fast DDS may not let go of us while it notes one."""
        return set(self.probe.get_node_names()) <= {node.get_name() for node in self.nodes}

    def add(self, node: Node) -> Node:
        """Spin `node` from now on; it is destroyed at the end."""
        self.executor.add_node(node)
        self.nodes.append(node)
        return node

    def remove(self, node: Node) -> None:
        """Destroy a node now."""
        self.executor.remove_node(node)
        self.nodes.remove(node)
        for timer in node.timers:
            timer.callback = lambda: None  # the executor may have queued it already
        node.destroy_node()

    def node(self, kind: Callable[..., Node], **parameters) -> Node:
        """Spin a node of this kind with these parameters; see `add`."""
        given = [Parameter(name, value=value) for name, value in parameters.items()]
        return self.add(kind(parameter_overrides=given))

    def spin_until(
        self,
        predicate: Callable[[], object],
        deadline_s: float = DEADLINE_S,
        what: str = "",
        poll_s: float = 0.01,
    ):
        """Dispatch events until `predicate()` is true and return its value.

        It is asked after each event, and every `poll_s` for what other threads do.

        Raises:
            TimeoutError: it was not true after `deadline_s` seconds.
        """
        end_s = time.monotonic() + deadline_s
        while not (value := predicate()):
            if time.monotonic() > end_s:
                raise TimeoutError(f"not within {deadline_s} s: {what or predicate}")
            self.executor.spin_once(timeout_sec=poll_s)
        return value

    def collect(self, message_type: type, topic: str, qos: QoSProfile | int = 10) -> list:
        """A list that grows with every message received on `topic`."""
        received: list = []
        self.probe.create_subscription(message_type, topic, received.append, qos)
        return received

    def publisher(self, message_type: type, topic: str, qos: QoSProfile | int = 10):
        """A publisher of the probe node; see `connect`."""
        return self.probe.create_publisher(message_type, topic, qos)

    def connect(self, *publishers, subscribers: int = 1) -> None:
        """Spin until each publisher is matched by `subscribers` subscriptions."""
        self.spin_until(
            lambda: all(p.get_subscription_count() >= subscribers for p in publishers),
            what="publishers matched",
        )

    def call(self, service_type: type, name: str, request, deadline_s: float = DEADLINE_S):
        """Call a service from the probe node and return the response."""
        client = self.probe.create_client(service_type, name)
        try:
            self.spin_until(client.service_is_ready, deadline_s, f"service {name}")
            future = client.call_async(request)
            self.spin_until(future.done, deadline_s, f"answer of {name}")
            return future.result()
        finally:
            self.probe.destroy_client(client)

    def trigger(self, name: str):
        """The response of a service that takes nothing."""
        return self.call(Trigger, name, Trigger.Request())

    def hear(self, node: Node, topic: str, message) -> None:
        """Let a node take a message at once, as if it had come on the topic."""
        name = node.resolve_topic_name(topic)
        found = next(one for one in node.subscriptions if one.topic_name == name)
        assert isinstance(message, found.msg_type)
        found.callback(serialize_message(message) if found.raw else message)

    def said(self, node: Node, topic: str) -> list:
        """A list that grows with every message that the node publishes on the topic from now on."""
        name, said = node.resolve_topic_name(topic), []
        publisher = next(one for one in node.publishers if one.topic_name == name)
        publish = publisher.publish

        def note(message) -> None:
            data = message if isinstance(message, bytes) else serialize_message(message)
            said.append(deserialize_message(data, publisher.msg_type))
            publish(message)

        publisher.publish, publisher.get_subscription_count = note, lambda: 1
        return said

    def set_clock(self, node: Node, time_ns: int) -> None:
        """Set the simulated time of a node."""
        node.get_clock().set_ros_time_override(
            Time(nanoseconds=time_ns, clock_type=ClockType.ROS_TIME)
        )


def node_with(harness: Harness, **overrides) -> Node:
    """A node without topics, with these parameters."""
    return harness.node(partial(Node, "owner"), **overrides)


class NodeProcess:
    """One node in its own process, interrupted (SIGINT) at the end of the `with` block.

    Args:
        command: an executable file, or a module with `main`, e.g.
            "intent_recognition.nodes.mocap_ingest".
        arguments: what follows it, e.g. "--ros-args", "-p", "rate:=0.0".
    """

    def __init__(self, command: str | Path, *arguments: str, environment: dict | None = None):
        start = [str(command)]
        if not Path(command).is_file():
            start = [sys.executable, "-c", f"import sys, {command} as m; sys.exit(m.main())"]
        self.process = subprocess.Popen(
            [*start, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONFAULTHANDLER": "1", **(environment or {})},
        )
        self.output = self.errors = ""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def wait(self, timeout_s: float = DEADLINE_S) -> int:
        """Wait for the process to end by itself; returns its exit code.

        Raises:
            AssertionError: it does not end, with where each of its threads is.
        """
        try:
            output, errors = self.process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)  # faulthandler's, see the environment
            _, errors = self.process.communicate()
            raise AssertionError(f"did not end within {timeout_s:g} s:\n{errors}") from None
        self.output, self.errors = output, errors
        return self.process.returncode

    def stop(self, signal_number: int = signal.SIGINT) -> int:
        """Signal the process, if it still runs, and wait; returns its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal_number)
        return self.wait() if not self.process.stdout.closed else self.process.returncode
