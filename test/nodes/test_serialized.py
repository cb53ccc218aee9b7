# SPDX-License-Identifier: Apache-2.0
"""Messages as bytes hold what the message objects hold."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from intent_recognition.bags import header_stamp_ns
from intent_recognition.errors import MessageError
from intent_recognition.nodes.conversions import (
    orientation_array,
    position_array,
    stamp_ns,
    to_odometry,
    to_stamp,
)
from intent_recognition.nodes.serialized import read_odometry, read_pose
from intent_recognition.tracking import TrackedPose

STAMP_NS = 1_767_226_260_790_000_123


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("has_velocity", [True, False])
@pytest.mark.parametrize("measured", [True, False])
def test_an_odometry_holds_the_pose(rng, has_velocity, measured):
    for _ in range(3):
        root = rng.normal(size=(3, 3))
        pose = TrackedPose(
            STAMP_NS,
            rng.normal(size=3),
            rng.normal(size=4),
            measured,
            root @ root.T,
            rng.normal(size=3) if has_velocity else None,
            2.0 * root @ root.T if has_velocity else None,
        )
        found = to_odometry(pose, "wrist", "world", 4e-4)
        assert stamp_ns(found) == STAMP_NS
        assert (found.header.frame_id, found.child_frame_id) == ("world", "wrist_world_aligned")
        p, q = found.pose.pose.position, found.pose.pose.orientation
        assert (p.x, p.y, p.z) == tuple(pose.position)
        assert (q.x, q.y, q.z, q.w) == tuple(pose.orientation)
        turn = 4e-4 if measured else 1e6
        expected = np.zeros((6, 6))
        expected[:3, :3], expected[3:, 3:] = pose.position_covariance, turn * np.eye(3)
        assert np.array_equal(found.pose.covariance.reshape(6, 6), expected)
        linear = found.twist.twist.linear
        velocity = pose.velocity if has_velocity else np.zeros(3)
        assert (linear.x, linear.y, linear.z) == tuple(velocity)
        own = pose.velocity_covariance if has_velocity else 1e6 * np.eye(3)
        expected[:3, :3], expected[3:, 3:] = own, 1e6 * np.eye(3)
        assert np.array_equal(found.twist.covariance.reshape(6, 6), expected)


@pytest.mark.parametrize("frames", [("", ""), ("w", "wrist_world_aligned"), ("world", "elf")])
def test_numbers_are_read_as_rclpy_reads_them(rng, frames):
    odometry = Odometry(child_frame_id=frames[1])
    odometry.pose.covariance = rng.normal(size=36)
    numbers = iter(rng.normal(size=7).tolist())
    for part, fields in (("position", "xyz"), ("orientation", "xyzw")):
        for name in fields:
            setattr(getattr(odometry.pose.pose, part), name, next(numbers))
    pose = PoseStamped(pose=odometry.pose.pose)
    for message, read in ((odometry, read_odometry), (pose, read_pose)):
        message.header.frame_id = frames[0]
        message.header.stamp = to_stamp(STAMP_NS)
        data = serialize_message(message)
        found = read(data)
        assert found[:2] == (STAMP_NS, frames[0]) and header_stamp_ns(data) == STAMP_NS
        held = odometry.pose.pose
        np.testing.assert_array_equal(found.pose[:3], position_array(held))
        np.testing.assert_array_equal(found.pose[3:], orientation_array(held))
        for length in (3, 10, 14, 30, len(data) // 2 - 40):
            with pytest.raises(MessageError, match="a whole one"):
                read(data[:2] + data[2 : max(length, 2)])
        np.testing.assert_array_equal(read(_swapped(data, read)).pose, found.pose)
    np.testing.assert_array_equal(
        read_odometry(serialize_message(odometry)).covariance.ravel(), odometry.pose.covariance
    )


def _swapped(data, read):
    """The same message in the other order of bytes."""
    texts = 1 if read is read_pose else 2
    out, at = bytearray(b"\x00\x00" + data[2:4]), 4

    def move(size, count=1):
        nonlocal at
        while (at - 4) % size:
            out.append(0)
            at += 1
        for _ in range(count):
            out.extend(data[at : at + size][::-1])
            at += size

    move(4, 2)
    for _ in range(texts):
        (length,) = np.frombuffer(data, "<u4", 1, at + (-(at - 4)) % 4)
        move(4)
        out.extend(data[at : at + length])
        at += int(length)
    move(8, (len(data) - at) // 8)
    return bytes(out)
