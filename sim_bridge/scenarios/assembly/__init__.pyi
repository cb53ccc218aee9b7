# SPDX-License-Identifier: Apache-2.0
from .arm_stand_in import StoodIn, stand_in
from .styles import FASTENING, HAND_OVER, PERSONAL_STD_M

__all__ = [
    "FASTENING",
    "HAND_OVER",
    "PERSONAL_STD_M",
    "StoodIn",
    "stand_in",
]
