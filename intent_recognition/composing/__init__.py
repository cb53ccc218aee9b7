# SPDX-License-Identifier: Apache-2.0
"""Skills that a person composes of learned ones: via points, and tasks one after the other."""

from intent_recognition.composing.bending import (
    LARGEST_DISTANCE,
    BentLibrary,
    bend_all,
    check_via_points,
    control_point,
    hand_columns,
)
from intent_recognition.composing.via_points import (
    HAND,
    USUAL_STD,
    ViaPoint,
    read_via_points,
    write_via_points,
)

__all__ = [
    "HAND",
    "LARGEST_DISTANCE",
    "USUAL_STD",
    "BentLibrary",
    "ViaPoint",
    "bend_all",
    "check_via_points",
    "control_point",
    "hand_columns",
    "read_via_points",
    "write_via_points",
]
