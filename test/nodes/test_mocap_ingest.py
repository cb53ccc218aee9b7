# SPDX-License-Identifier: Apache-2.0
"""The node mocap_ingest on its topics; frames on /tf, in which poses come and that nodes tell."""

from functools import partial

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, Graph
from geometry_msgs.msg import PoseStamped, TransformStamped
from scan_builder import scanned
from std_msgs.msg import Header

from intent_recognition.bags import POSE, LayoutCache, message_fields
from intent_recognition.nodes import conversions, qos
from intent_recognition.nodes.conversions import stamp_ns, to_pose, to_stamp
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.object_messages import to_labelled_cloud
from intent_recognition.nodes.object_warper import ObjectWarper

T0 = 1_700_000_000_123_456_789
STEP = 10_000_000
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def pose(index, position, frame="world", orientation=UPRIGHT):
    message = PoseStamped(pose=to_pose(position, orientation))
    message.header.frame_id = frame
    message.header.stamp = to_stamp(T0 + index * STEP)
    return message


def exchange(harness, messages, body="wrist"):
    """Odometry that the last node makes of poses."""
    node = harness.nodes[-1]
    received = harness.said(node, f"human/{body}")
    for message in messages:
        harness.hear(node, f"mocap/{body}/pose", message)
    return received


def test_odometry_is_of_the_pose_and_its_track(harness):
    """Its fields: test_conversions.py."""
    harness.node(MocapIngest)
    received = exchange(harness, [pose(i, (0.01 * i, 0.5, 1.0)) for i in range(5)])
    last = received[-1]
    assert stamp_ns(last) == T0 + 4 * STEP
    assert last.child_frame_id == "wrist_world_aligned"
    assert last.pose.pose == to_pose((0.04, 0.5, 1.0), UPRIGHT)
    np.testing.assert_allclose(np.diag(last.pose.covariance.reshape(6, 6))[[0, 5]], [4e-6, 4e-4])
    assert last.twist.twist.linear.x == pytest.approx(1.0)
    assert received[0].twist.covariance[0] == 1e6


def test_nodes_load_definitions_before_the_first_pose_comes(harness, tmp_path, monkeypatch):
    """Loading takes as long as 15 poses, of which 10 wait."""
    folder = Folder(tmp_path, DOFS)
    for name, kind in (("_POSES", POSE), ("_ODOMETRIES", "nav_msgs/msg/Odometry")):
        monkeypatch.setattr(conversions, name, LayoutCache(kind))
    message_fields.cache_clear()
    harness.node(MocapIngest)
    loaded = message_fields.cache_info().misses
    assert exchange(harness, [pose(0, (0.0, 0.5, 1.0))])
    assert message_fields.cache_info().misses == loaded
    message_fields.cache_clear()
    graph = Graph(harness, folder)
    loaded = message_fields.cache_info().misses
    graph.feed(folder.observations()[:1])
    assert message_fields.cache_info().misses == loaded


def test_extrinsics_are_applied(harness):
    half = 0.5**0.5
    harness.node(MocapIngest, world_frame="cell", extrinsics=[f"optitrack 1 0 2 0 0 {half} {half}"])
    (odometry,) = exchange(harness, [pose(0, (0.5, 0.0, 0.0), "optitrack")])
    position = odometry.pose.pose.position
    np.testing.assert_allclose((position.x, position.y, position.z), (1.0, 0.5, 2.0), atol=1e-12)
    assert odometry.header.frame_id == "cell"


def test_when_the_clock_goes_back_the_first_pose_counts(harness):
    node = harness.node(MocapIngest, use_sim_time=True)
    received = []
    unstamped = PoseStamped()
    for first, left_over in ((1000, []), (0, [pose(1003, (0.03, 0.5, 1.0))])):
        harness.set_clock(node, T0 + first * STEP)
        messages = [pose(first + i, (0.01 * i, 0.5, 1.0)) for i in range(3)]
        received += exchange(harness, [*left_over, *messages, unstamped])
    expected = [T0 + k * STEP for k in (1000, 1001, 1002, 0, 1, 2)]
    assert [stamp_ns(message) for message in received] == expected


