# SPDX-License-Identifier: Apache-2.0
"""A person points at a spot on the table, and a marker on the wrist is tracked.

The index finger comes down to the spot from the shoulder's side; the wrist stops behind it. How
steeply and from which side the finger comes varies from time to time, so the wrist does not
determine the spot. The marker is not fixed in a rigid, repeatable manner (Maeda et al. 2014,
Sec. IV-B): it is put on anew for every session, and slips a little.
"""

from dataclasses import dataclass, replace

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge.coworker import Reach, WristSamples, sample_wrist

SHOULDER_M = np.array([1.34, 0.18, 0.33])
"""The person's shoulder [m], world."""
REST_M = np.array([1.16, 0.12, -0.02])
"""Where the wrist rests before pointing [m], world."""
WRIST_TO_TIP_M = 0.18
"""From the wrist to the tip of the index finger [m]."""
FINGER_DOWN_RAD = 0.75
"""Mean angle of the finger below the level [rad]."""

REST_STD_M = 0.03
"""Scatter of the rest per axis [m]."""
TIP_STD_M = 0.003
"""Scatter of the fingertip about the spot per axis [m]."""
POSTURE_STD_RAD = 0.035
"""Scatter of the finger's two angles [rad]."""
BOW_M = np.array([0.0, 0.0, 0.06])
"""Mean deviation of the path from the straight line where it is largest [m]."""
BOW_STD_M = 0.015
"""Scatter of that deviation per axis [m]."""
MARKER_PLACEMENT_STD_M = 0.005
"""Scatter of the marker's place on the wrist between sessions, per axis [m]."""
MARKER_SLIP_STD_M = 0.002
"""Scatter of the marker between recordings of one session, per axis [m]."""


@dataclass(frozen=True)
class PersonPointing:
    """One movement of a person: rest, reach, hold.

    Attributes:
        reach: of the wrist.
        onset_s, end_s: start and end of the movement, since the first sample.
        samples: what the tracker saw; its true positions are those of the marker.
    """

    reach: Reach
    onset_s: float
    end_s: float
    samples: WristSamples


def marker_placement(rng: np.random.Generator) -> Floats:
    """Where the marker sits for one session, from where it is meant to be (3,) [m]."""
    return MARKER_PLACEMENT_STD_M * rng.standard_normal(3)


def wrist_goal(rng: np.random.Generator, spot_m: Floats) -> Floats:
    """Where the wrist stops (3,) when the finger points at a spot (3,), world."""
    tip = spot_m + TIP_STD_M * rng.standard_normal(3)
    back = SHOULDER_M[:2] - spot_m[:2]
    yaw = np.arctan2(back[1], back[0]) + POSTURE_STD_RAD * rng.standard_normal()
    down = FINGER_DOWN_RAD + POSTURE_STD_RAD * rng.standard_normal()
    direction = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), np.sin(down)])
    return tip + WRIST_TO_TIP_M * direction


def plan_reach(rng: np.random.Generator, spot_m: Floats) -> Reach:
    """Draw a reach from rest to a spot (3,)."""
    return Reach(
        "",
        REST_M + REST_STD_M * rng.standard_normal(3),
        wrist_goal(rng, spot_m),
        rng.uniform(1.1, 1.7),
        BOW_M + BOW_STD_M * rng.standard_normal(3),
        rng.uniform(1.0, 1.5),
        np.array([0.2, 0.5, 0.1]) + 0.1 * rng.standard_normal(3),
    )


def point(
    rng: np.random.Generator, spot_m: Floats, placement_m: Floats, hold_s: float
) -> PersonPointing:
    """Draw one recording of a person who points at a spot (3,) and holds still for `hold_s`; the
    marker sits at `placement_m` (3,).
    """
    onset = round(rng.uniform(0.6, 0.9), 3)
    reach = plan_reach(rng, spot_m)
    end = onset + reach.duration_s
    samples = sample_wrist(rng, [(onset, reach)], end + hold_s, gaps_per_s=0.15)
    offset = placement_m + MARKER_SLIP_STD_M * rng.standard_normal(3)
    marked = replace(
        samples,
        positions_m=samples.positions_m + offset,
        true_positions_m=samples.true_positions_m + offset,
    )
    return PersonPointing(reach, onset, end, marked)
