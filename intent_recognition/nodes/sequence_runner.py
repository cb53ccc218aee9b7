# SPDX-License-Identifier: Apache-2.0
"""Sequences of tasks in the activation node: follows their progress, and orders the next step."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.activation import Activation, PredictedInteraction
from intent_recognition.array_types import Floats
from intent_recognition.composing import (
    Moment,
    SequenceProgress,
    Step,
    ViaPoint,
    advance,
    awaited,
    bend_all,
    read_sequences,
    read_via_points,
)
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Arm
from intent_recognition.motion import JointPath
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array
from intent_recognition.nodes.diagnostics import Diagnostics, key_values
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import elapsed_s, when_clock_goes_back
from intent_recognition.promp import TaskLibrary, Trajectory, largest_by_unit
from intent_recognition.untrusted import read_named

MakePath = Callable[[Trajectory], JointPath]
FindArm = Callable[[], Arm | None]


class SequenceRunner:
    """Follows the sequences of the parameter `sequences`, and orders steps whose condition holds.

    `intent/sequence` shows the progress in a diagnostic_msgs/DiagnosticStatus: its name is the
    sequence, empty outside of any, and its values are `task`, `step` and `when`.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._node, self._diagnostics = node, diagnostics
        self._path = declare(node, "sequences")["sequences"]
        self._sequences: dict[str, tuple[Step, ...]] = {}
        self._library: TaskLibrary | None = None
        self._points: tuple[ViaPoint, ...] = ()
        self._progress = SequenceProgress()
        self._heard: set[str] = set()
        self._places: dict[str, tuple[float, Floats]] = {}
        self._rest_since_s: float | None = None
        self._tried_s = -math.inf
        self._published: tuple | None = None
        if self._path:
            self._publisher = node.create_publisher(
                DiagnosticStatus, "intent/sequence", qos.LATCHED
            )
            when_clock_goes_back(node, self.forget)
            node.create_subscription(String, "intent/via_points", self._take_points, qos.LATCHED)

    def configure(self, library: TaskLibrary | None) -> None:
        """Read the file, and subscribe to the bodies that its conditions name."""
        if not self._path:
            return
        if library is None:
            raise ArgumentError.about("sequences", "a model", "none", "Set the parameter model.")
        parse = partial(read_sequences, labels=library.labels)
        found = read_named(Path(self._path), "sequences", "Name a YAML file.", parse)
        self._library, self._sequences = library, found
        steps = [step for steps in self._sequences.values() for step in steps]
        for body in sorted({step.when.body for step in steps} - {"", *self._heard}):
            self._heard.add(body)
            take = partial(self._take_place, body)
            self._node.create_subscription(Odometry, f"human/{body}", take, qos.SENSOR)

    def update(self, activation: Activation, make_path: MakePath, arm: FindArm) -> None:
        """Follow what the arm does, and order the next step if its condition holds.

        Paths are made of trajectories of the library's controlled DOFs; via points are of the hand
        of `arm`, if that is known.
        """
        if not self._sequences or self._library is None:
            return
        before = self._progress
        moment = self._moment(activation)
        self._progress = advance(self._sequences, before, moment)
        if self._progress.ordered != before.ordered:
            activation.inbox.order(None)
            self._tried_s = -math.inf
        step = awaited(self._sequences, self._progress)
        lost = self._progress.ordered and activation.inbox.ordered is None
        if step is not None and lost and moment.now_s - self._tried_s >= 1.0:
            self._tried_s = moment.now_s
            activation.inbox.order(self._prediction(self._library, step.task, make_path, arm))
        self._publish()

    def forget(self) -> None:
        """Leave the sequence and forget all times, after a reset or when the clock went back."""
        self._progress = SequenceProgress(n_started=self._progress.n_started)
        self._rest_since_s, self._tried_s = None, -math.inf
        self._places.clear()

    def _moment(self, activation: Activation) -> Moment:
        now_s = elapsed_s(self._node)
        if not activation.inbox.decision.idle:
            self._rest_since_s = None
        elif self._rest_since_s is None:
            self._rest_since_s = now_s
        resting_s = 0.0 if self._rest_since_s is None else now_s - self._rest_since_s
        places = {body: at for body, (seen_s, at) in self._places.items() if now_s - seen_s <= 0.5}
        n_started, task = activation.counts["started"], activation.active_task
        return Moment(now_s, n_started, task, activation.arrived, resting_s, places)

    def _prediction(
        self, library: TaskLibrary, task: str, make_path: MakePath, arm: FindArm
    ) -> PredictedInteraction | None:
        with self._diagnostics.rejecting("bad_step", task):
            number = library.labels.index(task)
            points = [
                replace(point, task=task) for point in self._points if point.task in ("", task)
            ]
            bent = bend_all(library, points, arm() if points else None)
            trajectory = bent.primitive(number).predict_controlled(50)
            end_std = largest_by_unit(trajectory.std[-1], library.controlled_units)
            return PredictedInteraction(task, 0, make_path(trajectory), end_std)
        return None

    def _publish(self) -> None:
        progress, step = self._progress, awaited(self._sequences, self._progress)
        shown = (progress.name, progress.step, progress.running)
        if shown == self._published:
            return
        self._published = shown
        message = DiagnosticStatus(name=progress.name, message="no sequence")
        if step is not None:
            count = f"{progress.step + 1} of {len(self._sequences[progress.name])}"
            what = "runs" if progress.running else f"waits: {step.when}"
            message.message = f"{step.task} ({count}) {what}"
            rows = {"task": step.task, "step": count, "when": str(step.when)}
            message.values = key_values(rows)
        self._publisher.publish(message)
        self._diagnostics.value("sequence", f"{progress.name} {message.message}".strip())
        self._node.get_logger().info(f"sequence: {progress.name} {message.message}")

    def _take_place(self, body: str, message: Odometry) -> None:
        place = position_array(message.pose.pose)
        if np.all(np.isfinite(place)):
            self._places[body] = elapsed_s(self._node), place

    def _take_points(self, message: String) -> None:
        with self._diagnostics.rejecting("bad_via_points"):
            self._points = read_via_points(message.data)
