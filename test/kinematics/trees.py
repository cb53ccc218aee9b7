# SPDX-License-Identifier: Apache-2.0
"""URDFs with the trees of arms that people have, written from a few words each."""

from itertools import pairwise
from typing import NamedTuple

KINDS = {"r": "revolute", "c": "continuous", "p": "prismatic", "f": "fixed"}
INERTIAL = (
    '<inertial><mass value="0.5"/><inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0"'
    ' iyz="0"/></inertial>'
)
LIMITS = {
    "r": '<limit lower="-3" upper="3" velocity="2" effort="60"/>',
    "c": '<limit velocity="2" effort="60"/>',
    "p": '<limit lower="0" upper="0.3" velocity="0.2" effort="400"/>',
    "f": "",
}


class Tree(NamedTuple):
    """A robot and what is to be found of it.

    Attributes:
        branches: each a row of links, from one that is known on; between them the joints, such as
            "r:elbow" or "r", which is named after its child; "r:a=b" copies joint b.
        tip: that is found; several where one must be named.
        joints: of the arm.
        base: that is named.
        asked: tip that is named.
    """

    branches: tuple[str, ...]
    tip: str
    joints: str
    base: str = ""
    asked: str = ""


def urdf(branches, limits=LIMITS, length_m=0.16):
    """The text of a URDF: joints turn about z and y by turns, links are `length_m` long."""
    links, joints = [], []
    for branch in branches:
        words = branch.split()
        for parent, child in pairwise(words[::2]):
            kind, _, name = words[2 * words[::2].index(child) - 1].partition(":")
            name, _, master = (name or f"{child}_joint").partition("=")
            links += [link for link in (parent, child) if link not in links]
            axis = "0 0 1" if kind == "p" or len(joints) % 3 == 0 else "0 1 0"
            mimic = f'<mimic joint="{master}"/>' if master else ""
            joints.append(
                f'<joint name="{name}" type="{KINDS[kind]}"><parent link="{parent}"/>'
                f'<child link="{child}"/><origin xyz="0 0 {length_m if kind != "f" else 0.02}"/>'
                f'<axis xyz="{axis}"/>{limits[kind]}{mimic}</joint>'
            )
    inside = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in links) + "".join(joints)
    return f'<robot name="tree">{inside}</robot>'


def row(base, prefix, count, kind="r", after=""):
    """A row of `count` joints of one kind: j1, j2, ... of links l1, l2, ..."""
    return base + "".join(f" {kind}:{prefix}j{k} {prefix}l{k}" for k in range(1, count + 1)) + after


def names(prefix, count):
    """Names of the joints of a row."""
    return " ".join(f"{prefix}j{k}" for k in range(1, count + 1))


SIX = names("", 6)


def tree(*branches, tip, joints=SIX, **named):
    """A `Tree` of these branches, by default with an arm of six joints in a row."""
    return Tree(branches, tip, joints, **named)


