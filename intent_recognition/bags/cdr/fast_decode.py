# SPDX-License-Identifier: Apache-2.0
"""Decoders of the two types that training reads most, several times faster than the general one."""

import struct
from collections.abc import Callable
from types import SimpleNamespace

STAMPED = struct.Struct("<iII")
POSE = struct.Struct("<7d")
LENGTH = struct.Struct("<I")
LITTLE_ENDIAN = b"\x00\x01"


def fast_decoder(type_name: str, general: Callable[[bytes], object]) -> Callable[[bytes], object]:
    """A decoder with the same results as `general`, to which it leaves unusual bytes and types."""
    special = {
        "geometry_msgs/msg/PoseStamped": _pose_stamped,
        "sensor_msgs/msg/JointState": _joint_state,
    }.get(type_name)
    if special is None:
        return general

    def decode(data: bytes) -> object:
        return special(data[4:]) if data[:2] == LITTLE_ENDIAN else general(data)

    return decode


def _header(body: bytes) -> tuple[SimpleNamespace, int]:
    seconds, nanoseconds, length = STAMPED.unpack_from(body)
    end = STAMPED.size + length
    if end > len(body):
        raise ValueError(f"frame_id of {length} bytes in a message of {len(body)}")
    frame_id = body[STAMPED.size : max(end - 1, STAMPED.size)].decode()
    stamp = SimpleNamespace(sec=seconds, nanosec=nanoseconds)
    return SimpleNamespace(stamp=stamp, frame_id=frame_id), end


def _pose_stamped(body: bytes) -> SimpleNamespace:
    header, at = _header(body)
    x, y, z, qx, qy, qz, qw = POSE.unpack_from(body, at + -at % 8)
    position = SimpleNamespace(x=x, y=y, z=z)
    orientation = SimpleNamespace(x=qx, y=qy, z=qz, w=qw)
    pose = SimpleNamespace(position=position, orientation=orientation)
    return SimpleNamespace(header=header, pose=pose)


def _joint_state(body: bytes) -> SimpleNamespace:
    header, at = _header(body)
    at += -at % 4
    (count,) = LENGTH.unpack_from(body, at)
    at += 4
    names = []
    for _ in range(count):
        at += -at % 4
        (length,) = LENGTH.unpack_from(body, at)
        at += 4
        if at + length > len(body):
            raise ValueError(f"name of {length} bytes in a message of {len(body)}")
        names.append(body[at : at + max(length - 1, 0)].decode())
        at += length
    columns = []
    for _ in range(3):
        at += -at % 4
        (count,) = LENGTH.unpack_from(body, at)
        at += 4
        if count:
            at += -at % 8
        columns.append(list(struct.unpack_from(f"<{count}d", body, at)))
        at += 8 * count
    position, velocity, effort = columns
    return SimpleNamespace(
        header=header, name=names, position=position, velocity=velocity, effort=effort
    )
