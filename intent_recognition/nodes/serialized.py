# SPDX-License-Identifier: Apache-2.0
"""The numbers that a node needs of a serialized pose; what is malformed is an error, and counted.

Messages of the same lengths have their numbers at the same places, which `bags.find_layout` knows.
"""

from typing import NamedTuple

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message

from intent_recognition.array_types import Floats
from intent_recognition.bags import LITTLE_ENDIAN, POSE, LayoutCache, header_stamp_ns
from intent_recognition.errors import MessageError


class PoseNumbers(NamedTuple):
    """What a node uses of a pose.

    Attributes:
        pose: position [m] and orientation xyzw, (7,).
        covariance: of position and rotation, (6, 6), None in a message without one.
    """

    stamp_ns: int
    frame_id: str
    pose: Floats
    covariance: Floats | None = None


_POSES, _ODOMETRIES = LayoutCache(POSE), LayoutCache("nav_msgs/msg/Odometry")


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
        cure = "Check who publishes it."
        raise MessageError.about("message", "a whole one", error, cure) from error
    (frame_id,) = layout.texts["header.frame_id"]
    matrix = layout.values(data, covariance).reshape(6, 6) if covariance else None
    return PoseNumbers(header_stamp_ns(data), frame_id, layout.values(data, pose), matrix)
