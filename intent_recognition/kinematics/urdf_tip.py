# SPDX-License-Identifier: Apache-2.0
"""Find the hand in a URDF's tree of links: the end of the arm, before its gripper.

The arm is the branch with the most joints in a row, which excludes fixed branches, wheels, a head
and sensors. Joints that open a gripper do not count. If two arms have equally many joints, the tip
must be named.
"""

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as ET

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics.urdf_tree import link_of

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one degree of freedom."""
_JAW_JOINT = re.compile("(?i)gripper(?!.*(yaw|pitch|roll|rota))|finger|jaw|thumb|knuckle|claw")
"""Names of the last joint of a branch that opens a gripper, rather than turning it."""
_JAW_LINK = re.compile("finger|jaw|thumb|knuckle|claw", re.IGNORECASE)
"""Names of links that a gripper moves; not "gripper", since `gripper_link` may be a palm."""
_TOOL = re.compile("tool|tcp|flange|hand|grip|grasp|end_?effector|(^|_)ee(_|$)", re.IGNORECASE)
"""Names of frames at the end of an arm that are its hand, not a sensor's."""
_SENSOR = re.compile(
    "camera|optical|realsense|lidar|laser|sensor|(^|_)(cam|imu|lens)(_|$)", re.IGNORECASE
)
"""Names of frames of sensors, which are no hand unless a frame beyond them has a hand's name."""
_STANDARD = re.compile("(^|_)tool0$")
"""Name of ROS-Industrial's tool frame, which is preferred to frames beside it."""


class _Below(NamedTuple):
    """The subtree below a link."""

    arm: int = 0  # number of arm joints in the longest row
    links: int = 0  # number of links in the longest row
    moving: frozenset[str] = frozenset()  # names of all moving joints
    tool: bool = False  # whether a link is named like a hand


def default_tip(
    base: str,
    joints: Sequence[ET.Element],
    masters: Mapping[str, str],
    passed: Collection[str] = (),
) -> str:
    """The link that is the hand of a URDF's only or longest arm.

    The joints form a tree below the link `base`, to which the joints `passed` lead. `masters` maps
    each mimic joint to the joint that it follows.
    """
    at: dict[str, list[ET.Element]] = defaultdict(list)
    for joint in joints:
        at[link_of(joint, "parent")].append(joint)
    links = [base]
    for link in links:
        links += [link_of(joint, "child") for joint in at[link]]
    below: dict[str, _Below] = {}
    for link in reversed(links):
        parts = [_with(joint, below, masters) for joint in at[link]]
        below[link] = _Below(
            max((part.arm for part in parts), default=0),
            max((part.links for part in parts), default=0),
            frozenset().union(*(part.moving for part in parts)),
            any(part.tool for part in parts),
        )
    return _walk(base, at, below, masters, frozenset(passed))


def _with(joint: ET.Element, below: Mapping[str, _Below], masters: Mapping[str, str]) -> _Below:
    """The subtree of a joint, including the joint itself."""
    child, name = link_of(joint, "child"), joint.get("name", "")
    beyond = below[child]
    tool, n_links = beyond.tool or bool(_TOOL.search(child)), beyond.links + 1
    if joint.get("type") not in MOVING:
        return _Below(beyond.arm, n_links, beyond.moving, tool)
    copies = {copy for copy, master in masters.items() if master == name}
    jaw = beyond.arm == 0 and (
        _JAW_JOINT.search(name)
        or (not beyond.moving and _JAW_LINK.search(child))
        or copies - beyond.moving  # such as the other finger
    )
    own = int(name not in masters and not jaw)
    return _Below(beyond.arm + own, n_links, beyond.moving | {name}, tool)


def _walk(
    link: str,
    at: Mapping[str, Sequence[ET.Element]],
    below: Mapping[str, _Below],
    masters: Mapping[str, str],
    passed: frozenset[str],
) -> str:
    """The hand below a link to which the joints `passed` lead."""
    while joints := at.get(link, ()):
        parts = [_with(joint, below, masters) for joint in joints]
        most = below[link].arm
        ways = [k for k, part in enumerate(parts) if most and part.arm == most]
        is_hand = 2 * most <= len(passed) and sum(bool(part.moving) for part in parts) > 2
        if is_hand or (len(ways) > 1 and most <= len(passed)):
            return link  # fingers
        if len(ways) > 1:
            ends = [link_of(joints[k], "child") for k in ways]
            inside = passed | below[link].moving
            tips = " or ".join(_walk(end, at, below, masters, inside) for end in ends)
            cure = "Name one (--tip)."
            raise ArgumentError.about("tip", f"{tips}, as there are several arms", "none", cure)
        if not most:
            sensors = [_SENSOR.search(link_of(joint, "child")) is not None for joint in joints]
            ways = _at_the_end(parts, sensors)
            named = [k for k in ways if _STANDARD.search(link_of(joints[k], "child"))]
            ways = named if len(named) == 1 else ways
            held = [joints[k].get("type") not in MOVING for k in ways]
            copies = [masters.get(joints[k].get("name", "")) in passed for k in ways]
            if len(ways) != 1 or not (held[0] or copies[0]):
                return link
        joint = joints[ways[0]]
        if joint.get("type") in MOVING:
            passed |= {joint.get("name", "")}
        link = link_of(joint, "child")
    return link


def _at_the_end(parts: Sequence[_Below], sensors: Sequence[bool]) -> list[int]:
    """Branches beyond the last joint of an arm that may lead to its hand, not to a sensor."""
    if ways := [k for k, part in enumerate(parts) if part.moving]:
        return ways
    ways = [k for k, part in enumerate(parts) if part.tool]
    ways = ways or [k for k, is_sensor in enumerate(sensors) if not is_sensor]
    most = max((parts[k].links for k in ways), default=0)
    return [k for k in ways if parts[k].links == most]
