# SPDX-License-Identifier: Apache-2.0
"""The person at the pole: points with a wand at a spot on the table behind it.

The wand comes to the spot from the side on which the arm is not: a person keeps out of the way of
a robot arm. That is a habit and no rule; how far the wand swings out varies, and some movements
say hardly anything about the side.
"""

from dataclasses import dataclass

import numpy as np

from experiments.pole.geometry import LEFT
from intent_recognition.array_types import Floats
from sim_bridge.coworker import Reach, WristSamples, sample_wrist

REST_M = np.array([1.05, 0.0, 0.25])
"""Middle of the region in which the wand's tip rests [m], world."""
REST_HALF_WIDTH_M = np.array([0.02, 0.03, 0.02])
"""Half edges of that region [m]."""
DURATION_S = (2.4, 4.0)
"""Shortest and longest movement of the wand [s]."""
WAND_HEIGHT_M = 0.01
"""Height of the wand's tip above the spot [m]."""
BOW_M = np.array([0.0, 0.05, 0.06])
"""Deviation from the straight line where it is largest [m]; y away from the arm."""
BOW_STD_M = np.array([0.01, 0.02, 0.01])
"""Its scatter [m]: large enough that some movements say little about the side."""
OCCLUSION_PROBABILITY = 0.3
"""Share of recordings in which the tracker loses the wand now and then."""


@dataclass(frozen=True)
class WandPointing:
    """Rest, one movement of the wand, and hold until the robot points too.

    Attributes:
        reach: the movement of the wand's tip.
        onset_s, end_s: of the movement, in seconds since the first sample.
        arrival_s: when the demonstrator lets the robot arrive.
        samples: what the tracker saw.
    """

    reach: Reach
    onset_s: float
    end_s: float
    arrival_s: float
    samples: WristSamples


def draw_pointing(rng: np.random.Generator, spot_m: Floats, way: str) -> WandPointing:
    """Draw a movement of the wand to a spot (2,) while the robot is led by one side of the pole."""
    onset = round(rng.uniform(0.65, 1.0), 3)
    start = REST_M + REST_HALF_WIDTH_M * rng.uniform(-1.0, 1.0, 3)
    bow = BOW_M * np.array([1.0, -1.0 if way == LEFT else 1.0, 1.0])
    bow = bow + BOW_STD_M * rng.standard_normal(3)
    duration = float(np.exp(rng.uniform(*np.log(DURATION_S))))
    goal = np.array([spot_m[0], spot_m[1], WAND_HEIGHT_M])
    turn = np.array([0.3, 0.0, 0.0]) + 0.12 * rng.standard_normal(3)
    reach = Reach("", start, goal, duration, bow, rng.uniform(1.0, 1.6), turn)
    end = onset + duration
    arrival = end + float(np.clip(rng.normal(0.24, 0.02) * duration, 0.3, 0.95))
    length = arrival + 0.5
    occluded = rng.uniform() < OCCLUSION_PROBABILITY
    samples = sample_wrist(
        rng, [(onset, reach)], length, gaps_per_s=1.5 / length if occluded else 0.0
    )
    return WandPointing(reach, onset, end, arrival, samples)
