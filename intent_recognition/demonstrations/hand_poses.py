# SPDX-License-Identifier: Apache-2.0
"""The hand of a robot from its recorded joints, by its URDF."""

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
"""Key of a recording's metadata: the link that is the hand of the arm it was recorded with, where
that has another name than the DOF file's."""
LWR = "robots/lwr.urdf"
"""URDF of the shipped arm, as a DOF file names it."""
WORLD_LINK = "world"
"""Link whose frame is that of all positions, where a URDF has it."""


def read_by_joints(reader: BagReader, dofs: DofSpec) -> tuple[DofSpec, dict[int, Arm]]:
    """What to read instead of poses of the hand that were not recorded.

    The DOFs with joints in their place, and by index of the controlled entry the arm that turns
    them into poses again.
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
    """A demonstration with the poses of hands in place of the joints of their arms."""
    controlled = list(found.controlled)
    for k, arm in arms.items():
        entry, joints = dofs.controlled[k], controlled[k]
        values = dofs_of(entry, hand_numbers(entry, arm.forward_kinematics(joints.values)))
        controlled[k] = Signal(entry.names, joints.stamps_ns, values, entry.unit)
    return replace(found, controlled=tuple(controlled), known=() if arms else found.known)


def hand_numbers(entry: DofEntry, poses: Floats) -> Floats:
    """What a message of this entry would hold, (..., 3) or (..., 4), for poses (..., 4, 4)."""
    if not entry.orientation:
        return poses[..., :3, 3]
    turns = Rotation.from_matrix(poses[..., :3, :3].reshape(-1, 3, 3)).as_quat()
    return np.asarray(turns.reshape(*poses.shape[:-2], 4), dtype=np.float64)


def arm_in_world(description: str, link: str = "") -> Arm:
    """The whole arm of a URDF's text, its poses in the frame `world` where there is one.

    Its hand is the link, wherever on the arm; without one the end of the arm, before its gripper.

    Raises:
        ArgumentError: it cannot be used.
    """
    base = WORLD_LINK if f'name="{WORLD_LINK}"' in description else None
    return Arm.from_urdf(description, base=base, tip=link or None, beyond=True)


def known_of(reader: BagReader, dofs: DofSpec) -> tuple[Known | None, ...]:
    """What a recording's description, or else the DOF file's, says of each controlled entry.

    The shipped arm is known by the names of its joints.
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
    except (IntentError, ValueError):  # none, or one that is damaged: nothing is known
        return None
    if entry.link:
        return Known(widest=2.0 * reach_m)
    ranges = np.array([joints.get(name, (-np.inf, np.inf)) for name in entry.joints])
    return Known(*ranges.T) if len(ranges) else None


@lru_cache(maxsize=8)
def _arm(description: str, link: str) -> Arm:
    return arm_in_world(description, link)


def topics_of(dofs: DofSpec) -> tuple[str, ...]:
    """What has to be recorded for these DOFs: their topics, and what a hand is computed from."""
    of_hands = (JOINTS_TOPIC, DESCRIPTION_TOPIC) if any(e.link for e in dofs.controlled) else ()
    return tuple(dict.fromkeys((*(entry.topic for entry in dofs.recorded), *of_hands)))


def _described(reader: BagReader, recorded: set[str], entry: DofEntry) -> tuple[str, str]:
    """Text of the URDF of a hand, and the link that is the hand there."""
    if DESCRIPTION_TOPIC in recorded:
        for message in reader.messages([DESCRIPTION_TOPIC]):
            return message.message.data, reader.custom_data.get(HAND_LINK, entry.link)
    if not entry.robot:
        cure = "Write robot, the path of its URDF, beside link in the DOF file."
        raise DofError.about(f"/{entry.topic}", "the robot of its link", "none named", cure)
    return read_urdf(robot_path(entry.robot)), entry.link
