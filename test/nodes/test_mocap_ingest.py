# SPDX-License-Identifier: Apache-2.0
"""The node mocap_ingest on its topics."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry

from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, to_pose, to_stamp
from intent_recognition.nodes.mocap_ingest import MocapIngest

T0 = 1_700_000_000_123_456_789
STEP = 10_000_000
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def pose(index, position, frame="world", orientation=UPRIGHT):
    message = PoseStamped(pose=to_pose(position, orientation))
    message.header.frame_id = frame
    message.header.stamp = to_stamp(T0 + index * STEP)
    return message


def exchange(harness, messages, count, body="wrist"):
    """Publish poses one by one and return the first `count` odometry messages."""
    received = harness.collect(Odometry, f"human/{body}", qos.SENSOR)
    publisher = harness.publisher(PoseStamped, f"mocap/{body}/pose", qos.SENSOR)
    harness.connect(publisher)
    harness.spin_until(lambda: harness.probe.count_publishers(f"human/{body}"))
    for message in messages:
        harness.tell(harness.nodes[-1], publisher, message)
    harness.spin_until(lambda: len(received) >= count, what="odometry")
    return received


def test_odometry_follows_the_contract(harness):
    harness.node(MocapIngest)
    received = exchange(harness, [pose(i, (0.01 * i, 0.5, 1.0)) for i in range(5)], 5)
    last = received[-1]
    assert stamp_ns(last) == T0 + 4 * STEP
    assert last.header.frame_id == "world"
    assert last.child_frame_id == "wrist_world_aligned"
    assert last.pose.pose == to_pose((0.04, 0.5, 1.0), UPRIGHT)
    covariance = np.reshape(last.pose.covariance, (6, 6))
    np.testing.assert_allclose(covariance[:3, :3], np.eye(3) * 4e-6)
    np.testing.assert_allclose(covariance[3:, 3:], np.eye(3) * 4e-4)
    assert last.twist.twist.linear.x == pytest.approx(1.0)
    twist = np.reshape(last.twist.covariance, (6, 6))
    assert 0.0 < twist[0, 0] < 0.1
    assert received[0].twist.covariance[0] == 1e6


def test_extrinsics_are_applied(harness):
    half = 0.5**0.5
    harness.node(MocapIngest, world_frame="cell", extrinsics=[f"optitrack 1 0 2 0 0 {half} {half}"])
    (odometry,) = exchange(harness, [pose(0, (0.5, 0.0, 0.0), "optitrack")], 1)
    position = odometry.pose.pose.position
    np.testing.assert_allclose((position.x, position.y, position.z), (1.0, 0.5, 2.0), atol=1e-12)
    assert odometry.header.frame_id == "cell"


def test_bad_input_is_counted_and_harms_nothing(harness):
    node = harness.node(MocapIngest)
    good = [pose(i, (0.01 * i, 0.5, 1.0)) for i in range(20)]
    unstamped = pose(0, (0.0, 0.5, 1.0))
    unstamped.header.stamp.sec = unstamped.header.stamp.nanosec = 0
    bad = [
        pose(10, (float("nan"), 0.5, 1.0)),
        unstamped,
        pose(9, (0.09, 0.5, 1.0)),
        pose(10, (4.0, 0.5, 1.0)),
        pose(10, (0.1, 0.5, 1.0), frame="camera"),
    ]
    received = exchange(harness, good[:10] + bad + good[10:], 20)
    assert [stamp_ns(message) for message in received] == [stamp_ns(m) for m in good]
    assert [m.pose.pose.position.x for m in received] == [m.pose.position.x for m in good]
    reasons = "not_finite", "zero_stamp", "stamp_not_increasing", "jump", "unknown_frame"
    assert node._diagnostics._counts == dict.fromkeys(reasons, 1)


def test_when_the_clock_goes_back_the_first_pose_counts(harness):
    node = harness.node(MocapIngest, use_sim_time=True)
    received = []
    unstamped = PoseStamped()
    for first, left_over in ((1000, []), (0, [pose(1003, (0.03, 0.5, 1.0))])):
        harness.set_clock(node, T0 + first * STEP)
        messages = [pose(first + i, (0.01 * i, 0.5, 1.0)) for i in range(3)]
        received += exchange(harness, [*left_over, *messages, unstamped], 3)
    expected = [T0 + k * STEP for k in (1000, 1001, 1002, 0, 1, 2)]
    assert [stamp_ns(message) for message in received] == expected


def test_what_is_left_over_is_known_by_the_trackers_label(harness):
    node = harness.node(MocapIngest, use_sim_time=True, persons=["*"])
    poses = {k: harness.publisher(PoseStamped, f"mocap/{k}/wrist/pose", 10) for k in ("a", "b")}
    harness.spin_until(lambda: {"a/wrist", "b/wrist"} <= node._waiting.keys(), what="both met")
    harness.connect(*poses.values())

    def show(label, index):
        message = pose(index, (0.001 * (index % 1000), 0.5, 1.0))
        harness.tell(node, poses[label], message)

    for first in (1000, 0):
        harness.set_clock(node, T0 + first * STEP)
        if first:
            for label, index in (("a", 1000), ("a", 1001), ("b", 1010)):  # one person, two labels
                show(label, index)
    assert list(node._outputs) == ["a/wrist"]
    show("b", 1011)
    assert node._diagnostics._counts["left_over"] == 1
    assert list(node._outputs) == ["a/wrist"]


def test_people_who_are_named_have_topics_before_they_are_seen(harness):
    """So that nobody who listens misses the first poses: simulated time waits for each."""
    node = harness.node(MocapIngest, persons=["anna", "ben", "*"])
    topics = [f"human/{person}/wrist" for person in ("anna", "ben")]
    harness.spin_until(lambda: all(map(harness.probe.count_publishers, topics)), what="the topics")
    received = harness.collect(Odometry, topics[0], qos.SENSOR)
    poses = harness.publisher(PoseStamped, "mocap/anna/wrist/pose", qos.SENSOR)
    harness.connect(poses, node._outputs["anna/wrist"])
    poses.publish(pose(0, (0.0, 0.5, 1.0)))
    harness.spin_until(lambda: received, what="the first pose")
    assert stamp_ns(received[0]) == T0


def test_a_body_in_millimetres_is_named_once_and_sent_on(harness):
    node = harness.node(MocapIngest)
    exchange(harness, [pose(i, (800.0 + i * 0.001, -400.0, 300.0)) for i in range(4)], 4)
    assert node._diagnostics.rejected("unit_doubtful") == 1


def test_it_warns_of_each_body_that_is_not_tracked(harness, monkeypatch):
    diagnostics = harness.node(MocapIngest, bodies=["wrist", "cup"])._diagnostics
    now_s = diagnostics._clock() + 4.0
    monkeypatch.setattr(diagnostics, "_clock", lambda: now_s)
    diagnostics.tick("mocap/wrist/pose")
    assert diagnostics.report().message == "nothing on mocap/cup/pose for 4 s (publishers: 0)"
