# SPDX-License-Identifier: Apache-2.0
"""A controlled hand: from the DOF file, computed from recorded joints by the robot's URDF."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from bag_builder import LWR, POSE, START_NS, STEP_NS, joints, pose, write_bag, write_pairs
from kinematics.robots import lwr_urdf
from scipy.spatial.transform import Rotation

from intent_recognition.bags.writer import BagWriter
from intent_recognition.demonstrations import read_demonstrations, settle_orientations
from intent_recognition.demonstrations.dofs import DofSpec, load_dofs
from intent_recognition.demonstrations.hand_poses import HAND_LINK, topics_of
from intent_recognition.errors import ArgumentError, DofError
from intent_recognition.kinematics.lwr import ALPHA_RAD, D_M, frame_poses, hand_position
from intent_recognition.share import share_path
from intent_recognition.signals import from_tangent, mean_orientation
from sim_bridge.arm import describe_robot, find_robot

HAND = load_dofs(share_path("config/dofs_hand.yaml"))
POSE_OF_A_LINK = load_dofs(share_path("config/examples/link_pose.dofs.yaml"))
ENTRY = HAND.controlled[0]


def read_one(path, dofs=HAND):
    (found,), rejections = read_demonstrations(path, dofs)
    assert rejections == []
    return found.controlled[0]


def record(path, positions, names=LWR, **more):
    """With the arm's joints at positions (T, 7)."""
    states = [joints(k, positions=one, names=names) for k, one in enumerate(positions)]
    return write_pairs(path, map(pose, range(len(states))), states, **more)


@pytest.mark.parametrize("link", ["lwr_a7_link", "lwr_a6_link"])
def test_the_whole_pose_of_a_named_link_is_computed_from_joints(repository, link):
    """Against the Denavit-Hartenberg chain, whose frames stand where the next joint does."""
    path = repository / "bags/toolbox/test/plate_handover_00"
    asked = [replace(entry, link=link) for entry in POSE_OF_A_LINK.controlled]
    dofs = settle_orientations(replace(POSE_OF_A_LINK, controlled=tuple(asked)), path)
    (found,), rejections = read_demonstrations(path, dofs)
    assert rejections == []
    place, turn = found.controlled
    assert (place.unit, turn.unit) == ("m", "rad")
    assert turn.names == tuple(f"hand/pose.pose.orientation.r{axis}" for axis in "xyz")
    (recorded,) = read_demonstrations(path, load_dofs())[0][0].controlled
    k = int(link[5]) - 1
    to_link = np.eye(4)
    to_link[:3, :3] = Rotation.from_rotvec([-ALPHA_RAD[k], 0.0, 0.0]).as_matrix()
    to_link[2, 3] = -D_M[k]
    poses = frame_poses(recorded.values)[:, k + 1] @ to_link
    np.testing.assert_allclose(place.values, poses[:, :3, 3], atol=1e-9)
    reference = dofs.controlled[1].reference
    turned = Rotation.from_quat(from_tangent(turn.values, reference)).as_matrix()
    np.testing.assert_allclose(turned, poses[:, :3, :3], atol=1e-9)
    mean = mean_orientation(Rotation.from_matrix(poses[:, :3, :3]).as_quat())
    np.testing.assert_allclose(reference, mean, atol=1e-9)


def test_poses_that_were_recorded_are_read_as_they_are(tmp_path):
    with BagWriter(tmp_path / "bag", {"task": "plate"}) as writer:
        for k in range(50):
            at_ns = START_NS + k * STEP_NS
            writer.write_message("mocap/wrist/pose", POSE, pose(k), at_ns)
            writer.write_message("hand/pose", POSE, pose(k, x=0.5 + 0.002 * k), at_ns)
    np.testing.assert_allclose(read_one(tmp_path / "bag").values[:, 0], 0.5 + 0.002 * np.arange(50))


