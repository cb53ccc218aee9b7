# SPDX-License-Identifier: Apache-2.0
"""How the worker reaches in each task of the toolbox assembly: goals, curvature, wrist turn.

The goal regions overlap on purpose, and the hand starts anywhere in a rest region common to all
tasks, so the position of the wrist says little. The course of the movement shows the task: the
wrist rises for a plate, sweeps to the side for a screw, and stays low for the screwdriver.

World frame: robot base at the origin, x toward the worker, z up; metres, radians.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from intent_recognition.array_types import Floats, frozen

PLATE = "plate_handover"
SCREW = "screw_handover"
HOLD = "hold_screwdriver"
TASKS = (PLATE, SCREW, HOLD)
"""The three tasks of the toolbox assembly (Ewerton et al. 2015, Fig. 5)."""

REST_CENTRE_M, REST_HALF_WIDTH_M = np.array([1.10, 0.0, 0.27]), np.array([0.06, 0.115, 0.10])
"""Centre and half edges of the region in which the hand rests [m], world; as wide as the goal
regions, so that the start does not reveal the task."""

DURATION_RANGE_S = (1.6, 4.0)
"""Shortest and longest duration of a reach without hesitation [s]."""
LONGEST_MOVEMENT_S = 4.8
"""Hesitations that make a reach longer than this are left out [s]."""


@dataclass(frozen=True)
class TaskStyle:
    """Common properties of the reaches of one task; their spread is that of all tasks."""

    goal_centre_m: Floats  # centre of the box of the wrist's goals, (3,)
    bow_m: Floats  # mean of the largest deviation from the straight line, (3,)
    turn_rad: Floats  # rotation vector of the wrist from its rest orientation to the goal, (3,)
    goal_half_width_m: ClassVar[Floats] = frozen((0.07, 0.105, 0.07))  # half edges of that box
    bow_std_m: ClassVar[Floats] = frozen((0.01, 0.01, 0.01))  # individual variation of the bow


def _style(*values: tuple[float, float, float]) -> TaskStyle:
    return TaskStyle(*map(frozen, values))


STYLES = {
    PLATE: _style((0.795, 0.0, 0.32), (0.01, 0.0, 0.08), (0.9, 0.0, 0.2)),
    SCREW: _style((0.785, 0.02, 0.30), (0.0, 0.085, 0.01), (-0.2, 0.4, 0.1)),
    HOLD: _style((0.79, -0.02, 0.30), (0.0, -0.035, -0.055), (0.3, -0.3, -0.3)),
}
