# SPDX-License-Identifier: Apache-2.0
"""Conversions between messages and arrays, with exact types, which ROS does not check by default.

Poses are read from serialized messages, so that malformed ones can be counted. Messages whose
texts have equal lengths hold their numbers at the same offsets, which `LayoutCache` remembers.
"""

import importlib
from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav_msgs.msg import Odometry
from numpy.typing import ArrayLike
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from intent_recognition.array_types import Floats
from intent_recognition.bags import (
    LITTLE_ENDIAN,
    NANOSECONDS,
    POSE,
    LayoutCache,
    header_stamp_ns,
    message_fields,
)
from intent_recognition.errors import MessageError, ShapeError
from intent_recognition.tracking import UNKNOWN_VARIANCE, TrackedPose, Velocity

_UNKNOWN, _TURNS = UNKNOWN_VARIANCE * np.eye(6), np.arange(3, 6)
_NO_VELOCITY = Velocity(np.zeros(3), _UNKNOWN[:3, :3])


def message_class(type_name: str) -> type:
    """Import the class of "package/msg/Name" from any installed package.

    Raises:
        MessageError: the package is not installed or has no such message.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError) as error:
        cure = "Correct the name, install its package, or source its workspace."
        raise MessageError.about("type", "an installed message type", type_name, cure) from error


def stamp_ns(message: Any) -> int:
    """Stamp [ns] of a message with a header, of a Header or of a Time."""
    header = getattr(message, "header", message)
    stamp: Time = getattr(header, "stamp", header)
    return stamp.sec * NANOSECONDS + stamp.nanosec


def to_stamp(time_ns: int) -> Time:
    """Time message of integer nanoseconds."""
    sec, nanosec = divmod(int(time_ns), NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def duration_s(duration: Duration) -> float:
    """Seconds of a Duration message."""
    return duration.sec + duration.nanosec * 1e-9


def position_array(pose: Pose) -> Floats:
    """Position (3,) [m] of a Pose message."""
    p = pose.position
    return np.array((p.x, p.y, p.z), dtype=np.float64)


def orientation_array(pose: Pose) -> Floats:
    """Quaternion (4,) xyzw of a Pose message, not normalised."""
    q = pose.orientation
    return np.array((q.x, q.y, q.z, q.w), dtype=np.float64)


def to_point(position: Floats) -> Point:
    """Point message of (3,) [m]."""
    x, y, z = (float(value) for value in position)
    return Point(x=x, y=y, z=z)


def to_pose(position: Floats, quaternion: Floats) -> Pose:
    """Pose message of (3,) [m] and (4,) xyzw."""
    x, y, z, w = (float(value) for value in quaternion)
    return Pose(position=to_point(position), orientation=Quaternion(x=x, y=y, z=z, w=w))


class OdometryBuilder:
    """Odometry messages of a body, built by overwriting one message as `TrajectoryBuilder` does.

    What was not measured has `UNKNOWN_VARIANCE`.
    """

    def __init__(self, body: str, world_frame: str):
        self._message = message = Odometry(child_frame_id=f"{body}_world_aligned")
        message.header.frame_id = world_frame
        self._placed = message.pose.covariance.reshape(6, 6)
        self._moving = message.twist.covariance.reshape(6, 6)
        self._placed[:] = self._moving[:] = _UNKNOWN

    def build(self, pose: TrackedPose, orientation_variance: float) -> Odometry:
        """Fill the message; `orientation_variance` is that of a measured orientation [rad^2]."""
        message, stamp = self._message, self._message.header.stamp
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        linear, velocity = message.twist.twist.linear, pose.velocity or _NO_VELOCITY
        stamp.sec, stamp.nanosec = divmod(pose.stamp_ns, NANOSECONDS)
        at.x, at.y, at.z = pose.position.tolist()
        turn.x, turn.y, turn.z, turn.w = pose.orientation.tolist()
        linear.x, linear.y, linear.z = velocity.mean.tolist()
        self._placed[:3, :3], self._moving[:3, :3] = pose.position_covariance, velocity.covariance
        variance = orientation_variance if pose.orientation_measured else UNKNOWN_VARIANCE
        self._placed[_TURNS, _TURNS] = variance
        return message


def to_joint_state(
    names: Sequence[str],
    position: Iterable[float],
    velocity: Iterable[float] = (),
    effort: Iterable[float] = (),
    *,
    time_ns: int,
) -> JointState:
    """JointState message, also used as a stamped named vector; arrays are (d,) or empty."""
    message = JointState(
        name=[str(name) for name in names],
        position=_floats(position),
        velocity=_floats(velocity),
        effort=_floats(effort),
    )
    message.header.stamp = to_stamp(time_ns)
    return message


def joint_values(message: JointState, joints: Sequence[str], field: str = "position") -> Floats:
    """Values (d,) of `joints`, found by name, in the order of `joints`.

    Raises:
        MessageError: a joint is missing or named twice, or the field is shorter than the names.
    """
    values = getattr(message, field)
    if len(values) != len(message.name):
        expected = f"{len(message.name)} values, one a name"
        raise MessageError.about(field, expected, len(values), "Fill it.")
    index = {name: i for i, name in enumerate(message.name)}
    missing = [joint for joint in joints if message.name.count(joint) != 1]
    if missing:
        expected, cure = f"joints {missing} once", "Check the joint names."
        raise MessageError.about("joint_states", expected, list(message.name), cure)
    return np.array([values[index[joint]] for joint in joints], dtype=np.float64)


def of_other_joints(message: JointState, joints: Sequence[str]) -> bool:
    """Whether a message names only other joints, such as one of a gripper's driver."""
    return bool(message.name) and not {*joints} & {*message.name}