def test_a_recorded_description_and_link_go_before_the_file(tmp_path):
    """The bag's own arm stands half a metre higher than the file's."""
    text = find_robot("lwr", base_position_m=(0.0, 0.0, 0.5)).description
    raised = record(tmp_path / "with", [[0.1] * 7] * 50, description=text)
    plain = record(tmp_path / "without", [[0.1] * 7] * 50)
    shift = read_one(raised).values - read_one(plain).values
    np.testing.assert_allclose(shift, np.tile([0.0, 0.0, 0.5], (50, 1)), atol=1e-12)
    text, still = describe_robot().replace('"lwr_hand"', '"my_tool"'), [0.1, 0.4] + [0.2] * 5
    bag = record(tmp_path / "bag", [still] * 50, description=text, **{HAND_LINK: "my_tool"})
    expected = hand_position(np.array(still))
    np.testing.assert_allclose(read_one(bag).values, np.tile(expected, (50, 1)))


@pytest.mark.parametrize("known_by", ["names", "file", "description"])
def test_an_arm_in_degrees_is_refused_by_its_limits(tmp_path, known_by):
    """The limits are those of the recording's URDF, of the DOF file's, or of the shipped arm."""
    text = lwr_urdf() if known_by == "names" else lwr_urdf().replace("lwr_a", "my_a")
    names = [f"{'lwr' if known_by == 'names' else 'my'}_a{k + 1}_joint" for k in range(7)]
    (tmp_path / "my.urdf").write_text(text)
    (arm,) = load_dofs().controlled
    arm = replace(arm, joints=tuple(names), robot="")
    if known_by == "file":
        arm = replace(arm, robot=str(tmp_path / "my.urdf"))
    dofs = DofSpec.from_dict(replace(load_dofs(), controlled=(arm,)).to_dict())
    description = text if known_by == "description" else ""
    for unit, factor in (("radians", 1.0), ("degrees", 180.0 / np.pi)):
        moved = [[(0.1 + 0.01 * k) * factor] * 7 for k in range(50)]
        record(tmp_path / unit, moved, names, description=description)
    assert read_demonstrations(tmp_path / "radians", dofs)[1] == []
    (refused,) = read_demonstrations(tmp_path / "degrees", dofs)[1]
    assert "my_a2_joint" in refused.reason or "lwr_a2_joint" in refused.reason
    assert "Likely degrees for radians (a factor of 57.3)" in refused.reason


def test_for_a_hand_joints_and_description_are_recorded_too():
    joints_of = load_dofs()
    assert topics_of(joints_of) == ("mocap/wrist/pose", "joint_states")
    needed = ("mocap/wrist/pose", "hand/pose", "joint_states", "robot_description")
    assert topics_of(HAND) == needed


def test_the_file_is_written_back_and_found_beside_a_users_own(tmp_path):
    assert DofSpec.from_dict(HAND.to_dict()) == HAND
    (tmp_path / "mine.urdf").write_text(lwr_urdf())
    content = HAND.to_dict()
    content["controlled"][0]["robot"] = "mine.urdf"
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(content))
    found = load_dofs(tmp_path / "mine.yaml").controlled[0]
    assert found.robot == str(tmp_path / "mine.urdf")
    bag = write_bag(tmp_path / "bag")
    assert read_one(bag, replace(HAND, controlled=(found,))).values.shape == (50, 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"robot": ""}, "hand/pose: expected the robot of its link, got none"),
        ({"robot": "no.urdf"}, "robot: expected a URDF, got .*no.urdf"),
        ({"link": "fist"}, "tip: expected a link of .*, got fist"),
    ],
)
def test_an_arm_that_is_not_known_is_one_line(tmp_path, changes, message):
    bag = write_bag(tmp_path / "bag")
    dofs = replace(HAND, controlled=(replace(ENTRY, **changes),))
    with pytest.raises((DofError, ArgumentError), match=message) as caught:
        read_demonstrations(bag, dofs)
    assert "\n" not in str(caught.value)
