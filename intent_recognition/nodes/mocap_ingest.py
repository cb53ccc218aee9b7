# SPDX-License-Identifier: Apache-2.0
"""Node: turns raw tracker poses `mocap/<body>/pose` into world-frame odometry `human/<body>`."""

import time
from collections import deque
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher

from intent_recognition.errors import ArgumentError, MessageError
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    OdometryBuilder,
    PoseNumbers,
    prepare_reading,
    read_pose,
    to_pose,
)
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.frames import FrameOutput, hear_frames
from intent_recognition.nodes.parameters import Changes, declare, keep_live
from intent_recognition.nodes.people import ANYBODY, IdentityInput, meet, named_people
from intent_recognition.nodes.runtime import (
    LeftOvers,
    elapsed_s,
    now_ns,
    run,
    steady_timer,
    when_clock_goes_back,
)
from intent_recognition.signals import place_misfit
from intent_recognition.tracking import (
    IngestSettings,
    IngestState,
    NoTransformError,
    Rejected,
    StampWatch,
    TransformTree,
    frame_name,
    ingest_pose,
    multiply_quaternions,
    parse_extrinsics,
)

LIVE = {
    "max_speed": "max_speed_m_s",
    "max_gap": "max_gap_s",
    "position_std": "position_std_m",
    "orientation_std_rad": "orientation_std_rad",
    "reanchor_after": "reanchor_after",
}
"""Parameters that may change while the node runs, with their fields of `IngestSettings`."""


