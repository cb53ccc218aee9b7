# SPDX-License-Identifier: Apache-2.0
"""Numbers read from the bytes of a message, where rclpy would make an object of every field.

Bytes in another order than this machine's, which rclpy may meet in theory, are left to it.
"""

import struct
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from intent_recognition.errors import MessageError, describe
from intent_recognition.nodes.conversions import (
    NANOSECONDS,
    orientation_array,
    position_array,
    stamp_ns,
)

LITTLE_ENDIAN = b"\x00\x01"
BODY = 4
"""Where the message begins, behind the four bytes that name the encoding; alignment counts here."""
HEADER = struct.Struct("<iII")
LENGTH = struct.Struct("<I")
POSE_NUMBERS, ODOMETRY_NUMBERS = 7, 43


class PoseNumbers(NamedTuple):
    """What is used of a pose.

    Attributes:
        stamp_ns: of the header.
        frame_id: of the header.
        pose: position and orientation xyzw, (7,).
        covariance: (6, 6), None in a message without one.
    """

    stamp_ns: int
    frame_id: str
    pose: np.ndarray
    covariance: np.ndarray | None = None


def read_pose(data: bytes) -> PoseNumbers:
    """Numbers of a serialised PoseStamped.

    Raises:
        MessageError: it ends too early.
    """
    if data[:2] != LITTLE_ENDIAN:
        message = deserialize_message(data, PoseStamped)
        return PoseNumbers(stamp_ns(message), message.header.frame_id, _seven(message.pose))
    time_ns, frame_id, at = _header(data)
    return PoseNumbers(time_ns, frame_id, _doubles(data, at, POSE_NUMBERS))


def read_odometry(data: bytes) -> PoseNumbers:
    """Numbers of the pose in a serialised Odometry.

    Raises:
        MessageError: it ends too early.
    """
    if data[:2] != LITTLE_ENDIAN:
        message = deserialize_message(data, Odometry)
        covariance = np.array(message.pose.covariance).reshape(6, 6)
        pose = _seven(message.pose.pose)
        return PoseNumbers(stamp_ns(message), message.header.frame_id, pose, covariance)
    time_ns, frame_id, at = _header(data)
    _, at = _text(data, at + -at % 4)
    numbers = _doubles(data, at, ODOMETRY_NUMBERS)
    return PoseNumbers(time_ns, frame_id, numbers[:POSE_NUMBERS], numbers[7:].reshape(6, 6))


def read_stamp_ns(data: bytes) -> int:
    """Stamp of any serialised message that begins with a header; 0 where it ends before."""
    order = "<" if data[:2] == LITTLE_ENDIAN else ">"
    if len(data) < BODY + 8:
        return 0
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, BODY)
    return seconds * NANOSECONDS + nanoseconds


def _header(data: bytes) -> tuple[int, str, int]:
    """Stamp, frame and where the header ends, counted from `BODY`."""
    try:
        seconds, nanoseconds, _ = HEADER.unpack_from(data, BODY)
    except struct.error as error:
        raise _too_short(data) from error
    frame_id, end = _text(data, HEADER.size - LENGTH.size)
    return seconds * NANOSECONDS + nanoseconds, frame_id, end


def _text(data: bytes, at: int) -> tuple[str, int]:
    """A text and where it ends; its last byte is a zero."""
    try:
        (length,) = LENGTH.unpack_from(data, BODY + at)
    except struct.error as error:
        raise _too_short(data) from error
    start = BODY + at + LENGTH.size
    if start + length > len(data):
        raise _too_short(data)
    text = data[start : start + max(length - 1, 0)].decode(errors="replace")
    return text, at + LENGTH.size + length


def _doubles(data: bytes, at: int, count: int) -> np.ndarray:
    start = BODY + at + -at % 8
    if start + 8 * count > len(data):
        raise _too_short(data)
    return np.frombuffer(data, "<f8", count, start)


def _seven(pose: object) -> np.ndarray:
    return np.concatenate([position_array(pose), orientation_array(pose)])


def _too_short(data: bytes) -> MessageError:
    return MessageError(
        describe("message", "a whole one", f"{len(data)} bytes", "Check who publishes it.")
    )
