# SPDX-License-Identifier: Apache-2.0
from .execution import PointingRun, execute
from .recordings import PURPOSES, make, orders
from .scene import CIRCLE_CENTRE_M, CIRCLE_DIAMETER_M, SPOTS_M, pointed_at

__all__ = [
    "CIRCLE_CENTRE_M",
    "CIRCLE_DIAMETER_M",
    "PURPOSES",
    "SPOTS_M",
    "PointingRun",
    "execute",
    "make",
    "orders",
    "pointed_at",
]
