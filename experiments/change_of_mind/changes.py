# SPDX-License-Identifier: Apache-2.0
"""The changes that are studied: blended ones, and reaches replanned from the hand's state.

In a replanned change the hand makes a new reach from where it is, with the velocity and the
acceleration it has (Flash and Henis 1991 find both in people). A movement may also end in no task.
"""

from dataclasses import replace

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge.coworker import (
    STYLES,
    JoinedMovement,
    Reach,
    WristMovement,
    blend,
    draw_reach,
    joined,
    last_reach,
)

ELSEWHERE_M = (np.array([0.70, -0.50, 0.10]), np.array([1.40, 0.50, 0.80]))
"""Corners of the box in which a movement of no task ends [m], world: within reach."""
APART_M = 0.20
"""Least distance of such an end from every task's goal region [m]."""
DIFFERENCE_S = 0.01
"""Step of the finite differences for the wrist's velocity and acceleration [s]: far below the
shortest hesitation, and far above its integration step."""


def change_of_mind(
    rng: np.random.Generator,
    first: WristMovement,
    task: str,
    share: float,
    blend_share: float | None,
) -> JoinedMovement:
    """Change a reach to another task, or to none (""), at a share of its time in (0, 1).

    See `blend`; without a blend the new reach is replanned from the hand's state.
    """
    if blend_share is None:
        return replan(rng, first, task, share)
    second = _draw(rng, task, first.start_m, last_reach(first).nominal_s)
    return blend(first, second, share, blend_share)


def replan(
    rng: np.random.Generator, first: WristMovement, task: str, share: float
) -> JoinedMovement:
    """A reach replanned to another task from the hand's present state.

    The rest takes the time that was left, plus the new reach's own hesitations. Its bow shrinks
    with the length of the way.
    """
    change_s = share * first.duration_s
    before, now, after = first.positions(change_s + DIFFERENCE_S * np.array([-1.0, 0.0, 1.0]))
    drawn = _draw(rng, task, now, first.duration_s - change_s)
    whole, left = (np.linalg.norm(drawn.goal_m - start) for start in (first.start_m, now))
    reach = replace(drawn, bow_m=drawn.bow_m * min(left / whole, 1.0))
    velocity = (after - before) / (2.0 * DIFFERENCE_S)
    second = depart(reach, velocity, (before - 2.0 * now + after) / DIFFERENCE_S**2)
    return joined(first, second, change_s, change_s, 0.0)


def depart(reach: Reach, velocity_m_s: Floats, acceleration_m_s2: Floats) -> JoinedMovement:
    """A reach that begins in motion: minimum jerk takes velocity and acceleration to rest."""
    duration_s = reach.duration_s

    def positions(time_s: Floats) -> Floats:
        u = np.clip(np.asarray(time_s, dtype=np.float64) / duration_s, 0.0, 1.0)[:, None]
        moved = duration_s * (1.0 + 3.0 * u) * velocity_m_s
        moved = moved + 0.5 * duration_s**2 * u * acceleration_m_s2
        return reach.positions(time_s) + u * (1.0 - u) ** 3 * moved

    return JoinedMovement(reach, reach, 0.0, duration_s, positions, reach.rotations)


def draw_elsewhere(rng: np.random.Generator, start_m: Floats, nominal_s: float) -> Reach:
    """Draw a movement that belongs to no task: it ends far from where any task does."""
    while True:
        goal = rng.uniform(*ELSEWHERE_M)
        outside = [
            np.maximum(np.abs(goal - style.goal_centre_m) - style.goal_half_width_m, 0.0)
            for style in STYLES.values()
        ]
        if np.min(np.linalg.norm(outside, axis=1)) >= APART_M:
            bow, turn = 0.03 * rng.standard_normal(3), 0.3 * rng.standard_normal(3)
            return Reach("", start_m, goal, nominal_s, bow, rng.uniform(1.0, 1.8), turn)


def _draw(rng: np.random.Generator, task: str, start_m: Floats, nominal_s: float) -> Reach:
    if task:
        return draw_reach(rng, task, start_m, nominal_s)
    return draw_elsewhere(rng, start_m, nominal_s)
