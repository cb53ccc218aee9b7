# SPDX-License-Identifier: Apache-2.0
"""Input of the estimator node: from the messages of the observed topics to observations."""

import time
from collections.abc import Callable
from functools import partial

from nav_msgs.msg import Odometry
from rclpy.node import Node

from intent_recognition.demonstrations import (
    DofEntry,
    DofSpec,
    ObservationReader,
    is_raw_pose,
    observation_readers,
    position_columns,
    stamp_of,
)
from intent_recognition.errors import MessageError, describe, printable
from intent_recognition.model import Frames
from intent_recognition.nodes import qos
from intent_recognition.nodes.backlog import Backlog
from intent_recognition.nodes.conversions import message_class, prepare_reading, read_odometry
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.signals import Observation
from intent_recognition.tracking import frame_name

CURE = (
    "They are used as they are, and the estimate is likely wrong. Train with `extrinsics` in the"
    " DOF file, or let mocap_ingest (or the source) publish in the frame of the demonstrations."
)


def human_topic(entry: DofEntry, person: str = "") -> str:
    """Topic on which mocap_ingest republishes a raw pose topic: human/[<person>/]<body>."""
    *prefix, _, body, _ = entry.topic.split("/")
    return "/".join([*prefix, "human", *([person] if person else []), body])


class ObservationInput:
    """Subscribes to each observed topic; all DOF entries of a topic read its messages.

    `observe` takes an observation and the name of its topic, and returns False if it refuses them;
    `observe_context` does the same for samples of the scene. Poses of a named person are read from
    human/<person>/<body> and their other signals from <person>/<topic>; all people share the
    scene's topics. Messages that cannot be read are counted under `missing_dof` or `malformed`.
    """

    def __init__(
        self,
        node: Node,
        diagnostics: Diagnostics,
        observe: Callable[[Observation, str], bool],
        observe_context: Callable[[Observation, str], bool],
        person: str = "",
    ):
        self.frame, self._person = "world", person
        self._node, self._diagnostics = node, diagnostics
        self._observe, self._observe_context = observe, observe_context
        self._backlog = Backlog(partial(diagnostics.count, "dropped_behind"))
        self._kinds: dict[str, type] = {}
        self._placed: set[str] = set()
        self.learned_in({})

    def configure(self, dofs: DofSpec) -> None:
        """Set the DOFs, and find their message types.

        Raises:
            MessageError: a message type is not installed.
        """
        self._dofs = dofs
        entries = (*dofs.observed, *dofs.velocities, *dofs.context)
        self._kinds = {entry.type: message_class(entry.type) for entry in entries}
        self._placed = {e.topic for e in dofs.observed if position_columns(e) is not None}

    def learned_in(self, frames: Frames) -> None:
        """Set the frames of the model, to warn once per topic of poses in other frames."""
        self._frames = frames
        self._warned: set[str] = set()

    def open(self) -> None:
        """Subscribe."""
        prepare_reading()
        by_topic: dict[str, list[ObservationReader]] = {}
        scene = [ObservationReader(entry, k) for k, entry in enumerate(self._dofs.context)]
        for reader in (*observation_readers(self._dofs), *scene):
            by_topic.setdefault(reader.entry.topic, []).append(reader)
        for topic, readers in by_topic.items():
            entry = readers[0].entry
            raw = is_raw_pose(topic, entry.type)
            kind = Odometry if raw else self._kinds[entry.type]
            name = self._heard_on(entry, raw)
            callback = partial(self._on_odometry if raw else self._on_message, name, readers)
            # 10 s at 100 Hz: nothing is lost while a movement is filtered again (onset, new model).
            deep = qos.keep_last(1000, reliable=False)
            source = self._backlog.subscribe(self._node, kind, name, callback, deep, raw=raw)
            context = any(reader.entry.context for reader in readers)
            self._diagnostics.watch(source, name, needed=not (context or self._person))
            if context:  # a latched sample may have been sent before
                self._backlog.subscribe(self._node, kind, name, callback, qos.LATCHED, raw=raw)

    def _heard_on(self, entry: DofEntry, raw: bool) -> str:
        person = "" if entry.context else self._person
        if raw:
            return human_topic(entry, person)
        return f"{person}/{entry.topic.lstrip('/')}" if person else entry.topic

    def close(self) -> None:
        """Unsubscribe."""
        self._diagnostics.unwatch(self._backlog.close(self._node))

    def _on_odometry(self, name: str, readers: list[ObservationReader], data: bytes) -> None:
        """Take a tracked pose, without its twist, which is computed from poses."""
        start_s = time.perf_counter()
        self._diagnostics.tick(name)
        try:
            stamp, frame_id, pose, covariance = read_odometry(data)
        except MessageError as error:
            self._diagnostics.reject("malformed", str(error))
            return
        self._note_frame(readers[0].entry.topic, frame_id)
        self._take(readers, lambda one: one.observe_pose(stamp, pose, covariance), start_s)

    def _on_message(self, name: str, readers: list[ObservationReader], message: object) -> None:
        start_s = time.perf_counter()
        self._diagnostics.tick(name)
        now_ns = self._node.get_clock().now().nanoseconds
        frame_id = getattr(getattr(message, "header", None), "frame_id", "")
        self._note_frame(readers[0].entry.topic, frame_id)

        def read(reader: ObservationReader) -> Observation | None:
            stamp = stamp_of(reader.entry, message, now_ns)
            return None if stamp is None else reader.observe(stamp, message)

        self._take(readers, read, start_s)

    def _note_frame(self, topic: str, frame_id: str) -> None:
        """Count poses in another frame than the model was learned in, and warn of the first."""
        if topic in self._placed:
            self.frame = frame_id or self.frame
        learned = self._frames.get(topic)
        if not learned or not frame_id or learned == (frame_name(frame_id),):
            return
        self._diagnostics.tick(f"{topic}, in another frame")
        if topic not in self._warned:
            self._warned.add(topic)
            frames = " and ".join(map(repr, learned))
            expected = f"poses in the frame of the demonstrations, {frames}"
            text = printable(describe(topic, expected, repr(frame_id), CURE))
            self._node.get_logger().warning(text)

    def _take(
        self,
        readers: list[ObservationReader],
        read: Callable[[ObservationReader], Observation | None],
        start_s: float,
    ) -> None:
        topic = readers[0].entry.topic
        used = False
        for reader in readers:
            try:
                observation = read(reader)
            except MessageError as error:
                self._diagnostics.reject("missing_dof", str(error))
                continue
            observe = self._observe_context if reader.entry.context else self._observe
            if observation is not None and observe(observation, topic):
                used = True
                if len(observation.values) < len(reader.entry.names):
                    self._diagnostics.tick(f"{topic}, in part")
        if used:
            self._diagnostics.latency(time.perf_counter() - start_s)