class MocapIngest(Node):
    """Passes poses to `tracking.ingest_pose` and publishes the results; one state per body."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("mocap_ingest", **kwargs)
        values = declare(self, "mocap_ingest")
        bodies = [body for body in values["bodies"] if body]
        if not bodies or len(set(bodies)) != len(bodies):
            expected, cure = "different names", "Use e.g. [wrist]."
            raise ArgumentError.about("parameter bodies", expected, values["bodies"], cure)
        self._settings = IngestSettings(
            world_frame=values["world_frame"],
            extrinsics=parse_extrinsics(values["extrinsics"]),
            **{field: values[name] for name, field in LIVE.items()},
        )
        self._diagnostics = Diagnostics(self)
        prepare_reading()
        self._states: dict[str, IngestState] = {}
        self._waiting: dict[str, deque[tuple[float, PoseNumbers]]] = {}
        self._stamps: dict[str, StampWatch] = {}
        self._wait_s: float = values["tf_wait"]
        self._tree = TransformTree()
        self._hears = self._wait_s > 0.0 and hear_frames(self, self._tree, self._look)
        if self._hears:
            steady_timer(self, 0.05, self._look)
        self._frames = FrameOutput(self)
        self._frames.send_fixed(
            now_ns(self),
            self._settings.world_frame,
            {
                frame: to_pose(transform.translation, transform.quaternion)
                for frame, transform in self._settings.frames.items()
                if frame != frame_name(self._settings.world_frame)
            },
        )
        self._outputs: dict[str, Publisher] = {}
        self._builders: dict[str, OdometryBuilder] = {}
        self._identity: IdentityInput | None = None
        if people := named_people(self):
            self._identity = IdentityInput(bodies[0], self._ingest_of, self._diagnostics)
            # publishers of named people exist before the first pose, so that subscribers find them
            for person in people:
                for body in bodies if person != ANYBODY else ():
                    self._add_output(f"{person}/{body}")
        for body in [] if self._identity else bodies:
            self._add_output(body)
            self._hear(body)

        def hear_all(label: str) -> None:
            for body in bodies:
                self._hear(f"{label}/{body}")

        meet(self, f"mocap/{{}}/{bodies[0]}/pose", hear_all)
        keep_live(self, LIVE, self._changed, self._change)
        self._left_overs = LeftOvers()  # by the tracker's label and body
        when_clock_goes_back(self, self._start_over)

    def _hear(self, body: str) -> None:
        self._waiting[body], self._stamps[body] = deque(), StampWatch()
        topic, take = f"mocap/{body}/pose", partial(self._on_pose, body)
        needed = self._identity is None  # people come and go
        self._diagnostics.subscribe(PoseStamped, topic, take, qos.SENSOR, needed=needed, raw=True)

    def _add_output(self, body: str) -> None:
        self._states[body] = IngestState()
        self._outputs[body] = self.create_publisher(Odometry, f"human/{body}", qos.SENSOR)
        self._builders[body] = OdometryBuilder(body, self._settings.world_frame)

    def _start_over(self) -> None:
        if self._identity is not None:
            self._identity.forget()
        self._left_overs.start_over()
        self._states = dict.fromkeys(self._states, IngestState())
        for body, waiting in self._waiting.items():
            waiting.clear()
            self._stamps[body] = StampWatch()

    def _changed(self, changes: Changes) -> IngestSettings:
        fields: dict[str, Any] = {LIVE[name]: value for name, value in changes.items()}
        return replace(self._settings, **fields)

    def _change(self, changes: Changes) -> None:
        self._settings = self._changed(changes)

    def _on_pose(self, body: str, data: bytes) -> None:
        try:
            measured = read_pose(data)
        except MessageError as error:
            self._diagnostics.reject("malformed", f"{body}: {error}")
            return
        if self._left_overs.include(body, measured.stamp_ns):
            self._diagnostics.count("left_over")
            return
        stamp_ns, arrival_s = measured.stamp_ns, elapsed_s(self)
        if self._identity is None and self._stamps[body].leaps(stamp_ns, arrival_s):
            self._diagnostics.reject("stamp_jumped", f"{body}: stamp {stamp_ns} ns came too early")
            return
        newest = self._left_overs.last_ns
        newest[body] = max(stamp_ns, newest.get(body, 0))
        waiting = self._waiting[body]
        if waiting or (self._hears and frame_name(measured.frame_id) not in self._settings.frames):
            if len(waiting) >= 1000:
                waiting.popleft()
                self._diagnostics.reject("after_transforms", f"{body}: 1000 poses wait")
            waiting.append((arrival_s, measured))
            self._look()
        else:
            self._identified(body, measured)

    def _look(self) -> None:
        """Use waiting poses in order, as their transforms come; reject those that wait too long."""
        for body, waiting in self._waiting.items():
            while waiting:
                since_s, measured = waiting[0]
                try:
                    placed = self._in_world(measured)
                except NoTransformError as error:
                    if error.may_come and elapsed_s(self) - since_s < self._wait_s:
                        break
                    waiting.popleft()
                    self._diagnostics.reject(error.reason, f"{body}: {error}")
                    continue
                waiting.popleft()
                self._identified(body, placed)

    def _in_world(self, measured: PoseNumbers) -> PoseNumbers:
        known = frame_name(measured.frame_id) in self._settings.frames
        if known or measured.stamp_ns <= 0 or not np.isfinite(measured.pose).all():
            return measured  # unchanged, for `ingest_pose` to check
        world = self._settings.world_frame
        frame = self._tree.lookup(world, measured.frame_id, measured.stamp_ns)
        turned = multiply_quaternions(frame.quaternion, measured.pose[3:])
        pose = np.concatenate([frame.apply(measured.pose[:3]), turned])
        return measured._replace(frame_id=world, pose=pose)

    def _identified(self, body: str, measured: PoseNumbers) -> None:
        if self._identity is None:
            self._ingest(body, measured)
        else:
            label, _, own = body.partition("/")
            self._identity.take(label, own, measured, self._settings)

    def _ingest_of(self, person: str, body: str, measured: PoseNumbers) -> None:
        name = f"{person}/{body}"
        if name not in self._outputs:
            self._add_output(name)
        self._ingest(name, measured)

    def _ingest(self, body: str, measured: PoseNumbers) -> None:
        start_s = time.perf_counter()
        first = not self._states[body].recent
        pose = measured.pose[:3], measured.pose[3:], measured.frame_id
        self._states[body], result = ingest_pose(
            self._settings, self._states[body], measured.stamp_ns, *pose
        )
        if isinstance(result, Rejected):
            self._diagnostics.reject(result.reason, f"{body}: {result.detail}")
            return
        misfit = place_misfit(measured.pose[:3]) if first else None
        if misfit is not None:
            self._diagnostics.count("unit_doubtful")
            self.get_logger().warning(f"{body} {misfit.reason}")
        if result.reanchored:
            self._diagnostics.count("track_restarted")
            self.get_logger().warning(f"{body}: track restarted at {result.position.round(3)} m")
        message = self._builders[body].build(result, self._settings.orientation_std_rad**2)
        self._outputs[body].publish(message)
        name, world = f"human_{body.replace('/', '_')}", self._settings.world_frame
        self._frames.send(result.stamp_ns, world, name, message.pose.pose)
        self._diagnostics.tick(f"human/{body}")
        self._diagnostics.latency(time.perf_counter() - start_s)


main = partial(run, MocapIngest)