def measured_values(message: JointState, joints: Sequence[str], field: str) -> Floats | None:
    """Values as of `joint_values`, or None if not measured: the field is empty, or all are NaN.

    The joint_state_broadcaster of ros2_control sends NaN for what the hardware does not measure.
    """
    if not getattr(message, field):
        return None
    values = joint_values(message, joints, field)
    return None if np.isnan(values).all() else values


class TrajectoryBuilder:
    """JointTrajectory messages of a fixed number of joints, built by overwriting one message.

    Building 50 points of 7 joints afresh takes 0.2 ms, three times as long. Each call returns the
    same message object: publish it before the next call, and copy it to keep it.
    """

    def __init__(self, names: Sequence[str]):
        self._message = JointTrajectory(joint_names=[str(name) for name in names])
        self._joints = len(self._message.joint_names)
        self._points: list[JointTrajectoryPoint] = []
        self._times_ns = np.empty(0, dtype=np.int64)
        self._memory: dict[str, list[memoryview]] = {}  # of each point's numbers, by field

    def build(
        self,
        time_ns: int,
        times_s: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        efforts: ArrayLike | None = None,
        *,
        frame_id: str = "",
    ) -> JointTrajectory:
        """Fill the message from times (T,) [s] and arrays (T, d) [rad, rad/s]; None: left empty.

        Raises:
            ShapeError: an array is not (T, d).
        """
        times_ns = np.rint(np.asarray(times_s, dtype=np.float64) * 1e9).astype(np.int64)
        count = times_ns.size
        for _ in range(count - len(self._points)):
            self._points.append(JointTrajectoryPoint())
        columns = {"positions": positions, "velocities": velocities, "effort": efforts}
        for field, values in columns.items():
            self._fill(field, values, count)
        if not np.array_equal(times_ns, self._times_ns):  # they rarely change between two calls
            for point, time in zip(self._points, times_ns.tolist(), strict=False):
                start = point.time_from_start
                start.sec, start.nanosec = divmod(time, NANOSECONDS)
            self._times_ns = times_ns
        self._message.header.stamp = to_stamp(time_ns)
        self._message.header.frame_id = frame_id
        self._message.points = self._points[:count]
        return self._message

    def _fill(self, field: str, values: ArrayLike | None, count: int) -> None:
        width = 0 if values is None else self._joints
        rows = np.ascontiguousarray(np.zeros((count, 0)) if values is None else values, np.float64)
        if rows.shape != (count, width):
            expected = f"shape {(count, width)}"
            raise ShapeError.about(field, expected, rows.shape, "One row a time.")
        memory = self._memory.get(field, [])
        if len(memory) < count or (memory and len(memory[0]) != width):
            for point in self._points:
                setattr(point, field, array("d", bytes(8 * width)))
            self._memory[field] = memory = [memoryview(getattr(p, field)) for p in self._points]
        for own, row in zip(memory, rows, strict=False):
            own[:] = row


