# SPDX-License-Identifier: Apache-2.0
"""One reach of the wrist: minimum jerk along an individual curve, with hesitation.

If the worker changes their mind, the goal changes to another task's during the movement: the hand
moves from the course of one reach to that of another with the same start and timing, as Flash and
Henis (1991) found in people.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.promp import minimum_jerk
from sim_bridge.coworker.styles import (
    DURATION_RANGE_S,
    LONGEST_MOVEMENT_S,
    REST_CENTRE_M,
    REST_HALF_WIDTH_M,
    STYLES,
)


@dataclass(frozen=True)
class Hesitation:
    """A slow-down within a movement."""

    centre: float  # undisturbed time, in (0, 1), at which the movement is slowest
    width: float  # standard deviation of the slow-down, in undisturbed time
    extra_s: float  # time added to the movement


@dataclass(frozen=True)
class Reach:
    """One movement of the wrist to rest, usually from rest."""

    task: str  # label, or "" for a movement that belongs to no task
    start_m: Floats  # start of the movement, (3,), world
    goal_m: Floats  # end of the movement, (3,), world
    nominal_s: float  # duration without hesitation
    bow_m: Floats  # largest deviation from the straight line, (3,)
    skew: float  # exponent of the bow's decay, >= 1; the bow peaks at progress 1 / (1 + skew)
    # rotation vector of the wrist relative to its rest orientation at the goal, (3,)
    turn_rad: Floats
    hesitations: tuple[Hesitation, ...] = ()

    @property
    def duration_s(self) -> float:
        """Time from onset to end, hesitation included."""
        return self.nominal_s + sum(h.extra_s for h in self.hesitations)

    def positions(self, time_s: Floats) -> Floats:
        """Planned wrist positions (T, 3) in the world at `time_s` (T,) after the onset."""
        progress = progress_at(self, time_s)[:, None]
        straight = self.start_m + (self.goal_m - self.start_m) * progress
        return straight + self.bow_m * bow_profile(progress, self.skew)

    def rotations(self, time_s: Floats, before_rad: Floats) -> Floats:
        """Rotation vectors (T, 3) relative to rest, starting from `before_rad` (3,)."""
        return before_rad + (self.turn_rad - before_rad) * progress_at(self, time_s)[:, None]


@dataclass(frozen=True)
class JoinedMovement:
    """Two movements of the wrist joined to one.

    Attributes:
        first: the movement as first intended, or the one before.
        second: the movement that it turns into.
        change_s: time after the onset at which the intention changes; 0 if it does not.
        positions, rotations: as in a `Reach`.
    """

    first: "WristMovement"
    second: "WristMovement"
    change_s: float
    duration_s: float
    positions: Callable[[Floats], Floats]
    rotations: Callable[[Floats, Floats], Floats]

    @property
    def task(self) -> str:
        """Label of the task in which the movement ends, or ""."""
        return self.second.task

    @property
    def start_m(self) -> Floats:
        """Start of the movement, (3,), world."""
        return self.positions(np.zeros(1))[0]

    @property
    def goal_m(self) -> Floats:
        """End of the movement, (3,), world."""
        return self.second.goal_m


WristMovement: TypeAlias = Reach | JoinedMovement
"""A movement of the wrist."""


def bow_profile(progress: Floats, skew: float) -> Floats:
    """Deviation from the straight line: 0 at both ends, 1 at progress 1 / (1 + skew)."""
    peak = 1.0 / (1.0 + skew)
    return progress * (1.0 - progress) ** skew / (peak * (1.0 - peak) ** skew)


def normalised_time(reach: Reach, time_s: Floats) -> Floats:
    """Undisturbed time in [0, 1] at `time_s` after the onset; it runs slower during hesitations.

    Each hesitation stretches time by a Gaussian in undisturbed time, so that the map is smooth and
    strictly increasing and the movement ends at `reach.duration_s` exactly.
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    tau = np.linspace(0.0, 1.0, 2001)
    elapsed = reach.nominal_s * tau
    for hesitation in reach.hesitations:
        bump = np.exp(-0.5 * ((tau - hesitation.centre) / hesitation.width) ** 2)
        area = np.concatenate(([0.0], np.cumsum(0.5 * (bump[1:] + bump[:-1]))))
        elapsed = elapsed + hesitation.extra_s * area / area[-1]
    return np.interp(time_s, elapsed, tau)