def test_a_single_stamp_ahead_costs_one_pose_and_a_clock_may_be_set(harness):
    node = harness.node(MocapIngest)
    jumps = {50: 500, **dict.fromkeys(range(100, 150), 1000)}  # in steps: alone, and for good
    stamps = [k + jumps.get(k, 0) for k in range(150)]
    received = exchange(harness, [pose(k, (0.001 * k, 0.5, 1.0)) for k in stamps])
    used = [(stamp_ns(message) - T0) // STEP for message in received]
    assert used == [k for k in stamps if k not in (stamps[50], stamps[100])]
    assert node._diagnostics.rejected("stamp_jumped") == 2


def test_what_is_left_over_is_known_by_the_trackers_label(harness):
    node = harness.node(MocapIngest, use_sim_time=True, persons=["*"])
    for label in "ab":
        harness.publisher(PoseStamped, f"mocap/{label}/wrist/pose", 10)
    harness.spin_until(lambda: {"a/wrist", "b/wrist"} <= node._waiting.keys(), what="both met")

    def show(label, index):
        message = pose(index, (0.001 * (index % 1000), 0.5, 1.0))
        harness.hear(node, f"mocap/{label}/wrist/pose", message)

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
    assert {"/human/anna/wrist", "/human/ben/wrist"} <= {p.topic_name for p in node.publishers}
    assert len(exchange(harness, [pose(0, (0.0, 0.5, 1.0))], "anna/wrist")) == 1


def test_a_body_in_millimetres_is_named_once_and_sent_on(harness):
    node = harness.node(MocapIngest)
    exchange(harness, [pose(i, (800.0 + i * 0.001, -400.0, 300.0)) for i in range(4)])
    assert node._diagnostics.rejected("unit_doubtful") == 1


def test_it_warns_of_each_body_that_is_not_tracked(harness, monkeypatch):
    remap = ["--ros-args", "-r", "mocap/cup/pose:=/vrpn/cup"]
    make = partial(MocapIngest, cli_args=remap)
    diagnostics = harness.node(make, bodies=["wrist", "cup"])._diagnostics
    now_s = diagnostics._clock() + 4.0
    monkeypatch.setattr(diagnostics, "_clock", lambda: now_s)
    diagnostics.tick("mocap/wrist/pose")
    assert diagnostics.report().message == "nothing on /vrpn/cup for 4 s (publishers: 0)"


QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))


class Tracker:
    """A camera on a moving arm, and what becomes of its poses."""

    def __init__(self, harness, transforms, **parameters):
        self.harness, self.type = harness, transforms
        self.node = harness.node(MocapIngest, **parameters)
        self.received = harness.said(self.node, "human/wrist")

    def tell(self, index, parent, child, position, orientation=UPRIGHT, *, topic="/tf"):
        message = TransformStamped(child_frame_id=child)
        message.header.frame_id = parent
        message.header.stamp = to_stamp(T0 + index * STEP)
        at = message.transform.translation
        at.x, at.y, at.z = position
        message.transform.rotation = to_pose(position, orientation).orientation
        self.harness.hear(self.node, topic, self.type(transforms=[message]))

    def see(self, index, position, frame="camera"):
        self.harness.hear(self.node, "mocap/wrist/pose", pose(index, position, frame))


@pytest.fixture
def transforms(ros_interfaces):
    """The messages of tf2."""
    ros_interfaces("tf2_msgs")
    from tf2_msgs.msg import TFMessage

    return TFMessage


@pytest.fixture
def tracker(transforms, harness):
    return Tracker(harness, transforms, tf_wait=10.0)


