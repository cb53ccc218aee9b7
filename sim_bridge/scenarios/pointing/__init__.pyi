# SPDX-License-Identifier: Apache-2.0
from .execution import PointingRun, execute
from .scene import CIRCLE_CENTRE_M, CIRCLE_DIAMETER_M, SPOTS_M, pointed_at

__all__ = [
    "CIRCLE_CENTRE_M",
    "CIRCLE_DIAMETER_M",
    "SPOTS_M",
    "PointingRun",
    "execute",
    "pointed_at",
]
