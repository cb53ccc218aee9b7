# SPDX-License-Identifier: Apache-2.0
"""Frames on /tf: poses in any frame that moves, and the frames that nodes tell."""

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, Graph
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from scan_builder import scanned
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, to_pose, to_stamp
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.object_messages import to_labelled_cloud
from intent_recognition.nodes.object_warper import ObjectWarper

pytestmark = pytest.mark.slow
T0, STEP = 1_700_000_000_000_000_000, 10_000_000
QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Tracker:
    """A camera on a moving arm, and what becomes of its poses."""

    def __init__(self, harness, transforms, **parameters):
        self.harness, self.type = harness, transforms
        self.node = harness.node(MocapIngest, **parameters)
        self.received = harness.collect(Odometry, "human/wrist", qos.SENSOR)
        self.poses = harness.publisher(PoseStamped, "mocap/wrist/pose", qos.SENSOR)
        self.frames = harness.publisher(transforms, "/tf", qos.TRANSFORMS)
        self.fixed = harness.publisher(transforms, "/tf_static", qos.FIXED_TRANSFORMS)
        harness.connect(self.poses, self.frames, self.fixed)
        harness.spin_until(lambda: harness.probe.count_publishers("human/wrist"))

    def tell(self, index, parent, child, position, orientation=UPRIGHT, *, fixed=False):
        message = TransformStamped(child_frame_id=child)
        message.header.frame_id = parent
        message.header.stamp = to_stamp(T0 + index * STEP)
        pose = to_pose(position, orientation)
        at = message.transform.translation
        at.x, at.y, at.z = position
        message.transform.rotation = pose.orientation
        (self.fixed if fixed else self.frames).publish(self.type(transforms=[message]))

    def see(self, index, position, frame="camera"):
        message = PoseStamped(pose=to_pose(position, UPRIGHT))
        message.header.frame_id = frame
        message.header.stamp = to_stamp(T0 + index * STEP)
        self.poses.publish(message)

    def rejected(self, reason):
        return self.node._diagnostics.rejected(reason)


@pytest.fixture
def transforms(ros_interfaces):
    """The messages of tf2."""
    ros_interfaces("tf2_msgs")
    from tf2_msgs.msg import TFMessage

    return TFMessage


@pytest.fixture
def tracker(transforms, harness):
    return Tracker(harness, transforms, tf_wait=10.0)


def test_a_pose_waits_for_the_transform_at_its_stamp(tracker):
    tracker.tell(0, "flange", "camera", (0.0, 0.0, 0.1), fixed=True)
    tracker.tell(0, "world", "flange", (1.0, 0.0, 0.0), QUARTER)
    tracker.see(1, (0.2, 0.0, 0.0))
    tracker.see(2, (0.2, 0.0, 0.0))
    waiting = tracker.node._waiting["wrist"]
    tracker.harness.spin_until(lambda: len(waiting) == 2, what="both wait")
    assert not tracker.received
    tracker.tell(2, "world", "flange", (1.1, 0.0, 0.0), QUARTER)
    tracker.harness.spin_until(lambda: len(tracker.received) == 2, what="odometry")
    first, second = (message.pose.pose for message in tracker.received)
    assert [stamp_ns(message) for message in tracker.received] == [T0 + STEP, T0 + 2 * STEP]
    for pose, x in ((first, 1.05), (second, 1.1)):
        at, turn = pose.position, pose.orientation
        np.testing.assert_allclose([at.x, at.y, at.z], [x, 0.2, 0.1], atol=1e-9)
        np.testing.assert_allclose([turn.x, turn.y, turn.z, turn.w], QUARTER, atol=1e-9)


def test_a_pose_without_transform_is_refused_with_the_reason(tracker):
    tracker.tell(5, "world", "camera", (0.0, 0.0, 0.0))
    tracker.harness.spin_until(lambda: tracker.node._tree._parents, what="the frame")
    tracker.see(1, (0.2, 0.0, 0.0))
    tracker.harness.spin_until(lambda: tracker.rejected("before_transforms"), what="refused")
    tracker.node._wait_s = 0.0
    tracker.see(2, (0.2, 0.0, 0.0), frame="elsewhere")
    tracker.harness.spin_until(lambda: tracker.rejected("unknown_frame"), what="refused")
    tracker.see(9, (0.2, 0.0, 0.0))
    tracker.harness.spin_until(lambda: tracker.rejected("after_transforms"), what="refused")
    assert not tracker.received


def test_trackers_and_bodies_are_told_as_frames(transforms, harness):
    extrinsics = ["camera 0.0 0.0 1.0 0.0 0.0 0.0 1.0"]
    tracker = Tracker(harness, transforms, extrinsics=extrinsics)
    frames = harness.collect(transforms, "/tf", qos.TRANSFORMS)
    fixed = harness.collect(transforms, "/tf_static", qos.FIXED_TRANSFORMS)
    harness.spin_until(lambda: fixed and tracker.node._frames.heard, what="the tracker's frame")
    (told,) = fixed[0].transforms
    assert (told.header.frame_id, told.child_frame_id) == ("world", "camera")
    assert told.transform.translation.z == 1.0
    tracker.see(1, (0.2, 0.0, 0.0))
    harness.spin_until(lambda: frames, what="the body's frame")
    (told,) = frames[0].transforms
    assert (told.header.frame_id, told.child_frame_id) == ("world", "human_wrist")
    assert told.transform.translation.z == pytest.approx(1.0)
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


def test_the_predicted_hand_is_told_as_a_frame(transforms, harness, tmp_path):
    """Where the predicted path ends."""
    folder = Folder(tmp_path, DOFS)
    frames = harness.collect(transforms, "/tf", qos.TRANSFORMS)
    graph = Graph(harness, folder)
    harness.spin_until(lambda: graph.node._frames.heard, what="somebody listens")
    graph.feed(folder.observations()[:100])
    ends = {stamp_ns(path): path.poses[-1].pose.position for path in graph.path}
    expected = {stamp: ("world", at.x, at.y, at.z) for stamp, at in ends.items()}
    harness.spin_until(
        lambda: expected.keys() <= places(frames, "predicted_hand").keys(), what="each of them"
    )
    told = places(frames, "predicted_hand")
    assert len(expected) > 10 and all(told[stamp] == at for stamp, at in expected.items())


def test_a_warped_object_is_told_as_a_frame(transforms, harness):
    """Where its pose is told, under the name of the node."""
    node = harness.node(ObjectWarper)
    frames = harness.collect(transforms, "/tf", qos.TRANSFORMS)
    poses = harness.collect(PoseStamped, "object/pose", qos.STATE)
    clouds = harness.publisher(PointCloud2, "object/cloud", qos.STATE)
    harness.connect(clouds)
    harness.spin_until(lambda: node._frames.heard, what="somebody listens")
    cloud, header = scanned("tumbler"), Header(frame_id="camera", stamp=to_stamp(T0))
    clouds.publish(
        to_labelled_cloud(header, cloud.points, cloud.normals, np.zeros(len(cloud.points)))
    )
    harness.spin_until(lambda: poses and places(frames, "object_warper"), what="its frame")
    at = poses[0].pose.position
    assert places(frames, "object_warper") == {T0: ("camera", at.x, at.y, at.z)}
