# SPDX-License-Identifier: Apache-2.0
"""Messages to arrays and back, through the wire format, as objects and as bytes."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from joint_trajectories import build_joint_trajectory
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from intent_recognition.bags import header_stamp_ns
from intent_recognition.errors import MessageError, ShapeError
from intent_recognition.nodes.conversions import (
    OdometryBuilder,
    TrajectoryBuilder,
    joint_values,
    measured_values,
    message_class,
    orientation_array,
    position_array,
    read_odometry,
    read_pose,
    stamp_ns,
    to_joint_state,
    to_pose,
    to_stamp,
    trajectory_arrays,
)
from intent_recognition.tracking import TrackedPose, Velocity

NAMES = [f"joint_{i}" for i in range(7)]


def sent(message):
    """The message as a subscriber would get it."""
    return deserialize_message(serialize_message(message), type(message))


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_stamps_are_exact(time_ns):
    message = PoseStamped()
    message.header.stamp = to_stamp(time_ns)
    assert stamp_ns(message) == stamp_ns(message.header) == time_ns
    assert stamp_ns(message.header.stamp) == time_ns


@pytest.mark.parametrize("name", ["no_such_package/msg/Thing", "std_msgs/msg/Thing", "nonsense"])
def test_unknown_type_is_named(name):
    with pytest.raises(MessageError, match=f"installed message type, got {name}"):
        message_class(name)


def test_pose_takes_any_kind_of_float():
    message = PoseStamped(pose=to_pose(np.array([1, 2, 3], dtype=np.float32), (0, 0, 0, 1)))
    np.testing.assert_array_equal(position_array(sent(message).pose), [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(orientation_array(sent(message).pose), [0.0, 0.0, 0.0, 1.0])


def test_joint_state_is_found_by_name():
    state = to_joint_state(["b", "a"], np.array([2, 1], dtype=np.int32), time_ns=5)
    np.testing.assert_array_equal(joint_values(sent(state), ["a", "b"]), [1.0, 2.0])
    with pytest.raises(MessageError, match="'c'"):
        joint_values(state, ["c"])
    with pytest.raises(MessageError, match="velocity"):
        joint_values(state, ["a"], "velocity")
    with pytest.raises(MessageError):
        joint_values(JointState(name=["a"], position=[]), ["a"])
    with pytest.raises(MessageError, match=r"\['b'\] once"):
        joint_values(JointState(name=["b", "a", "b"], position=[1.0, 2.0, 3.0]), ["a", "b"])


def test_nan_for_all_joints_that_count_was_not_measured_but_for_one_it_is_a_fault():
    """The finger has a velocity, one joint of the arm has none: the arm's are refused."""
    state = JointState(name=["finger", "a", "b"], velocity=[0.1, np.nan, np.nan])
    assert measured_values(state, ["a", "b"], "velocity") is None
    assert measured_values(state, ["a", "b"], "effort") is None
    found = measured_values(state, ["a", "finger"], "velocity")
    np.testing.assert_array_equal(found, [np.nan, 0.1])
    with pytest.raises(MessageError):
        measured_values(JointState(name=["a", "b"], velocity=[0.1]), ["a"], "velocity")


def arrays(count, seed=0):
    generator = np.random.default_rng(seed)
    times_s = np.cumsum(generator.uniform(0.001, 0.1, count))
    return times_s, *generator.normal(size=(3, count, 7))


def check(message, times_s, positions, velocities, efforts):
    got_times, got_positions, others = trajectory_arrays(sent(message))
    np.testing.assert_allclose(got_times, times_s, atol=1e-9)
    np.testing.assert_array_equal(got_positions, positions)
    expected = {"velocities": velocities, "effort": efforts}
    assert set(others) == {name for name, values in expected.items() if values is not None}
    for name, values in others.items():
        np.testing.assert_array_equal(values, expected[name])


def test_builder_overwrites_completely():
    builder = TrajectoryBuilder(NAMES)
    for seed, count in enumerate([0, 50, 50, 3, 0, 20, 70, 50]):
        times_s, positions, velocities, efforts = arrays(count, seed)
        fields = (velocities if seed % 3 else None, efforts if seed % 2 else None)
        message = builder.build(seed, times_s, positions, *fields)
        assert message.joint_names == NAMES
        assert stamp_ns(message) == seed
        assert len(message.points) == count
        if count:
            check(message, times_s, positions, *fields)


def test_wrong_shapes_are_refused():
    times_s, positions, velocities, _ = arrays(5)
    with pytest.raises(ShapeError, match="positions"):
        build_joint_trajectory(NAMES, times_s, positions[:4])
    with pytest.raises(ShapeError, match="velocities"):
        build_joint_trajectory(NAMES, times_s, positions, velocities[:, :6])


def test_uneven_points_are_refused():
    points = [JointTrajectoryPoint(positions=[1.0]), JointTrajectoryPoint(positions=[])]
    with pytest.raises(MessageError, match="positions"):
        trajectory_arrays(JointTrajectory(joint_names=["a"], points=points))


STAMP_NS = 1_767_226_260_790_000_123
STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize("has_velocity", [True, False])
@pytest.mark.parametrize("measured", [True, False])
def test_an_odometry_holds_the_pose_and_nothing_of_the_last(rng, has_velocity, measured):
    builder, full = OdometryBuilder("wrist", "world"), np.full((3, 3), 7.0)
    for _ in range(3):
        last = np.full(3, 7.0), np.full(4, 7.0), not measured, full
        builder.build(TrackedPose(1, *last, Velocity(np.full(3, 7.0), full)), 7.0)
        root = rng.normal(size=(3, 3))
        pose = TrackedPose(
            STAMP_NS,
            rng.normal(size=3),
            rng.normal(size=4),
            measured,
            root @ root.T,
            Velocity(rng.normal(size=3), 2.0 * root @ root.T) if has_velocity else None,
        )
        found = builder.build(pose, 4e-4)
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
        velocity, own = pose.velocity or (np.zeros(3), 1e6 * np.eye(3))
        assert (linear.x, linear.y, linear.z) == tuple(velocity)
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
        name = f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"
        swapped = STORE.serialize_cdr(STORE.deserialize_cdr(data, name), name, little_endian=False)
        np.testing.assert_array_equal(read(bytes(swapped)).pose, found.pose)
    np.testing.assert_array_equal(
        read_odometry(serialize_message(odometry)).covariance.ravel(), odometry.pose.covariance
    )
