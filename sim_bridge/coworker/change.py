# SPDX-License-Identifier: Apache-2.0
"""Reaches in which the worker changes his mind: the goal moves to another task's on the way.

The hand leaves the course of one reach for that of another, which has the same start and the same
timing (Flash and Henis 1991 find that in people).
"""

from dataclasses import replace

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.promp import minimum_jerk
from sim_bridge.coworker.reach import JoinedMovement, Reach, WristMovement

USUAL_BLEND = 0.25
"""Share of the movement that a change takes, where nothing else is said. Convention."""


def joined(
    first: WristMovement, second: WristMovement, change_s: float, onset_s: float, blend_s: float
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
    if not (0.0 < share < 1.0 and 0.0 < blend_share <= 1.0 - share + 1e-9):
        got = f"{blend_share:g} after {share:g}"
        expected = "a positive share of what remains"
        raise ArgumentError.about("blend_share", expected, got, "Change earlier, or faster.")
    timing = last_reach(first)
    second = replace(second, nominal_s=timing.nominal_s, hesitations=timing.hesitations)
    duration_s = first.duration_s
    return joined(first, second, share * duration_s, 0.0, blend_share * duration_s)


def last_reach(movement: WristMovement) -> Reach:
    """The reach that a movement ends as."""
    return movement if isinstance(movement, Reach) else last_reach(movement.second)