TREES = {
    "ur": tree(
        "world f base_link f base",
        row("base_link f inertia", "", 6, after=" f flange f tool0"),
        "l6 f ft_frame",
        tip="tool0",
    ),
    "five_fingers": tree(
        "base p:torso torso r head",
        row("torso", "", 7, after=" f palm r:thumb_abd thumb"),
        *(row("palm", f"{finger}_", 7) for finger in ("index", "middle", "ring", "little")),
        tip="palm",
        joints="torso " + names("", 7),
    ),
    "thumb_of_two_joints": tree(
        row("base", "", 6, after=" f hand_mount r th_0 r th_1 r:th_2=th_1_joint th_tip"),
        *(f"hand_mount r {finger}_1 r:{finger}_2={finger}_1_joint {finger}_2" for finger in "abc"),
        tip="hand_mount",
    ),
    "short_arm_on_wheels": tree(
        "odom p:x bx p:y by r:th cart p:lift torso r:a1 l1 r:a2 l2 r:a3 l3 r:a4 l4 f hand",
        "torso r:pan neck r:tilt head",
        "torso r:brush sweeper",
        tip="hand",
        joints="x y th lift a1 a2 a3 a4",
    ),
    "turned_gripper": tree(
        row("base", "", 6, after=" r:GripperYaw hand"), tip="hand", joints=SIX + " GripperYaw"
    ),
    "ur_robotiq": tree(
        row("base_link", "", 6, after=" f tool0 f coupler f robotiq_base"),
        "robotiq_base r:finger_joint left_knuckle f left_outer r:lin=finger_joint left_tip",
        "robotiq_base r:right=finger_joint right_knuckle r:rin=finger_joint right_tip",
        tip="robotiq_base",
    ),
    "kinova_jaco": tree(
        row("world f base", "", 6, "c", " f end_effector"),
        "l6 r:finger_1 f1 r:finger_tip_1 t1",
        "l6 r:finger_2 f2 r:finger_tip_2 t2",
        "l6 r:finger_3 f3 r:finger_tip_3 t3",
        tip="l6",
    ),
    "fetch": tree(
        "base c r_wheel",
        "base c l_wheel",
        "base p:torso torso f bellows",
        row("torso", "", 7, after=" f gripper p:r_gripper_finger r_tip"),
        "gripper p:l_gripper_finger l_tip",
        "torso r head_pan r head_tilt f camera",
        tip="gripper",
        joints="torso " + names("", 7),
    ),
    "fetch_without_lift": tree(
        "base c r_wheel",
        "base p:torso torso",
        row("torso", "", 7, after=" f gripper p:r_gripper_finger r_tip"),
        "torso r head_pan r head_tilt",
        tip="gripper",
        joints=names("", 7),
        base="torso",
    ),
    "so100": tree(
        row("base", "", 4, after=" r:5 Fixed_Jaw r:6 Moving_Jaw"),
        tip="Fixed_Jaw",
        joints=names("", 4) + " 5",
    ),
    "tiago": tree(
        "footprint f base c wheel_right",
        "base c wheel_left",
        "base r caster_1 c caster_wheel_1",
        "base p:torso_lift torso r head_1 r head_2 f camera",
        row("torso", "", 7, after=" f arm_tool f gripper p:gripper_left g1"),
        "gripper p:gripper_right g2",
        tip="gripper",
        joints="torso_lift " + names("", 7),
    ),
    "baxter": tree(
        "base f torso r head f screen",
        row("torso f right_mount", "r_", 7, after=" f right_hand f right_gripper"),
        row("torso f left_mount", "l_", 7, after=" f left_hand f left_gripper"),
        tip="right_gripper or left_gripper",
        joints="",
    ),
    "pr2": tree(
        "footprint f base r caster_rotation c wheel",
        "base p:torso_lift torso r head_pan r head_tilt",
        "torso r laser_tilt",
        row("torso", "r_", 7, after=" f r_palm p:r_gripper_joint r_gripper_tool"),
        row("torso", "l_", 7, after=" f l_palm r:l_l_finger l_lf r:l_lt=l_l_finger l_lft"),
        "l_palm r:l_r_finger=l_l_finger l_rf",
        tip="r_palm or l_palm",
        joints="",
    ),
    "pr2_right": tree(
        "footprint f base r caster_rotation c wheel",
        "base p:torso_lift torso r head_pan r head_tilt",
        row("torso", "r_", 7, after=" f r_palm p:r_gripper_joint r_gripper_tool"),
        row("torso", "l_", 7, after=" f l_palm"),
        tip="r_palm",
        joints=names("r_", 7),
        base="torso",
        asked="r_palm",
    ),
    "one_name": tree(row("base", "", 6, after=" f:hand hand"), tip="hand"),
    "camera": tree(
        row("base", "", 6, after=" f flange f camera_mount f camera_link"),
        "flange f simulated_nail",
        tip="simulated_nail",
    ),
    "camera_alone": tree(
        row("base", "", 6, after=" f tool0 f camera_mount f camera_link"),
        tip="tool0",
    ),
    "behind_a_sensor": tree(row("base", "", 6, after=" f ft_sensor f tcp"), tip="tcp"),
    "scara": tree("base r:a l1 r:b l2 r:c l3 p:d quill", tip="quill", joints="a b c d"),
}
