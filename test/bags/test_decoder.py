# SPDX-License-Identifier: Apache-2.0
"""The decoder of constant layouts gives what the general one gives."""

from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.bags.cdr.decoder import layout_decoder
from intent_recognition.bags.definitions import definition, serialize

NUMBERS = st.lists(st.floats(allow_nan=False), max_size=8)


def general(kind: str):
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    schema = Schema(1, definition(kind).text.encode(), "ros2msg", kind)
    return DecoderFactory().decoder_for("cdr", schema)


@settings(max_examples=60, deadline=None)
@given(
    frame=st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=9),
    names=st.lists(st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=5), max_size=5),
    columns=st.tuples(NUMBERS, NUMBERS, NUMBERS),
)
def test_joint_states(frame, names, columns):
    kind = "sensor_msgs/msg/JointState"
    fields = dict(zip(("position", "velocity", "effort"), columns, strict=True))
    data = serialize(kind, {"header": {"stamp": 5, "frame_id": frame}, "name": names, **fields})
    fast, slow = layout_decoder(kind, general(kind))(data), general(kind)(data)
    assert fast.name == list(slow.name) and fast.header.frame_id == slow.header.frame_id
    for column in fields:
        assert list(getattr(fast, column)) == list(getattr(slow, column))


@settings(max_examples=60, deadline=None)
@given(
    frame=st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=9),
    x=st.floats(allow_nan=False),
    w=st.floats(allow_nan=False),
)
def test_poses(frame, x, w):
    kind = "geometry_msgs/msg/PoseStamped"
    pose = {"position": {"x": x}, "orientation": {"w": w}}
    data = serialize(kind, {"header": {"stamp": 7, "frame_id": frame}, "pose": pose})
    fast, slow = layout_decoder(kind, general(kind))(data), general(kind)(data)
    assert (fast.pose.position.x, fast.pose.orientation.w) == (x, w)
    assert (slow.pose.position.x, slow.pose.orientation.w) == (x, w)
    assert fast.header.frame_id == slow.header.frame_id == frame
    assert fast.header.stamp.nanosec == slow.header.stamp.nanosec == 7
