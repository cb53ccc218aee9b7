# SPDX-License-Identifier: Apache-2.0
"""A working session of the coworker: a pure function of its seed, so that a scorer can repeat it.

Each interaction is a reach (onset to end), a hold while the robot comes, a retraction to a new
resting place, and a rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from sim_bridge.coworker.reach import (
    USUAL_BLEND,
    WristMovement,
    blend,
    draw_reach,
    draw_rest,
    draw_retract,
    superposed,
)
from sim_bridge.coworker.styles import STYLES
from sim_bridge.coworker.task_list import REST, Intention, read_intention
from sim_bridge.coworker.timeline import WristSamples, sample_wrist


@dataclass(frozen=True)
class SessionTiming:
    """Timing of a session between its movements.

    Attributes:
        first_idle_s, last_idle_s: rest before the first reach, and at the end of the session.
        idle_s: shortest and longest rest between a retraction and the next reach.
        hold_s: shortest and longest wait for the robot at the end of a reach.
        gaps_per_s: occlusions per second.
        overlap_share: share of each movement's time that remains when the next one begins; 0 if
            each movement ends at rest.
    """

    first_idle_s: float = 2.0
    idle_s: tuple[float, float] = (1.5, 2.1)
    hold_s: tuple[float, float] = (1.25, 1.4)
    last_idle_s: float = 2.0
    gaps_per_s: float = 0.08
    overlap_share: float = 0.0


MOVES_S = 4.1
"""Mean duration of a reach and its retraction [s]."""
WITHOUT_PAUSE = SessionTiming(idle_s=(0.0, 0.0), hold_s=(0.0, 0.0), overlap_share=0.1)
"""Timing in which each movement flows into the next, with rest only before the first and after the
last. After 90 % of a movement's time, 99 % of its way is done."""


@dataclass(frozen=True)
class Interaction:
    """Ground truth of one interaction, for scoring; times are since the session's first sample.

    Attributes:
        task: label of the task; the final one if the reach was changed.
        onset_s, end_s: start and end of the reach.
        goal_m: position at which the wrist stops, (3,), world.
        changed_from: label of the task with which a changed reach began, else empty.
        change_s: time of the change; NaN if there was none.
        leaves_s: time at which the worker stops waiting for the robot.
    """

    task: str
    onset_s: float
    end_s: float
    goal_m: Floats
    reach: WristMovement
    changed_from: str = ""
    change_s: float = np.nan
    leaves_s: float = np.inf


@dataclass(frozen=True)
class SessionPlan:
    """A planned session: the tracker's samples at 100 Hz, and the ground truth in order."""

    samples: WristSamples
    interactions: tuple[Interaction, ...]


def plan_session(
    seed: int, tasks: Sequence[str], timing: SessionTiming | None = None, side: float = 0.0
) -> SessionPlan:
    """Plan a session through `tasks` with new goals, starts, curves and speeds.

    The same arguments give the same plan, bit for bit; sample k is taken 10 k ms after the first.
    See `read_intention` for changes of mind in `tasks`, and `draw_rest` for `side`.

    Raises:
        ArgumentError: a label is unknown, or there is no task.
    """
    if not set(tasks) - {REST}:
        cure = f"Name some of {sorted(STYLES)}."
        raise ArgumentError.about("tasks", "at least one label", "none", cure)
    timing = timing or SessionTiming()
    rng = np.random.default_rng([seed, 2])
    place, now = draw_rest(rng, side), timing.first_idle_s
    movements: list[tuple[float, WristMovement]] = []
    interactions = []
    retract: WristMovement | None = None
    for intention in map(read_intention, tasks):
        if intention.task == REST:
            now += MOVES_S + sum(timing.hold_s + timing.idle_s) / 2.0
            continue
        reach = _intended(rng, intention, place, side)
        movements.append((now, _following(reach, retract, timing)))
        end = now + (1.0 - timing.overlap_share) * reach.duration_s
        retract = draw_retract(rng, reach.goal_m, side)
        back = end + rng.uniform(*timing.hold_s)
        interactions.append(_interaction(intention, now, end, back, reach))
        movements.append((back, _following(retract, reach, timing)))
        place = retract.goal_m
        now = back + (1.0 - timing.overlap_share) * retract.duration_s
        now += rng.uniform(*timing.idle_s)
    last = movements[-1]
    length = last[0] + last[1].duration_s + timing.last_idle_s
    samples = sample_wrist(rng, movements, length, gaps_per_s=timing.gaps_per_s)
    return SessionPlan(samples, tuple(interactions))


def plan_people(
    seed: int, tasks: Sequence[Sequence[str]], timing: SessionTiming | None = None
) -> tuple[SessionPlan, ...]:
    """Plan sessions at one table, of one worker or of two side by side, each with its own seed.

    The first worker's seed is `seed`; the arguments are as in `plan_session`.

    Raises:
        ArgumentError: as in `plan_session`, or there are more than two people.
    """
    if not 1 <= len(tasks) <= 2:  # sides of the table
        cure = "Name no more people."
        raise ArgumentError.about("people", "1 to 2", len(tasks), cure)
    sides = (0.0,) if len(tasks) == 1 else (1.0, -1.0)
    each = enumerate(zip(tasks, sides, strict=True))
    return tuple(plan_session(seed + 1000 * k, own, timing, side) for k, (own, side) in each)


def _intended(
    rng: np.random.Generator, intention: Intention, start_m: Floats, side: float
) -> WristMovement:
    reach = draw_reach(rng, intention.task, start_m, side=side)
    if not intention.then:
        return reach
    then = draw_reach(rng, intention.then, start_m, reach.nominal_s, side=side)
    return blend(reach, then, intention.share, min(USUAL_BLEND, 1.0 - intention.share))


def _following(
    movement: WristMovement, before: WristMovement | None, timing: SessionTiming
) -> WristMovement:
    if before is None or not timing.overlap_share:
        return movement
    into_s = (1.0 - timing.overlap_share) * before.duration_s
    return superposed(movement, before, into_s)


def _interaction(
    intention: Intention, onset_s: float, end_s: float, leaves_s: float, reach: WristMovement
) -> Interaction:
    done = onset_s, end_s, reach.goal_m, reach
    if not intention.then:
        return Interaction(intention.task, *done, leaves_s=leaves_s)
    change_s = onset_s + intention.share * reach.duration_s
    return Interaction(intention.then, *done, intention.task, change_s, leaves_s)
