# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes, ready to be published: only the numbers in them change from one to the next.

To publish a message object, rclpy converts it to C, point by point and field by field, and
serialises that. A message of the same shape has its numbers at the same places. They are found once
(numbers that occur nowhere else are serialised and looked for), and after that written there.
"""

from collections.abc import Sequence

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from intent_recognition.errors import MessageError, describe
from intent_recognition.nodes.conversions import NANOSECONDS, TrajectoryBuilder, to_joint_state
from intent_recognition.tracking import TrackedPose

HEADER_BYTES = 4
"""Of a serialised message, before its content; places are counted from there."""
UNKNOWN_VARIANCE = 1e6
"""Of what was not measured (orientation, velocity before the third sample)."""
MAX_TEMPLATES = 32


class SerializedTemplate:
    """The bytes of one message, its floats and 32-bit integers as arrays to write to.

    Args:
        message: with a different number at each place that will be written.
    """

    def __init__(self, message: object):
        self._data = bytearray(serialize_message(message))
        size = len(self._data) - HEADER_BYTES
        self.floats = np.frombuffer(self._data, "<f8", size // 8, HEADER_BYTES)
        self.integers = np.frombuffer(self._data, "<i4", size // 4, HEADER_BYTES)

    def places_of(self, numbers: np.ndarray) -> np.ndarray:
        """Index into `floats` of each number, in the same shape.

        Raises:
            MessageError: a number is not there, or twice.
        """
        order = np.argsort(self.floats)
        flat = np.ravel(numbers)
        first = np.searchsorted(self.floats, flat, "left", sorter=order)
        last = np.searchsorted(self.floats, flat, "right", sorter=order)
        if np.any(last - first != 1):
            raise MessageError(
                describe("message", "each number once", "another layout", "Report this.")
            )
        return order[first].reshape(np.shape(numbers))

    def stamp(self, time_ns: int) -> None:
        """Write the time of the header, with which the message begins."""
        self.integers[:2] = divmod(int(time_ns), NANOSECONDS)

    def to_bytes(self) -> bytes:
        """The message as it is now."""
        return bytes(self._data)


def marks(count: int) -> np.ndarray:
    """Floats that no message contains by chance, (count,)."""
    return -1.7e250 * (1.0 + np.arange(count) / 2**20)


class SerializedTrajectory:
    """JointTrajectory messages with positions, velocities and efforts.

    Args:
        names: joint names, in the order of the columns.
    """

    def __init__(self, names: Sequence[str]):
        self._names = list(names)
        self._templates: dict[tuple[str, int], tuple] = {}

    def build(
        self,
        time_ns: int,
        times_s: np.ndarray,
        positions: np.ndarray,
        velocities: np.ndarray,
        efforts: np.ndarray,
        *,
        frame_id: str = "",
    ) -> bytes:
        """As `TrajectoryBuilder.build`, serialised; arrays (T, d).

        Raises:
            ShapeError: an array is not (T, d).
        """
        key = frame_id, len(times_s)
        if key not in self._templates:
            if len(self._templates) >= MAX_TEMPLATES:
                self._templates.clear()
            self._templates[key] = self._make(*key)
        template, places, times = self._templates[key]
        for place, values in zip(places, (positions, velocities, efforts), strict=True):
            template.floats[place] = values
        template.stamp(time_ns)
        times_ns = np.rint(np.asarray(times_s) * 1e9).astype(np.int64)
        template.integers[times] = np.stack(np.divmod(times_ns, NANOSECONDS), axis=1)
        return template.to_bytes()

    def _make(self, frame_id: str, count: int) -> tuple:
        shape = (3, count, len(self._names))
        values = marks(int(np.prod(shape))).reshape(shape)
        message = TrajectoryBuilder(self._names).build(
            0, np.zeros(count), *values, frame_id=frame_id
        )
        template = SerializedTemplate(message)
        places = template.places_of(values)
        times = 2 * places[2, :, -1:] + (2, 3)  # time_from_start comes right after the efforts
        return template, tuple(places), times


class SerializedNamedVector:
    """JointState messages with position, velocity and effort of fixed names.

    Args:
        names: of the d columns.
    """

    def __init__(self, names: Sequence[str]):
        values = marks(3 * len(names)).reshape(3, -1)
        self._template = SerializedTemplate(to_joint_state(names, *values, time_ns=0))
        self._places = self._template.places_of(values)

    def build(
        self, time_ns: int, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray
    ) -> bytes:
        """As `to_joint_state`, serialised; arrays (d,)."""
        self._template.floats[self._places] = (position, velocity, effort)
        self._template.stamp(time_ns)
        return self._template.to_bytes()


class SerializedOdometry:
    """Odometry messages of tracked poses; what was not measured has variance 1e6.

    Args:
        body: the tracked body.
        world_frame: frame of the poses.
        orientation_variance: of a measured orientation [rad^2].
    """

    def __init__(self, body: str, world_frame: str, orientation_variance: float):
        self.orientation_variance = orientation_variance
        message = Odometry(child_frame_id=f"{body}_world_aligned")
        message.header.frame_id = world_frame
        mark = marks(7 + 36 + 6 + 36)
        pose, twist = message.pose.pose, message.twist.twist
        numbers = iter(mark[:7].tolist())
        for part, fields in ((pose.position, "xyz"), (pose.orientation, "xyzw")):
            for name in fields:
                setattr(part, name, next(numbers))
        message.pose.covariance = mark[7:43]
        numbers = iter(mark[43:49].tolist())
        for part in (twist.linear, twist.angular):
            for name in "xyz":
                setattr(part, name, next(numbers))
        message.twist.covariance = mark[49:]
        self._template = SerializedTemplate(message)
        self._places = self._template.places_of(mark)
        self._values = np.zeros(85)
        self._turn = self._values[7:43].reshape(6, 6)
        self._spin = self._values[49:].reshape(6, 6)
        self._spin[range(3, 6), range(3, 6)] = UNKNOWN_VARIANCE

    def build(self, pose: TrackedPose) -> bytes:
        """The message of an accepted pose."""
        values = self._values
        values[:3], values[3:7] = pose.position, pose.orientation
        turn = self.orientation_variance if pose.orientation_measured else UNKNOWN_VARIANCE
        self._turn[:3, :3] = pose.position_covariance
        self._turn[3, 3] = self._turn[4, 4] = self._turn[5, 5] = turn
        if pose.velocity is None:
            values[43:46] = 0.0
            self._spin[:3, :3] = np.eye(3) * UNKNOWN_VARIANCE
        else:
            values[43:46] = pose.velocity
            self._spin[:3, :3] = pose.velocity_covariance
        self._template.floats[self._places] = values
        self._template.stamp(pose.stamp_ns)
        return self._template.to_bytes()
