# SPDX-License-Identifier: Apache-2.0
from .geometry import POLE_M, POLE_RADIUS_M, WAYS, fingertip, planned_clearance, way_of
from .pictures import picture
from .world import PoleRun, execute

__all__ = [
    "POLE_M",
    "POLE_RADIUS_M",
    "WAYS",
    "PoleRun",
    "execute",
    "fingertip",
    "picture",
    "planned_clearance",
    "way_of",
]
