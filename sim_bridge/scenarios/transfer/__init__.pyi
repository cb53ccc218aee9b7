# SPDX-License-Identifier: Apache-2.0
from .cell import HELD_SHARE, OBJECTS, TransferCell, TransferObject
from .robot_side import RobotSide, TransferSample

__all__ = [
    "HELD_SHARE",
    "OBJECTS",
    "RobotSide",
    "TransferCell",
    "TransferObject",
    "TransferSample",
]
