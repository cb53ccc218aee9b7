# SPDX-License-Identifier: Apache-2.0
"""Serialized messages: the numbers that a node needs are read from and written to their bytes.

To publish a message object, rclpy converts it to C, point by point and field by field, and
serializes that; to receive one, it makes an object of every field. Messages of the same lengths
have their numbers at the same places, which `bags.find_layout` knows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from numpy.typing import ArrayLike, NDArray
from rclpy.serialization import deserialize_message, serialize_message

from intent_recognition.bags import (
    JOINT_STATE,
    LITTLE_ENDIAN,
    NANOSECONDS,
    POSE,
    LayoutCache,
    SerializedTemplate,
    header_stamp_ns,
)
from intent_recognition.errors import MessageError
from intent_recognition.nodes.conversions import TrajectoryBuilder, to_joint_state
from intent_recognition.tracking import UNKNOWN_VARIANCE, TrackedPose

MAX_TEMPLATES = 32
"""Trajectories of different frames and lengths kept ready. Convention; a node needs one a task."""
ODOMETRY = "nav_msgs/msg/Odometry"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


class PoseNumbers(NamedTuple):
    """What a node uses of a pose.

    Attributes:
        stamp_ns: of the header.
        frame_id: of the header.
        pose: position [m] and orientation xyzw, (7,).
        covariance: of position and rotation, (6, 6), None in a message without one.
    """

    stamp_ns: int
    frame_id: str
    pose: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None


_POSES, _ODOMETRIES = LayoutCache(POSE), LayoutCache(ODOMETRY)


def read_pose(data: bytes) -> PoseNumbers:
    """Numbers of a serialized PoseStamped.

    Raises:
        MessageError: it ends too early, or its frame is not UTF-8.
    """
    return _read(data, PoseStamped, _POSES, "pose")


def read_odometry(data: bytes) -> PoseNumbers:
    """Numbers of the pose in a serialized Odometry.

    Raises:
        MessageError: it ends too early, or a frame is not UTF-8.
    """
    return _read(data, Odometry, _ODOMETRIES, "pose.pose", "pose.covariance")


def _read(
    data: bytes, kind: type, layouts: LayoutCache, pose: str, covariance: str = ""
) -> PoseNumbers:
    if data[:2] != LITTLE_ENDIAN:  # of another machine: rclpy puts the bytes in order
        data = serialize_message(deserialize_message(data, kind))
    try:
        layout = layouts.layout_of(data)
    except ValueError as error:
        raise MessageError.about(
            "message", "a whole one", error, "Check who publishes it."
        ) from error
    (frame_id,) = layout.texts["header.frame_id"]
    matrix = layout.values(data, covariance).reshape(6, 6) if covariance else None
    return PoseNumbers(header_stamp_ns(data), frame_id, layout.values(data, pose), matrix)


class _Trajectory(NamedTuple):
    """The template of trajectories of one frame and length, and where to write to.

    Attributes:
        template: the message.
        values: of positions, velocities and efforts in its doubles, (3, T, d).
        times: of each point's time in its integers, (T, 2).
    """

    template: SerializedTemplate
    values: NDArray[np.intp]
    times: NDArray[np.intp]


class SerializedTrajectory:
    """JointTrajectory messages with positions, velocities and efforts."""

    def __init__(self, names: Sequence[str]):
        self._names = list(names)
        self._known: dict[tuple[str, int], _Trajectory] = {}

    def build(
        self,
        time_ns: int,
        times_s: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike,
        efforts: ArrayLike,
        *,
        frame_id: str = "",
    ) -> bytes:
        """As `TrajectoryBuilder.build`, serialized; arrays (T, d).

        Raises:
            ShapeError: an array is not (T, d).
        """
        times_ns = np.rint(np.asarray(times_s) * 1e9).astype(np.int64)
        key = frame_id, times_ns.size
        if key not in self._known:
            if len(self._known) >= MAX_TEMPLATES:
                self._known.clear()
            self._known[key] = self._prepare(*key)
        template, places, times = self._known[key]
        for place, values in zip(places, (positions, velocities, efforts), strict=True):
            template.doubles[place] = values
        template.stamp(time_ns)
        template.integers[times] = np.stack(np.divmod(times_ns, NANOSECONDS), axis=1)
        return template.to_bytes()

    def _prepare(self, frame_id: str, count: int) -> _Trajectory:
        zeros = np.zeros((count, len(self._names)))
        message = TrajectoryBuilder(self._names).build(
            0, np.zeros(count), zeros, zeros, zeros, frame_id=frame_id
        )
        template = SerializedTemplate(TRAJECTORY, serialize_message(message))
        values, times = (
            [[template.indices(f"points[{k}].{field}") for k in range(count)] for field in fields]
            for fields in (("positions", "velocities", "effort"), ("time_from_start",))
        )
        return _Trajectory(template, np.array(values), np.array(times[0]))


class SerializedNamedVector:
    """JointState messages with position, velocity and effort of fixed names."""

    def __init__(self, names: Sequence[str]):
        message = to_joint_state(names, *np.zeros((3, len(names))), time_ns=0)
        self._template = SerializedTemplate(JOINT_STATE, serialize_message(message))
        self._columns = [self._template.view(name) for name in ("position", "velocity", "effort")]

    def build(
        self, time_ns: int, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike
    ) -> bytes:
        """As `to_joint_state`, serialized; arrays (d,)."""
        for column, values in zip(self._columns, (position, velocity, effort), strict=True):
            column[:] = values
        self._template.stamp(time_ns)
        return self._template.to_bytes()


class SerializedOdometry:
    """Odometry messages of tracked poses; what was not measured has `UNKNOWN_VARIANCE`.

    Args:
        body: the tracked body.
        world_frame: frame of the poses.
        orientation_variance: of a measured orientation [rad^2].
    """

    def __init__(self, body: str, world_frame: str, orientation_variance: float):
        self.orientation_variance = orientation_variance
        message = Odometry(child_frame_id=f"{body}_world_aligned")
        message.header.frame_id = world_frame
        self._template = SerializedTemplate(ODOMETRY, serialize_message(message))
        view = self._template.view
        self._pose = view("pose.pose")
        self._pose_covariance = view("pose.covariance").reshape(6, 6)
        self._velocity = view("twist.twist.linear")
        self._twist_covariance = view("twist.covariance").reshape(6, 6)
        self._turn_variances = np.einsum("ii->i", self._pose_covariance[3:, 3:])  # a view
        np.fill_diagonal(self._twist_covariance[3:, 3:], UNKNOWN_VARIANCE)

    def build(self, pose: TrackedPose) -> bytes:
        """The message of an accepted pose."""
        self._pose[:3], self._pose[3:] = pose.position, pose.orientation
        turn = self.orientation_variance if pose.orientation_measured else UNKNOWN_VARIANCE
        self._pose_covariance[:3, :3] = pose.position_covariance
        self._turn_variances[:] = turn
        if pose.velocity is None:
            self._velocity[:] = 0.0
            self._twist_covariance[:3, :3] = np.eye(3) * UNKNOWN_VARIANCE
        else:
            self._velocity[:] = pose.velocity
            self._twist_covariance[:3, :3] = pose.velocity_covariance
        self._template.stamp(pose.stamp_ns)
        return self._template.to_bytes()
