# SPDX-License-Identifier: Apache-2.0
"""Messages to arrays and back, through the wire format."""

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from joint_trajectories import build_joint_trajectory
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from intent_recognition.errors import MessageError, ShapeError
from intent_recognition.nodes.conversions import (
    TrajectoryBuilder,
    duration_s,
    joint_values,
    message_class,
    orientation_array,
    position_array,
    stamp_ns,
    to_joint_state,
    to_pose,
    to_stamp,
    trajectory_arrays,
)

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


def test_durations_are_seconds():
    assert duration_s(Duration(sec=-2, nanosec=250_000_000)) == pytest.approx(-1.75)


def test_types_are_found_by_name():
    assert message_class("geometry_msgs/msg/PoseStamped") is PoseStamped


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
    for seed, count in enumerate([50, 50, 3, 0, 20, 70, 50]):
        times_s, positions, velocities, efforts = arrays(count, seed)
        fields = (velocities if seed % 3 else None, efforts if seed % 2 else None)
        message = builder.build(seed, times_s, positions, *fields)
        assert message.joint_names == NAMES
        assert stamp_ns(message) == seed
        assert len(message.points) == count
        if count:
            check(message, times_s, positions, *fields)


def test_builder_reuses_its_message():
    builder = TrajectoryBuilder(NAMES)
    first = builder.build(1, *arrays(50))
    assert builder.build(2, *arrays(50, 1)) is first


def test_single_build_equals_the_builders():
    assert build_joint_trajectory(NAMES, *arrays(9), time_ns=4) == TrajectoryBuilder(NAMES).build(
        4, *arrays(9)
    )


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
