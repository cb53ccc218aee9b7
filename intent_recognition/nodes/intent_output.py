# SPDX-License-Identifier: Apache-2.0
"""Outputs of the estimator node: tasks, predictions of both agents, and markers for RViz."""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3
from nav_msgs.msg import Path
from numpy.typing import ArrayLike
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import (
    numbers_of,
    orientation_beside,
    position_columns,
    reference_of,
)
from intent_recognition.gaussian import tube_faces, tube_rings
from intent_recognition.model import Model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    TrajectoryBuilder,
    to_joint_state,
    to_point,
    to_pose,
    to_stamp,
)
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.frames import FrameOutput
from intent_recognition.recognition import Estimate, Prediction
from intent_recognition.report import INK, NONE_COLOUR, readable, task_colours
from intent_recognition.signals import Observation, from_tangent

RESTED_NS = 39_000_000
"""Least time between places of a person who rests [ns]: 25 Hz, with jitter of the stamps."""


class IntentOutput:
    """Publishes estimates and predictions of one person; a single person has no name."""

    _model: Model
    """Set by `configure`."""

    def __init__(
        self, node: Node, diagnostics: Diagnostics, frames: FrameOutput, person: str = ""
    ) -> None:
        publish, prefix = node.create_publisher, f"intent/{person}/" if person else "intent/"
        self._diagnostics, self._frames = diagnostics, frames
        self._hand_frame = f"predicted_hand_{person}" if person else "predicted_hand"
        self.tasks = publish(JointState, f"{prefix}tasks", qos.STATE)
        self.trajectory = publish(JointTrajectory, f"{prefix}robot_trajectory", qos.COMMAND)
        self._path = publish(Path, f"{prefix}human_path", qos.COMMAND)
        self.human_trajectory = publish(JointTrajectory, f"{prefix}human_trajectory", qos.COMMAND)
        self._markers = publish(MarkerArray, f"{prefix}markers", qos.COMMAND)

    def configure(self, model: Model) -> None:
        """Set the model, before anything is published."""
        self._robot_builder = TrajectoryBuilder(model.dofs.controlled_message_names)
        self._human_builder = TrajectoryBuilder(model.library.observed_names)
        self._marker_builder = MarkerBuilder(model.labels)
        columns = map(position_columns, model.dofs.observed)
        self._shown = next(((g, c) for g, c in enumerate(columns) if c is not None), None)
        self._last_robot: tuple[Prediction, bytes] | None = None
        self._model = model
        # newest value of each observed DOF and its standard deviation
        self._newest, self._rested_ns = np.full((2, model.library.n_observed), np.nan), 0

    def swap(self, model: Model) -> None:
        """Replace the model by one of the same DOFs."""
        self._model = model
        self._marker_builder.set_labels(model.labels)

    def forget(self) -> None:
        """Clear the observed path, and where the human is."""
        self._marker_builder.forget()
        self._newest[:], self._rested_ns = np.nan, 0

    def observe(self, observation: Observation) -> None:
        """Add an observation to the path that the markers show."""
        group, columns = self._shown or (None, [])
        if observation.group == group and observation.dofs is None and not observation.derivative:
            self._marker_builder.observe(observation.stamp_ns, observation.values[columns])

    def publish_tasks(self, estimate: Estimate) -> None:
        """Publish the probabilities of the tasks."""
        numbers = estimate.probabilities, estimate.phase, estimate.log_evidence
        self.tasks.publish(to_joint_state(estimate.labels, *numbers, time_ns=estimate.stamp_ns))
        self._diagnostics.tick("intent/tasks")

    def publish_robot(self, robot: Prediction) -> None:
        """Publish a prediction of the robot; an unchanged one is not serialized again."""
        if self._last_robot is None or robot is not self._last_robot[0]:
            numbers = numbers_of(self._model.dofs.controlled, robot.trajectory)
            built = self._robot_builder.build(robot.onset_ns, *numbers, frame_id=robot.task)
            self._last_robot = robot, serialize_message(built)
        self.trajectory.publish(self._last_robot[1])
        self._diagnostics.tick("intent/robot_trajectory")

    @property
    def human_shown(self) -> bool:
        """Whether anybody subscribes to the human's predicted path, its markers or its frame."""
        outputs = self._path, self._markers
        return self._frames.heard or any(one.get_subscription_count() for one in outputs)

    @property
    def human_wanted(self) -> bool:
        """Whether anybody subscribes to the human's predicted trajectory."""
        return bool(self.human_trajectory.get_subscription_count())

    def publish_place(self, observation: Observation, rests: bool) -> None:
        """Note where the human is; at rest, publish it as a trajectory of one point at 25 Hz."""
        if observation.derivative or not self.human_wanted:
            return
        values, covariance = observation.values, observation.covariance
        dofs = self._model.library.observed_dofs(observation.group, observation.dofs)
        std = np.zeros(len(values)) if covariance is None else np.sqrt(np.diagonal(covariance))
        self._newest[:, dofs] = values, std
        due = abs(observation.stamp_ns - self._rested_ns) >= RESTED_NS
        if rests and due and np.all(np.isfinite(self._newest)):
            self._rested_ns, (place, std) = observation.stamp_ns, self._newest[:, None]
            still = np.zeros_like(place)
            self._publish_human(observation.stamp_ns, "", [0.0], place, still, std)

    def publish_human(self, estimate: Estimate, human: Prediction, frame: str) -> None:
        """Publish a prediction of the human on the topics that have subscribers."""
        along = human.trajectory
        if self.human_wanted:
            self._publish_human(human.onset_ns, human.task, *along)
        if self._shown is None or not self.human_shown:
            return
        group, of_signal = self._shown
        columns = self._model.library.observed_dofs(group)[of_signal]
        positions, turned = along.positions[:, columns], self._orientations(group, human)
        path = to_path(estimate.stamp_ns, frame, human, positions, turned)
        self._path.publish(path)
        self._frames.send(estimate.stamp_ns, frame, self._hand_frame, path.poses[-1].pose)
        if self._markers.get_subscription_count():
            best = float(np.max(estimate.probabilities))
            shown = human.task, best, positions, along.std[:, columns]
            self._markers.publish(self._marker_builder.build(estimate.stamp_ns, frame, *shown))

    def _publish_human(self, onset_ns: int, task: str, *along: ArrayLike) -> None:
        message = self._human_builder.build(onset_ns, *along, frame_id=task)
        self.human_trajectory.publish(message)
        self._diagnostics.tick("intent/human_trajectory")

    def _orientations(self, group: int, human: Prediction) -> Floats | None:
        """Predicted quaternions (T, 4) of the shown body; None if its orientation is not a DOF."""
        entries = self._model.dofs.observed
        beside = orientation_beside(entries, group)
        if beside is None:
            return None
        vectors = human.trajectory.positions[:, self._model.library.observed_dofs(beside)]
        return from_tangent(vectors, reference_of(entries[beside]))


