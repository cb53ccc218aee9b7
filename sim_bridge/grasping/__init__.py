# SPDX-License-Identifier: Apache-2.0
"""Grasps tested by lifting: a hand, a table and a container in physics."""

from sim_bridge.grasping.gripper import CLEARANCE_M, FINGER_M, FORCE_N, PAD_M
from sim_bridge.grasping.lifting import (
    DENSITY_KG_M3,
    FRICTION,
    HOLD_S,
    LIFT_M,
    Lifted,
    LiftingWorld,
)

__all__ = [
    "CLEARANCE_M",
    "DENSITY_KG_M3",
    "FINGER_M",
    "FORCE_N",
    "FRICTION",
    "HOLD_S",
    "LIFT_M",
    "PAD_M",
    "Lifted",
    "LiftingWorld",
]