def progress_at(reach: Reach, time_s: Floats) -> Floats:
    """Progress along the straight line, 0 before the onset and 1 after the end."""
    return minimum_jerk(normalised_time(reach, time_s))


def draw_rest(rng: np.random.Generator, side: float = 0.0) -> Floats:
    """Draw a resting place of the wrist (3,), uniform in the rest region common to all tasks.

    With two people, it is in the outer fifth of the region's width on the person's own side of the
    table; `side` is 1 for larger y and -1 for smaller, 0 for one person alone.
    """
    return REST_CENTRE_M + REST_HALF_WIDTH_M * _draw_place(rng, side)


def _draw_place(rng: np.random.Generator, side: float) -> Floats:
    """Draw uniformly between -1 and 1 (3,), with y on one side if `side` is not 0."""
    place = rng.uniform(-1.0, 1.0, 3)
    if side:
        place[1] = side * (0.8 + 0.2 * place[1])
    return place


def draw_reach(
    rng: np.random.Generator,
    task: str,
    start_m: Floats,
    nominal_s: float | None = None,
    side: float = 0.0,
) -> Reach:
    """Draw a reach of a task from a resting place (3,), world, to a new goal of its region.

    Without hesitation it takes `nominal_s`, drawn log-uniformly from 1.6 to 4.0 s if None. `side`
    is as in `draw_rest`, so that the hands of two people do not meet.

    Raises:
        ArgumentError: the task is unknown.
    """
    if task not in STYLES:
        cure = "Correct the label."
        raise ArgumentError.about("task", f"one of {sorted(STYLES)}", repr(task), cure)
    style = STYLES[task]
    goal = style.goal_centre_m + style.goal_half_width_m * _draw_place(rng, side)
    bow = style.bow_m + style.bow_std_m * rng.standard_normal(3)
    skew = rng.uniform(1.0, 1.8)
    turn = style.turn_rad + 0.12 * rng.standard_normal(3)
    low, high = np.log(DURATION_RANGE_S)
    drawn_s = float(np.exp(rng.uniform(low, high)))
    hesitations = draw_hesitations(rng)
    reach = Reach(task, start_m, goal, nominal_s or drawn_s, bow, skew, turn, hesitations)
    if reach.duration_s > LONGEST_MOVEMENT_S:
        reach = replace(reach, hesitations=())
    return reach


def draw_retract(rng: np.random.Generator, start_m: Floats, side: float = 0.0) -> Reach:
    """Draw the way back from `start_m` to a new resting place; `side` is as in `draw_rest`."""
    bow = np.array([0.0, 0.0, 0.02]) + 0.015 * rng.standard_normal(3)
    turn = 0.1 * rng.standard_normal(3)
    return Reach("", start_m, draw_rest(rng, side), rng.uniform(1.1, 1.7), bow, 1.0, turn)


def draw_hesitations(rng: np.random.Generator) -> tuple[Hesitation, ...]:
    """Draw the hesitations of a movement: usually none, otherwise one or two."""
    hesitates = rng.uniform() < 0.35
    count = 1 + int(rng.uniform() < 0.25)
    drawn = tuple(
        Hesitation(rng.uniform(0.3, 0.75), rng.uniform(0.03, 0.06), rng.uniform(0.15, 0.45))
        for _ in range(count)
    )
    return drawn if hesitates else ()


USUAL_BLEND = 0.25
"""Default share of the movement's time that a change takes."""


def joined(
    first: WristMovement, second: WristMovement, change_s: float, onset_s: float, blend_s: float
) -> JoinedMovement:
    """Join a reach to another that began at `onset_s`; the change takes `blend_s`."""

    def done(time_s: Floats) -> Floats:
        """Completed share of the change (T, 1)."""
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
    """Superpose a movement on the end of the one before, `into_s` after the latter's onset.

    People superpose movements in this way (Flash and Henis 1991).
    """

    def positions(time_s: Floats) -> Floats:
        remains = before.positions(time_s + into_s) - before.goal_m
        return movement.positions(time_s) + remains

    return JoinedMovement(before, movement, 0.0, movement.duration_s, positions, movement.rotations)


def blend(first: WristMovement, second: Reach, share: float, blend_share: float) -> JoinedMovement:
    """Join a reach to the course of another with the same start, keeping its own timing.

    The change begins at a share in (0, 1) of the movement's time, and takes `blend_share` of it, at
    most the remaining share. If `first` was changed before, that must have been by `blend`.
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
    """The reach with which a movement ends."""
    return movement if isinstance(movement, Reach) else last_reach(movement.second)