TUBE_FACES = tube_faces().ravel()


def to_path(
    time_ns: int, frame: str, human: Prediction, positions: Floats, orientations: Floats | None
) -> Path:
    """Path of the predicted rest of the movement, each pose stamped with its expected time.

    Positions are (T, 3) [m], orientations quaternions (T, 4) xyzw; None for no rotation.
    """
    none = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
    turned = none if orientations is None else orientations
    message = Path()
    message.header.stamp = to_stamp(time_ns)
    message.header.frame_id = frame
    at_s = human.trajectory.times_s
    for elapsed_s, position, quaternion in zip(at_s, positions, turned, strict=True):
        pose = PoseStamped()
        pose.header.frame_id = frame
        pose.header.stamp = to_stamp(human.onset_ns + round(float(elapsed_s) * 1e9))
        pose.pose = to_pose(position, quaternion)
        message.poses.append(pose)
    return message


def colour(name: str, opacity: float = 1.0) -> ColorRGBA:
    """Message of the colour "#rrggbb"."""
    r, g, b = (int(name[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return ColorRGBA(r=r, g=g, b=b, a=opacity)


class MarkerBuilder:
    """Keeps the observed path of the movement under way, and draws it and the predicted path.

    The prediction has the colour of its task on the page and in the reports.
    """

    def __init__(self, labels: Sequence[str]):
        self._colours = task_colours(labels)
        self._observed: list[Floats] = []
        self._last_ns = 0

    def set_labels(self, labels: Sequence[str]) -> None:
        """Change the tasks; those that stay keep their colours."""
        self._colours = task_colours(labels, self._colours)

    def forget(self) -> None:
        """Begin a new path."""
        self._observed.clear()

    def observe(self, stamp_ns: int, position: Floats) -> None:
        """Add one observed position (3,) [m]; a gap of half a second begins a new path."""
        if abs(stamp_ns - self._last_ns) > 500_000_000:
            self._observed.clear()
        self._last_ns = stamp_ns
        self._observed.append(position)
        del self._observed[:-500]

    def build(
        self,
        time_ns: int,
        frame: str,
        task: str,
        probability: float,
        predicted: Floats,
        std: Floats,
    ) -> MarkerArray:
        """Draw both paths, the tube and the label.

        The predicted rest of the path and its standard deviation are (T, 3) each [m].
        """
        own = self._colours.get(task, NONE_COLOUR)
        kinds = *[Marker.LINE_STRIP] * 2, Marker.TRIANGLE_LIST, Marker.TEXT_VIEW_FACING
        observed, future, tube, text = (
            self._marker(time_ns, frame, number, kind) for number, kind in enumerate(kinds)
        )
        observed.points = [to_point(position) for position in self._observed]
        observed.scale.x = future.scale.x = 0.006  # [m]
        observed.color, future.color = colour(INK), colour(own)
        future.points = [to_point(position) for position in predicted]
        tube.ns, tube.color = "tube", colour(own, 0.15)
        corners = tube_rings(predicted, std).reshape(-1, 3)[TUBE_FACES]
        tube.points = [to_point(corner) for corner in corners]
        tube.scale = Vector3(x=1.0, y=1.0, z=1.0)
        text.text, text.scale.z = f"{readable(task)} {probability:.0%}", 0.06
        text.color = colour(own)
        text.pose.position = to_point(predicted[-1] + np.array([0.0, 0.0, 0.1]))
        return MarkerArray(markers=[observed, future, tube, text])

    @staticmethod
    def _marker(time_ns: int, frame: str, number: int, kind: int) -> Marker:
        marker = Marker(ns="intent", id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = to_stamp(time_ns)
        marker.header.frame_id = frame
        marker.pose.orientation.w = 1.0
        marker.lifetime.sec = 2
        return marker
