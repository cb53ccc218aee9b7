# SPDX-License-Identifier: Apache-2.0
"""Forward and inverse kinematics and joint limits of the LWR 4+ and of any chain from a URDF."""

from intent_recognition.kinematics.arm import Arm
from intent_recognition.kinematics.bodies import Bodies, Box, Contact, parse_boxes
from intent_recognition.kinematics.inverse import (
    Branch,
    follow_poses,
    inverse_kinematics,
    reach_position,
    solve,
)
from intent_recognition.kinematics.limits import (
    POSITION_TOLERANCE_RAD,
    RATE_TOLERANCE,
    JointLimits,
    check_position,
    position_violation,
)
from intent_recognition.kinematics.links import Chain, joint_poses, tip_poses
from intent_recognition.kinematics.lwr import (
    DEFAULT_ACCELERATION_RAD_S2,
    JOINT_NAMES,
    LWR_LIMITS,
    forward_kinematics,
    frame_poses,
    hand_position,
    jacobian,
)
from intent_recognition.kinematics.packages import check_meshes, package_shares, packages_around
from intent_recognition.kinematics.urdf import UNLIMITED_RAD, read_chain, read_ranges
from intent_recognition.kinematics.urdf_tree import (
    DEFAULT_EFFORT,
    DEFAULT_SPEED,
    link_of,
    parse_urdf,
    parse_xml,
    read_urdf,
)
