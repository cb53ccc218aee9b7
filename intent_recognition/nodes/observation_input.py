# SPDX-License-Identifier: Apache-2.0
"""Input of the estimator node: from the messages of the observed topics to observations."""

import time
from collections.abc import Callable
from functools import partial

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.subscription import Subscription

from intent_recognition.demonstrations import (
    DofEntry,
    DofSpec,
    ObservationReader,
    is_raw_pose,
    observation_readers,
    position_columns,
    stamp_of,
)
from intent_recognition.errors import MessageError
from intent_recognition.nodes import qos
from intent_recognition.nodes.backlog import Backlog
from intent_recognition.nodes.conversions import message_class
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.serialized import read_odometry
from intent_recognition.signals import Observation

INPUT = qos.keep_last(1000, reliable=False)
"""As sensor data. Convention: the queue holds 10 s at 100 Hz, so that nothing is lost while a
movement is filtered again (onset, new model)."""


def human_topic(entry: DofEntry) -> str:
    """Topic on which mocap_ingest republishes a raw pose topic: human/<body>."""
    *prefix, _, body, _ = entry.topic.split("/")
    return "/".join([*prefix, "human", body])


class ObservationInput:
    """One subscription for each observed topic; all entries of the topic read its messages.

    Args:
        node: owner of the subscriptions.
        diagnostics: counts messages that cannot be read, under `missing_dof` or `malformed`.
        use: takes an observation and the name of its topic; returns False if it was refused.
        use_context: the same for samples of the scene.

    Attributes:
        frame: frame of the last position.
    """

    def __init__(
        self,
        node: Node,
        diagnostics: Diagnostics,
        use: Callable[[Observation, str], bool],
        use_context: Callable[[Observation, str], bool],
    ):
        self.frame = "world"
        self._node, self._diagnostics = node, diagnostics
        self._use, self._use_context = use, use_context
        self._backlog = Backlog(partial(diagnostics.count, "dropped_behind"))
        self._kinds: dict[str, type] = {}

    def configure(self, dofs: DofSpec) -> None:
        """Find the message types.

        Raises:
            MessageError: one of them is not installed.
        """
        self._dofs = dofs
        entries = (*dofs.observed, *dofs.velocities, *dofs.context)
        self._kinds = {entry.type: message_class(entry.type) for entry in entries}

    def open(self) -> None:
        """Subscribe."""
        by_topic: dict[str, list[ObservationReader]] = {}
        context = [ObservationReader(entry, k) for k, entry in enumerate(self._dofs.context)]
        for reader in (*observation_readers(self._dofs), *context):
            by_topic.setdefault(reader.entry.topic, []).append(reader)
        for topic, readers in by_topic.items():
            entry = readers[0].entry
            raw = is_raw_pose(topic, entry.type)
            kind = Odometry if raw else self._kinds[entry.type]
            use = partial(self._on_odometry if raw else self._on_message, readers)
            name = human_topic(entry) if raw else topic
            source = self._backlog.subscribe(self._node, kind, name, use, INPUT, raw=raw)
            self._diagnostics.watch(source, name)
            if any(reader.entry.context for reader in readers):  # it may have been said before
                self._backlog.subscribe(self._node, kind, name, use, qos.LATCHED, raw=raw)

    def close(self) -> None:
        """Unsubscribe."""
        self._diagnostics.unwatch(self.subscriptions)
        self._backlog.close(self._node)

    @property
    def subscriptions(self) -> list[Subscription]:
        """All current subscriptions."""
        return self._backlog.subscriptions

    def _on_odometry(self, readers: list[ObservationReader], data: bytes) -> None:
        """Take a tracked pose; its twist is computed from poses and not an observation."""
        start_s = time.perf_counter()
        try:
            stamp, frame_id, pose, covariance = read_odometry(data)
        except MessageError as error:
            self._diagnostics.reject("malformed", str(error))
            return
        if not readers[0].entry.context:
            self.frame = frame_id or self.frame
        self._take(readers, lambda reader: reader.observe_pose(stamp, pose, covariance), start_s)

    def _on_message(self, readers: list[ObservationReader], message: object) -> None:
        start_s = time.perf_counter()
        now_ns = self._node.get_clock().now().nanoseconds

        if not readers[0].entry.context and position_columns(readers[0].entry) is not None:
            frame_id = getattr(getattr(message, "header", None), "frame_id", "")
            self.frame = frame_id or self.frame

        def read(reader: ObservationReader) -> Observation | None:
            stamp = stamp_of(reader.entry, message, now_ns)
            return None if stamp is None else reader.observe(stamp, message)

        self._take(readers, read, start_s)

    def _take(
        self,
        readers: list[ObservationReader],
        read: Callable[[ObservationReader], Observation | None],
        start_s: float,
    ) -> None:
        topic = readers[0].entry.topic
        self._diagnostics.tick(topic)
        used = False
        for reader in readers:
            try:
                observation = read(reader)
            except MessageError as error:
                self._diagnostics.reject("missing_dof", str(error))
                continue
            take = self._use_context if reader.entry.context else self._use
            if observation is not None and take(observation, topic):
                used = True
                if len(observation.values) < len(reader.entry.names):
                    self._diagnostics.tick(f"{topic}, in part")
        if used:
            self._diagnostics.latency(time.perf_counter() - start_s)
