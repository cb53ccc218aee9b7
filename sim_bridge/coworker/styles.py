# SPDX-License-Identifier: Apache-2.0
"""How each task of the toolbox assembly is reached for: goal regions, curvature, wrist turn.

The goal regions overlap on purpose and the hand starts anywhere in one rest region common to all
tasks, so that where the wrist is says little; how it moves away from its own start says which
task it is: a plate is received from above, a screwdriver is fetched with a sweep to the side, and
a screwdriver is handed over low.

World frame: robot base at the origin, x toward the worker, z up; metres, radians.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, frozen

PLATE = "plate_handover"
SCREW = "screw_handover"
HOLD = "hold_screwdriver"
TASKS = (PLATE, SCREW, HOLD)
"""The three tasks of the toolbox assembly (Ewerton et al. 2015, Fig. 5)."""

REST_CENTRE_M, REST_HALF_WIDTH_M = np.array([1.10, 0.0, 0.27]), np.array([0.06, 0.115, 0.10])
"""Middle and half edges of the region in which the hand rests [m], world: as wide as the goals, so
that the start tells no task."""

DURATION_RANGE_S = (1.6, 4.0)
"""Shortest and longest reach without hesitation [s]. Convention."""
LONGEST_MOVEMENT_S = 4.8
"""A hesitation that makes a reach longer than this is left out [s]."""


@dataclass(frozen=True)
class TaskStyle:
    """What the reaches of one task have in common."""

    goal_centre_m: Floats  # middle of the region of goals of the wrist, (3,)
    goal_half_width_m: Floats  # half edges of that box, (3,)
    bow_m: Floats  # mean of the deviation from the straight line where it is largest, (3,)
    bow_std_m: Floats  # individual variation of the bow, (3,)
    turn_rad: Floats  # rotation vector of the wrist from its rest orientation to the goal, (3,)


def _style(*values: tuple[float, float, float]) -> TaskStyle:
    return TaskStyle(*map(frozen, values))


STYLES = {
    PLATE: _style(
        (0.795, 0.00, 0.32),
        (0.07, 0.105, 0.07),
        (0.01, 0.00, 0.080),
        (0.01, 0.010, 0.010),
        (0.9, 0.0, 0.2),
    ),
    SCREW: _style(
        (0.785, 0.02, 0.30),
        (0.07, 0.105, 0.07),
        (0.0, 0.085, 0.010),
        (0.01, 0.010, 0.010),
        (-0.2, 0.4, 0.1),
    ),
    HOLD: _style(
        (0.790, -0.02, 0.30),
        (0.07, 0.105, 0.07),
        (0.0, -0.035, -0.055),
        (0.01, 0.010, 0.010),
        (0.3, -0.3, -0.3),
    ),
}
