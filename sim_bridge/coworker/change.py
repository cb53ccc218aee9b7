# SPDX-License-Identifier: Apache-2.0
"""Reaches in which the worker changes his mind: the goal moves to another task's on the way.

In a blended change the hand leaves the course of one reach for that of another, which has the same
start and the same timing. In a replanned one it makes a new reach from where it is, with the
velocity and the acceleration it has (Flash and Henis 1991 find both in people).
"""

from dataclasses import replace

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.promp import minimum_jerk
from sim_bridge.coworker.reach import (
    JoinedMovement,
    Reach,
    WristMovement,
    depart,
    draw_reach,
    state_at,
)
from sim_bridge.coworker.styles import STYLES

USUAL_BLEND = 0.25
"""Share of the movement that a change takes, where nothing else is said. Convention."""
ELSEWHERE_M = (np.array([0.70, -0.50, 0.10]), np.array([1.40, 0.50, 0.80]))
"""Corners of the box in which a movement of no task ends [m], world. Convention: in reach."""
APART_M = 0.20
"""Least distance of such an end from every region of goals [m]. Convention."""


def _joined(
    first: WristMovement, second: Reach, change_s: float, onset_s: float, blend_s: float
) -> JoinedMovement:
    """A reach that goes over into another one, which began at `onset_s`, within `blend_s`."""

    def done(time_s: Floats) -> Floats:
        """Share (T, 1) of the change that is done."""
        since_s = time_s - change_s
        share = minimum_jerk(since_s / blend_s) if blend_s else since_s >= 0.0
        return np.asarray(share, dtype=np.float64)[:, None]

    def positions(time_s: Floats) -> Floats:
        meant = first.positions(time_s)
        return meant + done(time_s) * (second.positions(time_s - onset_s) - meant)

    def rotations(time_s: Floats, before_rad: Floats) -> Floats:
        meant = first.rotations(time_s, before_rad)
        then = first.rotations(np.array([onset_s]), before_rad)[0]
        return meant + done(time_s) * (second.rotations(time_s - onset_s, then) - meant)

    duration_s = onset_s + second.duration_s
    return JoinedMovement(first, second, change_s, duration_s, positions, rotations)


def superposed(movement: WristMovement, before: WristMovement, into_s: float) -> JoinedMovement:
    """A movement that begins `into_s` after the onset of one that still ends: the hand makes both.

    So do people who go over from one reach to another (superposition: Flash and Henis 1991).
    """

    def positions(time_s: Floats) -> Floats:
        remains = before.positions(time_s + into_s) - before.goal_m
        return movement.positions(time_s) + remains

    return JoinedMovement(before, movement, 0.0, movement.duration_s, positions, movement.rotations)


def blend(first: WristMovement, second: Reach, share: float, blend_share: float) -> JoinedMovement:
    """A reach that goes over to the course of another from the same start, with its own timing.

    The change begins at a share in (0, 1) of the movement's time, and takes a share of at most what
    remains. A first one that was changed must have been blended.
    """
    _check(share)
    if not 0.0 < blend_share <= 1.0 - share + 1e-9:
        got = f"{blend_share:g} after {share:g}"
        expected = "a positive share of what remains"
        raise ArgumentError.about("blend_share", expected, got, "Change earlier, or faster.")
    timing = _last(first)
    second = replace(second, nominal_s=timing.nominal_s, hesitations=timing.hesitations)
    duration_s = first.duration_s
    return _joined(first, second, share * duration_s, 0.0, blend_share * duration_s)


def replan(
    rng: np.random.Generator, first: WristMovement, task: str, share: float
) -> JoinedMovement:
    """A reach in which a new one to another task begins in the hand's present state.

    It takes the time that was left, and what the new reach's own hesitations add. Its bow is as
    much smaller as the way is shorter. See `change_of_mind`.
    """
    _check(share)
    change_s = share * first.duration_s
    state = state_at(first, change_s)
    drawn = _draw(rng, task, state.position_m, first.duration_s - change_s)
    whole, left = (
        np.linalg.norm(drawn.goal_m - start) for start in (first.start_m, state.position_m)
    )
    second = depart(replace(drawn, bow_m=drawn.bow_m * min(left / whole, 1.0)), state)
    return _joined(first, second, change_s, change_s, 0.0)


def change_of_mind(
    rng: np.random.Generator,
    first: WristMovement,
    task: str,
    share: float,
    blend_share: float | None,
) -> JoinedMovement:
    """Change a reach to another task on the way.

    Args:
        rng: of the second reach.
        first: as it was meant.
        task: the new one; "" for a movement to no task.
        share: of the movement's time at which the mind changes, in (0, 1).
        blend_share: see `blend`; None for a reach replanned from the hand's state.

    Raises:
        ArgumentError: the task is unknown, or a share is not possible.
    """
    if blend_share is None:
        return replan(rng, first, task, share)
    second = _draw(rng, task, first.start_m, _last(first).nominal_s)
    return blend(first, second, share, blend_share)


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


def _last(movement: WristMovement) -> Reach:
    return movement if isinstance(movement, Reach) else _last(movement.second)


def _check(share: float) -> None:
    if not 0.0 < share < 1.0:
        cure = "Give a share of the movement's time."
        raise ArgumentError.about("share", "a number between 0 and 1", share, cure)
