# SPDX-License-Identifier: Apache-2.0
"""Reaches for judging changes of mind, made by rules of which the filter knows nothing.

A reach from rest has an asymmetric beta velocity profile, an individual curve and tremor. A mind
changes by a blend of two courses, by a minimum-jerk reach from the hand's present state, by
a second stroke added to a first one that is given up, or by a stop from which the hand sets out
anew. What changes may be recorded as well as drawn.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly
from scipy.ndimage import gaussian_filter1d
from scipy.special import betainc

from intent_recognition.array_types import Floats
from intent_recognition.signals import Demonstration

STEP_S = 0.01
"""Time between two samples [s]."""
REST_S, AFTER_S = 1.0, 0.5
"""Rest before and after a reach [s]."""
NOISE_M = 0.001
"""Standard deviation of the tracker's noise [m]."""
TREMOR_M, TREMOR_S = 0.0015, 0.06
"""Standard deviation of tremor [m], and the time over which it is smoothed [s]."""
BRAKING_S, PAUSE_S = (0.25, 0.4), (0.1, 0.4)
"""How long a hand takes to stop, and rests then [s]."""

Goals = Mapping[str, Floats]
"""Centres of the tasks' goals by label, (3,) each [m]."""
APART: Goals = {
    "left": np.array([0.45, 0.25, 0.0]),
    "right": np.array([0.45, -0.25, 0.0]),
    "up": np.array([0.45, 0.0, 0.433]),
}
"""Three goals 0.5 m apart."""
ORIGIN = np.zeros(3)
"""Where hands rest [m]."""
ELSEWHERE: Goals = {
    "": np.array([0.45, 0.75, 0.0]),
    " ": np.array([0.1, 0.0, 0.5]),
    "  ": np.array([0.2, -0.55, -0.3]),
    "   ": np.array([-0.3, 0.1, 0.2]),
}
"""Goals of no task, some 0.5 m from those of `APART`."""


class Reach(NamedTuple):
    """Where a hand is meant to be, sample by sample from the onset to the end.

    Attributes:
        task: label of the task that it ends in, "" for none.
        positions: (T, 3), `STEP_S` apart [m].
        before: task that it began as; empty where the mind did not change.
        change_s: time of the change after the onset.
        tremor_m: standard deviation of the hand's tremor; 0 where it was recorded.
    """

    task: str
    positions: Floats
    before: str = ""
    change_s: float = 0.0
    tremor_m: float = TREMOR_M

    @property
    def duration_s(self) -> float:
        """From the onset to the end."""
        return (len(self.positions) - 1) * STEP_S

    @property
    def goal(self) -> Floats:
        """Where it ends, (3,)."""
        return self.positions[-1]

    def changed(self, task: str, positions: Floats, change_s: float) -> "Reach":
        """What became of this reach."""
        return Reach(task, positions, self.task, change_s, self.tremor_m)


def draw(
    rng: np.random.Generator,
    task: str,
    goals: Goals = APART,
    start: Floats | None = None,
    duration_s: float | None = None,
) -> Reach:
    """A reach from rest.

    Args:
        rng: of all variation.
        task: label of its goal.
        goals: where they are.
        start: (3,); None for a resting place.
        duration_s: None for one that people would take.
    """
    if start is None:
        start = 0.015 * rng.standard_normal(3)
    duration_s = duration_s or float(np.exp(np.log(2.2) + 0.2 * rng.standard_normal()))
    goal = goals[task] + 0.03 * rng.standard_normal(3)
    u = np.linspace(0.0, 1.0, round(duration_s / STEP_S) + 1)[:, None]
    rise, fall = 3.0 + 0.2 * rng.standard_normal(), 3.1 + 0.25 * rng.standard_normal()
    done = betainc(max(rise, 2.2), max(fall, 2.6), u)
    way = goal - start
    across = np.cross(way, rng.standard_normal(3))
    bow = 0.08 * rng.standard_normal() * np.linalg.norm(way) * across / np.linalg.norm(across)
    bow = bow + np.array([0.0, 0.0, 0.1 * np.linalg.norm(way)])
    return Reach(task.strip(), start + way * done + bow * np.sin(np.pi * done))


def blended(rng: np.random.Generator, first: Reach, second: Reach, share: float) -> Reach:
    """Over a quarter of the movement into the course of another reach from rest."""
    n = len(first.positions)
    grid = np.linspace(0.0, 1.0, n)
    at = np.linspace(0.0, 1.0, len(second.positions))
    other = np.stack([np.interp(grid, at, column) for column in second.positions.T], axis=1)
    done = 0.5 - 0.5 * np.cos(np.pi * np.clip((grid - share) / 0.25, 0.0, 1.0))[:, None]
    positions = (1.0 - done) * first.positions + done * other
    return first.changed(second.task, positions, share * first.duration_s)


def replanned(rng: np.random.Generator, first: Reach, second: Reach, share: float) -> Reach:
    """By minimum jerk from the hand's position, velocity and acceleration, in 0.75 to 1 of a reach.

    Flash and Henis (1991) find it in people.
    """
    k, state = _state(first, share)
    left_s = second.duration_s * rng.uniform(0.75, 1.0)
    at = np.arange(1, round(left_s / STEP_S) + 1) * STEP_S
    still = np.zeros((2, 3))
    course = BPoly.from_derivatives([0.0, left_s], [state, np.vstack([second.goal, still])])
    positions = np.vstack([first.positions[: k + 1], course(np.minimum(at, left_s))])
    return first.changed(second.task, positions, k * STEP_S)


