# SPDX-License-Identifier: Apache-2.0
"""Layouts say where rosbags finds the numbers and texts of a message."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.bags.cdr.layout import LayoutCache, find_layout, header_stamp_ns
from intent_recognition.bags.definitions import make_message, serialize

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
TEXTS = st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=6)
SIZES = st.lists(st.integers(0, 3), min_size=4, max_size=4)
POINT = ("positions", "velocities", "accelerations", "effort")
TYPES = (  # numbers of all sizes, texts and sequences in all orders
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/BatteryState",
    "sensor_msgs/msg/PointCloud2",
    "diagnostic_msgs/msg/DiagnosticArray",
    "tf2_msgs/msg/TFMessage",
)


@st.composite
def trajectories(draw):
    names, n_points = draw(st.lists(TEXTS, max_size=3)), draw(st.integers(0, 4))
    points = []
    for k in range(n_points):
        point = {f: np.arange(n) + 10.0 * k + n for f, n in zip(POINT, draw(SIZES), strict=True)}
        points.append(point | {"time_from_start": {"sec": k, "nanosec": 7 + k}})
    header = {"stamp": draw(st.integers(0, 2**60)), "frame_id": draw(TEXTS)}
    return make_message(TRAJECTORY, {"header": header, "joint_names": names, "points": points})


@settings(max_examples=60, deadline=None)
@given(message=trajectories())
def test_everything_stands_where_the_layout_says(message):
    data = serialize(TRAJECTORY, message)
    layout = find_layout(TRAJECTORY, data)
    assert layout.tail <= 3
    assert layout.texts["header.frame_id"] == (message.header.frame_id,)
    assert layout.texts["joint_names"] == tuple(message.joint_names)
    stamp = message.header.stamp
    assert header_stamp_ns(data) == stamp.sec * 10**9 + stamp.nanosec
    assert layout.values(data, "header.stamp").tolist() == [stamp.sec, stamp.nanosec]
    for k, point in enumerate(message.points):
        for field in POINT:
            place, expected = f"points[{k}].{field}", getattr(point, field).tolist()
            assert layout.values(data, place).tolist() == expected
        place, time = f"points[{k}].time_from_start", point.time_from_start
        assert layout.values(data, place).tolist() == [time.sec, time.nanosec]


@pytest.mark.parametrize("kind", TYPES)
def test_standard_types_are_walked_to_their_end(kind):
    assert find_layout(kind, serialize(kind, {})).tail <= 3


@settings(max_examples=30, deadline=None)
@given(message=trajectories(), cut=st.integers(1, 400))
def test_a_message_that_ends_too_early_has_no_layout(message, cut):
    data = serialize(TRAJECTORY, message)
    whole = len(data) - find_layout(TRAJECTORY, data).tail
    with pytest.raises(ValueError, match=r"ends too early|encapsulation"):
        find_layout(TRAJECTORY, data[: max(whole - cut, 0)])


def test_other_bytes_have_no_layout():
    kind = "std_msgs/msg/String"
    data = serialize(kind, {"data": "abc"})
    with pytest.raises(ValueError, match="encapsulation 0000"):
        find_layout(kind, b"\x00\x00" + data[2:])
    with pytest.raises(ValueError, match="ends too early"):
        find_layout(kind, data[:4] + struct.pack("<I", 2**31) + data[8:])
    with pytest.raises(UnicodeDecodeError):
        find_layout(kind, data.replace(b"abc", b"\xff\xfe\xfd"))


def test_a_layout_fits_messages_with_the_same_texts_and_lengths_only():
    kind = "geometry_msgs/msg/PoseStamped"
    first, other, renamed, longer = (
        serialize(kind, {"header": {"stamp": 1, "frame_id": frame}, "pose": {"position": {"x": x}}})
        for frame, x in (("world", 1.0), ("world", 2.0), ("track", 1.0), ("worlds", 1.0))
    )
    known = LayoutCache(kind, most=1)
    layout = known.layout_of(first)
    assert known.layout_of(other) is layout
    assert layout.values(other, "pose.position").tolist() == [2.0, 0.0, 0.0]
    for data, frame in ((renamed, "track"), (longer, "worlds")):
        found = known.layout_of(data)
        assert not layout.fits(data) and found.texts["header.frame_id"] == (frame,)
        assert known.layout_of(data) is not found  # no more than one is kept
    rows = np.array([np.frombuffer(data, np.uint8) for data in (first, renamed, other)])
    assert layout.fit(rows).tolist() == [True, False, True]
    assert layout.columns(rows, "pose.position")[:, 0].tolist() == [1.0, 1.0, 2.0]
