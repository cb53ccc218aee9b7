# SPDX-License-Identifier: Apache-2.0
"""How a person pours: the path of the lip in one kinesthetic demonstration.

The cup comes from the side, is tilted a little on its way, and pours once the lip is above the
opening; it goes back nearly empty, and therefore earlier and faster. People differ in where over
the opening they stop, how high, how far they tilt in the end and how long they take.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import minimum_jerk
from intent_recognition.warping import References, from_warped
from sim_bridge.scenarios.pouring import PourPath

SAMPLE_S = 0.05
"""Time between two points of a demonstrated path [s]."""

APPROACH = (0.0, 0.35)
EARLY_TILT = (0.05, 0.36)
POUR = (0.34, 0.72)
BACK = (0.82, 1.0)
"""Shares of the duration in which the lip comes, the cup is tilted, pours and goes back."""

START = np.array([-3.0, 0.0, 0.75, 0.0])
POUR_AT = np.array([-0.75, 0.0, 0.28, 0.85])
"""In the warped space: along, across, up, tilt; at the start, and where pouring begins."""

START_STD = np.array([0.15, 0.15, 0.06, 0.0])
POUR_AT_STD = np.array([0.06, 0.07, 0.04, 0.05])
"""Standard deviations of both, in the warped space."""
FULL_TILT_RAD, FULL_TILT_STD_RAD = np.deg2rad(135.0), np.deg2rad(4.0)
"""Final tilt of the cup and its standard deviation [rad]."""
DURATION_S, DURATION_STD_S = 8.0, 0.6
"""Duration of a pour and its standard deviation [s]."""


@dataclass(frozen=True)
class Habit:
    """One way to pour, in the warped space of the containers at hand but for the last tilt.

    Attributes:
        start: along, across, up, tilt (4,) as ratios.
        pour_at: where pouring begins (4,), as ratios.
        full_tilt_rad: how far the cup is tilted in the end.
        duration_s: of all of it.
    """

    start: Floats
    pour_at: Floats
    full_tilt_rad: float
    duration_s: float


def draw_habit(rng: np.random.Generator) -> Habit:
    """How the person pours this time."""
    return Habit(
        START + START_STD * rng.standard_normal(4),
        POUR_AT + POUR_AT_STD * rng.standard_normal(4),
        float(FULL_TILT_RAD + FULL_TILT_STD_RAD * rng.standard_normal()),
        float(DURATION_S + DURATION_STD_S * np.clip(rng.standard_normal(), -2.0, 2.0)),
    )


def plan_pour(habit: Habit, cup: References, second: References) -> PourPath:
    """The path of the lip from rest to rest, by the true references of both containers."""
    count = round(habit.duration_s / SAMPLE_S) + 1
    share = np.linspace(0.0, 1.0, count)

    def progress(window: tuple[float, float]) -> Floats:
        return minimum_jerk((share - window[0]) / (window[1] - window[0]))[:, None]

    over, back = progress(APPROACH), progress(BACK)
    ratios = habit.start + (habit.pour_at - habit.start) * (over - back)
    early = habit.pour_at[3] * progress(EARLY_TILT)
    last = (habit.full_tilt_rad / cup.tilt_rad - habit.pour_at[3]) * progress(POUR)
    ratios[:, 3:] = (early + last) * (1.0 - 0.95 * back)
    offset, tilt = from_warped(ratios, cup, second)
    return PourPath(share * habit.duration_s, offset, tilt)
