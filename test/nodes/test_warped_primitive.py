# SPDX-License-Identifier: Apache-2.0
"""The node warped_primitive on its topics, with what object_warper tells it."""

from functools import cache, partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from scan_builder import scanned
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from intent_recognition.errors import MessageError
from intent_recognition.kinematics import JOINT_NAMES, forward_kinematics
from intent_recognition.nodes.conversions import (
    stamp_ns,
    to_joint_state,
    to_pose,
    trajectory_arrays,
)
from intent_recognition.nodes.object_messages import seen_container, to_named_vector
from intent_recognition.nodes.warped_primitive import WarpedPrimitiveNode
from intent_recognition.objects import find_object, load_object
from intent_recognition.warping import (
    ObjectCloud,
    ObjectModel,
    emptying,
    pouring_parameters,
    warp_object,
)
from sim_bridge.scenarios.pouring import OPENING_M, start_posture
from sim_bridge.scenarios.pouring.live import STAND_M

LIP_M = OPENING_M + np.array([0.0, STAND_M[0], STAND_M[2]])


@cache
def told(name, lip_m=None, opening_m=None):
    """Messages of a container whose lip, toward +y, or whose opening is at a place."""
    source = ObjectModel.learn(load_object(find_object("mug")))
    cloud, turn = scanned(name), Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0]).as_matrix()
    cloud = ObjectCloud(cloud.points @ turn.T, cloud.normals @ turn.T)
    warped = warp_object(source, cloud)
    found = pouring_parameters(warped, toward=np.array([0.0, 1.0, 0.0]))
    move = np.array(lip_m) - found.lip_point if lip_m else np.array(opening_m)
    move = move if lip_m else move - found.opening_centre
    holds = emptying(warped, found.lip_point, 0.01)
    found = found._replace(
        opening_centre=found.opening_centre + move, lip_point=found.lip_point + move
    )
    header = Header(frame_id="world")
    pose = to_pose(found.opening_centre, np.array([0.0, 0.0, 0.0, 1.0]))
    return to_named_vector(header, found, holds), PoseStamped(header=header, pose=pose)


def test_a_container_survives_its_messages():
    vector, pose = told("tea_cup", tuple(LIP_M))
    seen = seen_container(vector, pose)
    values = dict(zip(vector.name, vector.position, strict=True))
    assert seen.references.volume_m3 == values["volume_m3"]
    assert seen.emptying.tilt_leaving(0.25) == values["tilt_leaving_25_percent_rad"]
    np.testing.assert_allclose(seen.lip_m, LIP_M)
    np.testing.assert_allclose(seen.up, [0.0, 0.0, 1.0])
    short = JointState(header=vector.header, name=vector.name[:5], position=vector.position[:5])
    with pytest.raises(MessageError, match="object/parameters"):
        seen_container(short, pose)
    no_rotation = PoseStamped(header=pose.header)
    no_rotation.pose.position, no_rotation.pose.orientation.w = pose.pose.position, 0.0
    with pytest.raises(MessageError, match="rotation"):
        seen_container(vector, no_rotation)
    with pytest.raises(MessageError, match="frames"):
        seen_container(vector, PoseStamped(header=Header(frame_id="camera"), pose=pose.pose))


@pytest.mark.slow
def test_a_request_becomes_a_task_and_a_trajectory(harness, pouring_skill):
    """Too early it is refused; then the arm's own posture, there and back, upright at both ends."""
    node = harness.node(WarpedPrimitiveNode, skill=str(pouring_skill))
    tasks, planned = (harness.said(node, f"intent/{t}") for t in ("tasks", "robot_trajectory"))
    hear, rejected = partial(harness.hear, node), node._diagnostics.rejected
    hear("pour", String(data="empty"))  # too early
    node._on_timer()
    assert rejected("bad_request") == 1 and tasks[-1].position[0] == 0.0
    posture = start_posture("tea_cup")
    hear("joint_states", to_joint_state(JOINT_NAMES, posture, time_ns=5))
    messages = {
        "cup": told("tea_cup", tuple(LIP_M)),
        "second": told("paper_cup", None, tuple(OPENING_M)),
    }
    for name, pair in messages.items():
        for what, message in zip(("parameters", "pose"), pair, strict=True):
            hear(f"{name}/{what}", message)
    hear("pour", String(data="400"))  # too much
    assert rejected("bad_request") == 2
    hear("pour", String(data="50"))
    assert tasks[-1].position[0] == 1.0
    assert planned[0].header.frame_id == tasks[-1].name[0] == "pouring"
    times_s, path, rest = trajectory_arrays(planned[0])
    assert times_s[-1] > 6.0
    assert stamp_ns(planned[0]) > 0
    np.testing.assert_allclose(path[0], posture, atol=1e-4)
    hands = forward_kinematics(path[[0, -1]])
    np.testing.assert_allclose(hands[1], hands[0], atol=1e-4)
    assert rest["effort"].shape == path.shape
    assert rest["effort"][-1].max() < 0.02 < rest["effort"].max() < 0.5
    hear("pour", String(data="10"))  # one at a time
    assert rejected("bad_request") == 3 and len(planned) == 1
    assert node._end_ns > 0
    node._end_ns = node.get_clock().now().nanoseconds  # over; the arm tells once it has held still
    node._on_timer()
    assert tasks[-1].position[0] == 0.0
    before = node._fluid
    told_outcome = [KeyValue(key="outcome", value="arrived")]
    hear("intent/feedback", DiagnosticStatus(name="pouring", values=told_outcome))
    assert node._fluid < before and not rejected("not_poured")