def trajectory_arrays(message: JointTrajectory) -> tuple[Floats, Floats, Mapping[str, Floats]]:
    """Times (T,) [s], positions (T, d) and the other fields that are filled, each (T, d).

    Raises:
        MessageError: the points have different numbers of values.
    """
    times_s = np.array([duration_s(point.time_from_start) for point in message.points])
    rows = {
        field: _stack(message, field)
        for field in ("positions", "velocities", "accelerations", "effort")
    }
    positions = rows.pop("positions")
    return times_s, positions, {field: row for field, row in rows.items() if row.shape[1]}


def _stack(message: JointTrajectory, field: str) -> Floats:
    lengths = {len(getattr(point, field)) for point in message.points}
    width = len(message.joint_names)
    if not lengths <= {width, 0} or len(lengths) > 1 or (field == "positions" and 0 in lengths):
        cure = "Fill all points alike."
        raise MessageError.about(field, f"{width} values at every point", sorted(lengths), cure)
    rows = [getattr(point, field) for point in message.points]
    return np.array(rows, dtype=np.float64).reshape(len(rows), -1 if rows and lengths != {0} else 0)


def _floats(values: Iterable[float]) -> list[float]:
    return np.asarray(values, dtype=np.float64).ravel().tolist()


class PoseNumbers(NamedTuple):
    """The parts of a pose message that a node uses."""

    stamp_ns: int
    frame_id: str
    pose: Floats  # position [m] and orientation xyzw, (7,)
    # covariance of position and rotation (6, 6); None if the message has none
    covariance: Floats | None = None


_POSES, _ODOMETRIES = LayoutCache(POSE), LayoutCache("nav_msgs/msg/Odometry")


def prepare_reading() -> None:
    """Load the definitions of messages before a node subscribes to poses.

    It takes 0.15 s of processor time, in which 15 poses come at 100 Hz; at most 10 wait.
    """
    message_fields()


def read_pose(data: bytes) -> PoseNumbers:
    """Read a serialized PoseStamped.

    Raises:
        MessageError: the message ends too early, or its frame is not UTF-8.
    """
    return _read(data, PoseStamped, _POSES, "pose")


def read_odometry(data: bytes) -> PoseNumbers:
    """Read the pose in a serialized Odometry.

    Raises:
        MessageError: the message ends too early, or a frame is not UTF-8.
    """
    return _read(data, Odometry, _ODOMETRIES, "pose.pose", "pose.covariance")


def _read(
    data: bytes, kind: type, layouts: LayoutCache, pose: str, covariance: str = ""
) -> PoseNumbers:
    if data[:2] != LITTLE_ENDIAN:  # of another machine: rclpy converts the bytes
        data = serialize_message(deserialize_message(data, kind))
    try:
        layout = layouts.layout_of(data)
    except ValueError as error:
        cure = "Check who publishes it."
        raise MessageError.about("message", "a whole one", error, cure) from error
    (frame_id,) = layout.texts["header.frame_id"]
    matrix = layout.values(data, covariance).reshape(6, 6) if covariance else None
    return PoseNumbers(header_stamp_ns(data), frame_id, layout.values(data, pose), matrix)
