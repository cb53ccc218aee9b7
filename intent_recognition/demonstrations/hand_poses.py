# SPDX-License-Identifier: Apache-2.0
"""Compute the pose of a robot's hand from its recorded joints and its URDF."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.bags import JOINT_STATE, BagReader
from intent_recognition.demonstrations.dofs import DofSpec, relative_topic, robot_path
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import dofs_of
from intent_recognition.errors import DofError, IntentError
from intent_recognition.kinematics import JOINT_NAMES, Arm, read_ranges, read_urdf
from intent_recognition.signals import Demonstration, Known, Signal

JOINTS_TOPIC, DESCRIPTION_TOPIC = "joint_states", "robot_description"
HAND_LINK = "hand_link"
"""Key of a recording's metadata for the hand link of the recorded arm, where its name differs from
the DOF file's."""
LWR = "robots/lwr.urdf"
"""URDF of the shipped arm, as named in a DOF file."""
WORLD_LINK = "world"
"""Link whose frame is used for all positions if the URDF has it."""


def read_by_joints(reader: BagReader, dofs: DofSpec) -> tuple[DofSpec, dict[int, Arm]]:
    """Replace entries for hand poses that were not recorded by entries for the arm's joints.

    Returns:
        The DOFs to read, and the arm for each replaced controlled entry, by the entry's index.
    """
    recorded = {relative_topic(name) for name in reader.topics}
    arms = {
        k: _arm(*_described(reader, recorded, entry))
        for k, entry in enumerate(dofs.controlled)
        if entry.link and entry.topic not in recorded
    }
    controlled = list(dofs.controlled)
    for k, arm in arms.items():
        joints, robot = arm.joint_names, controlled[k].robot
        controlled[k] = DofEntry(JOINTS_TOPIC, JOINT_STATE, joints=joints, unit="rad", robot=robot)
    return replace(dofs, controlled=tuple(controlled)), arms


def as_hands(found: Demonstration, dofs: DofSpec, arms: Mapping[int, Arm]) -> Demonstration:
    """Convert the joints of arms in a demonstration to poses of their hands."""
    controlled = list(found.controlled)
    for k, arm in arms.items():
        entry, joints = dofs.controlled[k], controlled[k]
        values = dofs_of(entry, hand_numbers(entry, arm.forward_kinematics(joints.values)))
        controlled[k] = Signal(entry.names, joints.stamps_ns, values, entry.unit)
    return replace(found, controlled=tuple(controlled), known=() if arms else found.known)


def hand_numbers(entry: DofEntry, poses: Floats) -> Floats:
    """Position (..., 3) or quaternion (..., 4), as the entry requires, of poses (..., 4, 4)."""
    if not entry.orientation:
        return poses[..., :3, 3]
    turns = Rotation.from_matrix(poses[..., :3, :3].reshape(-1, 3, 3)).as_quat()
    return np.asarray(turns.reshape(*poses.shape[:-2], 4), dtype=np.float64)


def arm_in_world(description: str, link: str = "") -> Arm:
    """The whole arm of a URDF's text, with poses in the frame `world` if the URDF has it.

    Its hand is `link`, or by default the end of the arm before the gripper.

    Raises:
        ArgumentError: the URDF cannot be used.
    """
    base = WORLD_LINK if f'name="{WORLD_LINK}"' in description else None
    return Arm.from_urdf(description, base=base, tip=link or None, beyond=True)


def known_of(reader: BagReader, dofs: DofSpec) -> tuple[Known | None, ...]:
    """Joint limits or reach of each controlled entry, from the robot description or DOF file.

    The shipped arm is recognised by its joint names.
    """
    recorded = {relative_topic(name) for name in reader.topics}
    return tuple(_known(reader, recorded, entry) for entry in dofs.controlled)


def _known(reader: BagReader, recorded: set[str], entry: DofEntry) -> Known | None:
    if entry.joints and set(entry.joints) <= set(JOINT_NAMES) and not entry.robot:
        entry = replace(entry, robot=LWR)
    if entry.orientation or entry.quantity != "position":
        return None
    try:
        joints, reach_m = read_ranges(_described(reader, recorded, entry)[0])
    except (IntentError, ValueError):  # no URDF, or a damaged one
        return None
    if entry.link:
        return Known(widest=2.0 * reach_m)
    ranges = np.array([joints.get(name, (-np.inf, np.inf)) for name in entry.joints])
    return Known(*ranges.T) if len(ranges) else None


_arm = lru_cache(maxsize=8)(arm_in_world)


def topics_of(dofs: DofSpec) -> tuple[str, ...]:
    """Topics to record for these DOFs, including those from which a hand's pose is computed."""
    of_hands = (JOINTS_TOPIC, DESCRIPTION_TOPIC) if any(e.link for e in dofs.controlled) else ()
    return tuple(dict.fromkeys((*(entry.topic for entry in dofs.recorded), *of_hands)))


def _described(reader: BagReader, recorded: set[str], entry: DofEntry) -> tuple[str, str]:
    """Text of the URDF for a hand, and the hand's link in it."""
    if DESCRIPTION_TOPIC in recorded:
        for message in reader.messages([DESCRIPTION_TOPIC]):
            return message.message.data, reader.custom_data.get(HAND_LINK, entry.link)
    if not entry.robot:
        cure = "Write robot, the path of its URDF, beside link in the DOF file."
        raise DofError.about(f"/{entry.topic}", "the robot of its link", "none named", cure)
    return read_urdf(robot_path(entry.robot)), entry.link
