# SPDX-License-Identifier: Apache-2.0
"""Handover by force: fingers, an object between them, and a person's hand."""

from sim_bridge.handover.fingers import GRIP_M, Fingers, GripFollower, finger_joints, with_fingers
from sim_bridge.handover.grip import CompliantHand, Strength
from sim_bridge.handover.partner import Giver, Manner, SeenRobot, Taker, progress
from sim_bridge.handover.thing import (
    FRICTION,
    HELD_SHARE,
    LEVEL,
    HandedThing,
    TransferObject,
    in_grip,
)