@pytest.mark.slow
def test_a_pose_waits_for_the_transform_at_its_stamp(tracker):
    tracker.tell(0, "flange", "camera", (0.0, 0.0, 0.1), topic="/tf_static")
    tracker.tell(0, "world", "flange", (1.0, 0.0, 0.0), QUARTER)
    tracker.see(1, (0.2, 0.0, 0.0))
    tracker.see(2, (0.2, 0.0, 0.0))
    assert len(tracker.node._waiting["wrist"]) == 2 and not tracker.received
    tracker.tell(2, "world", "flange", (1.1, 0.0, 0.0), QUARTER)
    first, second = (message.pose.pose for message in tracker.received)
    assert [stamp_ns(message) for message in tracker.received] == [T0 + STEP, T0 + 2 * STEP]
    for pose, x in ((first, 1.05), (second, 1.1)):
        at, turn = pose.position, pose.orientation
        np.testing.assert_allclose([at.x, at.y, at.z], [x, 0.2, 0.1], atol=1e-9)
        np.testing.assert_allclose([turn.x, turn.y, turn.z, turn.w], QUARTER, atol=1e-9)


@pytest.mark.slow
def test_a_pose_without_transform_is_refused_with_the_reason(tracker):
    tracker.tell(5, "world", "camera", (0.0, 0.0, 0.0))
    tracker.see(1, (0.2, 0.0, 0.0))
    tracker.node._wait_s = 0.0
    tracker.see(2, (0.2, 0.0, 0.0), frame="elsewhere")
    tracker.see(9, (0.2, 0.0, 0.0))
    reasons = ("before_transforms", "unknown_frame", "after_transforms")
    assert tracker.node._diagnostics._counts == dict.fromkeys(reasons, 1)
    assert not tracker.received


@pytest.mark.slow
def test_trackers_and_bodies_are_told_as_frames(transforms, harness):
    extrinsics = ["camera 0.0 0.0 1.0 0.0 0.0 0.0 1.0"]
    tracker = Tracker(harness, transforms, extrinsics=extrinsics, world_frame="cell")
    fixed = harness.collect(transforms, "/tf_static", qos.FIXED_TRANSFORMS)
    frames = harness.said(tracker.node, "/tf")
    harness.spin_until(lambda: fixed, what="the tracker's frame")
    (told,) = fixed[0].transforms
    assert (told.header.frame_id, told.child_frame_id) == ("cell", "camera")
    assert told.transform.translation.z == 1.0
    tracker.see(1, (0.2, 0.0, 0.0))
    (told,) = frames[0].transforms
    assert (told.header.frame_id, told.child_frame_id) == ("cell", "human_wrist")
    assert told.transform.translation.z == pytest.approx(1.0)
    assert tracker.received[0].header.frame_id == "cell"
    assert stamp_ns(told) == T0 + STEP


def places(messages, child):
    """Frame and place of a child, by the stamp."""
    found = {}
    for message in messages:
        for told in message.transforms:
            if told.child_frame_id == child:
                at = told.transform.translation
                found[stamp_ns(told)] = (told.header.frame_id, at.x, at.y, at.z)
    return found


@pytest.mark.slow
def test_the_predicted_hand_is_told_as_a_frame(transforms, harness, tmp_path):
    """Where the predicted path ends."""
    folder = Folder(tmp_path, DOFS)
    graph = Graph(harness, folder)
    frames = harness.said(graph.node, "/tf")
    graph.feed(folder.observations()[:100])
    ends = {stamp_ns(path): path.poses[-1].pose.position for path in graph.path}
    expected = {stamp: ("world", at.x, at.y, at.z) for stamp, at in ends.items()}
    assert len(expected) > 10 and places(frames, "predicted_hand") == expected


@pytest.mark.slow
def test_a_warped_object_is_told_as_a_frame(transforms, harness):
    """Where its pose is told, under the name of the node."""
    node = harness.node(ObjectWarper)
    frames, poses = (harness.said(node, topic) for topic in ("/tf", "object/pose"))
    cloud, header = scanned("tumbler"), Header(frame_id="camera", stamp=to_stamp(T0))
    labels = np.zeros(len(cloud.points))
    message = to_labelled_cloud(header, cloud.points, cloud.normals, labels)
    harness.hear(node, "object/cloud", message)
    at = poses[0].pose.position
    assert places(frames, "object_warper") == {T0: ("camera", at.x, at.y, at.z)}
