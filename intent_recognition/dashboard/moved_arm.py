# SPDX-License-Identifier: Apache-2.0
"""Kinematics of the arm that the page moves."""

from collections.abc import Callable
from typing import NamedTuple

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.cell import CellState
from intent_recognition.demonstrations import arm_in_world
from intent_recognition.errors import IntentError, one_line
from intent_recognition.kinematics import (
    JOINT_NAMES,
    LWR_LIMITS,
    JointLimits,
    hand_position,
    reach_position,
)


class MovedArm(NamedTuple):
    """An arm's kinematics, as far as the page needs them."""

    joint_names: tuple[str, ...]  # names of the n joints
    # forward kinematics: position of the hand (3,) [m], world, at joint angles (n,) [rad]
    hand: Callable[[Floats], Floats]
    # inverse kinematics: joint angles (n,), near given ones (n,), with the hand at a position (3,);
    # raises KinematicsError if there are none
    posture_at: Callable[[Floats, Floats], Floats]
    limits: JointLimits


LWR = MovedArm(JOINT_NAMES, hand_position, reach_position, LWR_LIMITS)
"""The LWR, which needs no URDF."""


class ArmFinder:
    """Finds the arm of a cell: an LWR by its joint names, others by `robot_description`.

    Without `hand_link` the hand is the last link before the tree branches.

    Attributes:
        problem: why the arm in `robot_description` cannot be moved; empty if it can.
    """

    def __init__(self, hand_link: str = ""):
        self._hand_link = hand_link
        self._description = ""
        self._described: MovedArm | None = None
        self.problem = ""

    def find(self, state: CellState) -> MovedArm | None:
        """The arm whose joint states are received; None without one."""
        if all(name in state.joints for name in JOINT_NAMES):
            return LWR
        if state.description != self._description:
            self._description, self._described, self.problem = state.description, None, ""
            try:
                self._described = describe_arm(state.description, self._hand_link)
            except IntentError as error:
                self.problem = one_line(error)
        arm = self._described
        known = arm is not None and all(name in state.joints for name in arm.joint_names)
        return arm if known else None


def describe_arm(description: str, hand_link: str = "") -> MovedArm:
    """Kinematics of an arm from its URDF; the inverse prefers postures close to the present one.

    Raises:
        ArgumentError: the URDF cannot be used.
    """
    arm = arm_in_world(description, hand_link)
    return MovedArm(
        arm.joint_names,
        lambda q: arm.forward_kinematics(q)[:3, 3],
        lambda position, q: arm.inverse_kinematics(position, q, q),
        arm.limits,
    )
