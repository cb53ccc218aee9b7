# SPDX-License-Identifier: Apache-2.0
"""Places to which two coworkers reach when they assemble a box, and how they vary.

The worker (observed) sits at the far side of the table, the assistant (predicted, later replaced
by the arm) where the robot's base is. There are three tasks, as in Maeda et al. 2014, Fig. 7:

- hand-over: the assistant takes a screw from its tray and brings it to the worker's hand;
- fastening: the worker takes the screwdriver, and presses it on the screw when the assistant holds
  the box. The wrist stops in the same region as in a hand-over;
- plate insertion: the worker takes the plate, and pushes it in when the assistant has flipped the
  box.

World frame: robot base at the origin, x toward the worker, z up; metres, radians, seconds.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, frozen

HAND_OVER = "hand_over"
FASTENING = "fastening"
PLATE_INSERTION = "plate_insertion"
TASKS = (HAND_OVER, FASTENING, PLATE_INSERTION)

WORKER, ASSISTANT = "wrist", "assistant"
"""The two tracked bodies."""


@dataclass(frozen=True)
class Place:
    """A region of wrist positions, uniform in a box around its centre, both (3,)."""

    centre_m: Floats
    half_width_m: Floats

    def draw(self, rng: np.random.Generator) -> Floats:
        """Draw a position (3,)."""
        return self.centre_m + self.half_width_m * rng.uniform(-1.0, 1.0, 3)


def _place(centre: tuple[float, ...], half_width: tuple[float, ...]) -> Place:
    return Place(frozen(centre), frozen(half_width))


RESTS = {
    WORKER: _place((1.08, 0.00, 0.22), (0.05, 0.08, 0.05)),
    ASSISTANT: _place((0.52, -0.12, 0.31), (0.02, 0.03, 0.02)),
}
"""Regions where each wrist rests before any task."""

GOALS = {
    HAND_OVER: _place((0.80, 0.02, 0.34), (0.06, 0.09, 0.05)),
    FASTENING: _place((0.79, 0.00, 0.34), (0.05, 0.08, 0.04)),
    PLATE_INSERTION: _place((0.84, -0.06, 0.28), (0.05, 0.08, 0.04)),
}
"""Regions where the worker's wrist stops: hand held out, screwdriver on screw, plate at the box."""

SCREWDRIVER = _place((0.98, 0.28, 0.22), (0.03, 0.05, 0.02))
PLATE = _place((0.98, -0.28, 0.20), (0.03, 0.05, 0.02))
TRAY = _place((0.54, 0.20, 0.25), (0.02, 0.03, 0.01))
"""Regions of the wrist when the hand takes an object."""

GIVE_M = frozen((-0.15, -0.02, 0.02))
HOLD_M = frozen((-0.20, -0.10, -0.09))
TAKE_BOX_M = frozen((-0.25, 0.14, -0.02))
FLIPPED_M = frozen((-0.28, 0.02, 0.05))
"""Offsets from the worker's goal to the assistant's wrist: screw given, box held, taken, turned."""

PERSONAL_STD_M = 0.012
"""Standard deviation of the assistant's wrist from the worker's goal plus offset, per axis [m]."""

PRESS_M = frozen((0.0, 0.0, -0.02))
PUSH_M = frozen((-0.07, 0.0, 0.0))
"""Displacements of the worker's last movement: pressing the screwdriver, pushing the plate in."""

FLIP_BOW_M = frozen((-0.02, 0.0, 0.10))
"""Bow of the wrist's movement, up and over, when the box is flipped."""

REACTION_S = (0.25, 0.55)
GRASP_S = (0.15, 0.30)
READY_S = (0.10, 0.25)
"""Times to react to the other person, to take an object, and to see the other ready [s]."""

EARLY_S = (0.2, 0.7)
"""Time before the end of the flip at which the worker brings the plate at the earliest [s]."""

TEMPO_LOG_STD = 0.14
PERSONAL_LOG_STD = 0.08
"""Standard deviations of log durations: of a pair's tempo, and of each movement about it."""