def superposed(rng: np.random.Generator, first: Reach, second: Reach, share: float) -> Reach:
    """By a second stroke from the first one's goal, added to the first.

    Flash and Henis (1991) find this as well: the first stroke is not given up.
    """
    k = round(share * (len(first.positions) - 1))
    n = round(second.duration_s * rng.uniform(0.75, 1.0) / STEP_S)
    done = betainc(2.8, 3.2, np.linspace(0.0, 1.0, n + 1))[:, None]
    length = max(len(first.positions), k + n + 1)
    added = np.vstack([np.zeros((k, 3)), done * (second.goal - first.goal)])
    positions = _held(first.positions, length) + _held(added, length)
    return first.changed(second.task, positions, k * STEP_S)


def stop_and_go(rng: np.random.Generator, first: Reach, second: Reach, share: float) -> Reach:
    """By a stop on the way, a moment's rest, and a reach from there."""
    k, state = _state(first, share)
    brake_s = rng.uniform(*BRAKING_S)
    at = np.arange(1, round(brake_s / STEP_S) + 1) * STEP_S
    stop = state[0] + state[1] * brake_s * 0.4
    braking = BPoly.from_derivatives([0.0, brake_s], [state, np.vstack([stop, np.zeros((2, 3))])])
    rest = np.repeat(stop[None], round(rng.uniform(*PAUSE_S) / STEP_S), axis=0)
    again = draw(rng, second.task, {second.task: second.goal}, stop, second.duration_s * 0.85)
    parts = [first.positions[: k + 1], braking(np.minimum(at, brake_s)), rest, again.positions]
    return first.changed(second.task, np.vstack(parts), k * STEP_S)


CHANGES: Mapping[str, Callable[[np.random.Generator, Reach, Reach, float], Reach]] = {
    "blended": blended,
    "replanned": replanned,
    "stop and go": stop_and_go,
    "superposed": superposed,
}
"""How a mind changes."""


def recorded(demonstration: Demonstration) -> Reach:
    """The wrist of a recording that is cut to its movement, without the tracker's noise."""
    signal = demonstration.observed[0]
    times_s = (signal.stamps_ns - demonstration.start_ns) * 1e-9
    at = np.arange(0.0, demonstration.duration_s, STEP_S)
    sampled = np.stack([np.interp(at, times_s, column) for column in signal.values.T], axis=1)
    smooth = gaussian_filter1d(sampled, 3.0, axis=0, mode="nearest")
    return Reach(str(demonstration.task), smooth, tremor_m=0.0)


def seen(rng: np.random.Generator, reach: Reach) -> tuple[Floats, Floats]:
    """Times after the onset (T,) [s] and positions (T, 3) [m] of a tracker, with rest around."""
    before, after = round(REST_S / STEP_S), round(AFTER_S / STEP_S)
    positions = np.pad(reach.positions, ((before, after), (0, 0)), mode="edge")
    smooth = TREMOR_S / STEP_S
    tremor = gaussian_filter1d(rng.standard_normal(positions.shape), smooth, axis=0)
    tremor *= reach.tremor_m * np.sqrt(2.0 * np.sqrt(np.pi) * smooth)
    times_s = (np.arange(len(positions)) - before) * STEP_S
    noise = NOISE_M * rng.standard_normal(positions.shape)
    return np.asarray(times_s, dtype=np.float64), positions + tremor + noise


def demonstrations(
    rng: np.random.Generator, per_task: int = 15, goals: Goals = APART, seat: Floats = ORIGIN
) -> list[Demonstration]:
    """Demonstrations of some tasks from a seat (3,); the robot meets the hand with a delay."""
    found = []
    for task in goals:
        for k in range(per_task):
            reach = draw(rng, task, goals)
            times_s, human = seen(rng, reach._replace(positions=reach.positions + seat))
            robot = gaussian_filter1d(human, 15.0, axis=0) @ _ARM + 0.3
            name = f"{task}_{k:02}"
            found.append(
                Demonstration.from_arrays(times_s + 2.0, human, robot, task=task, name=name)
            )
    return found


_ARM = np.array([[0.8, 0.2, 0.1], [-0.3, 1.1, 0.0], [0.1, 0.2, 0.9]])
"""Joint angles of the robot by the position of the hand [rad/m]."""


def _state(reach: Reach, share: float) -> tuple[int, Floats]:
    """Number of a sample, and position, velocity and acceleration there, (3, 3)."""
    k = max(round(share * (len(reach.positions) - 1)), 1)
    velocity = np.gradient(reach.positions, STEP_S, axis=0)
    return k, np.stack([reach.positions[k], velocity[k], np.gradient(velocity, STEP_S, axis=0)[k]])


def _held(positions: Floats, length: int) -> Floats:
    return np.pad(positions, ((0, length - len(positions)), (0, 0)), mode="edge")
