# SPDX-License-Identifier: Apache-2.0
"""Limits the speed along a path by the predicted distance between the person and the arm.

The formula is that of speed and separation monitoring (ISO/TS 15066:2016, 5.5.4; Marvel and
Norcross 2017, "Implementing speed and separation monitoring in collaborative robot workcells"):

    S >= v_h (T_r + T_s) + v_r T_r + S_s + C + Z,    T_s = v_r / a,    S_s = v_r^2 / 2a,

with the person's approach speed v_h, the arm's reaction time T_r and deceleration a, the extent C
of both beyond the measured points, and the uncertainty Z of their positions. It is solved for the
arm's speed v_r. S and Z are those of the predicted tube at the time at which the arm will be there.
This is not a safety function: nothing here is monitored, and predictions can be wrong.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Arm
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.plan import STEP_S, JointPlan
from intent_recognition.motion.retiming import N_GRID


@dataclass(frozen=True)
class SeparationSettings:
    """Quantities of the formula.

    Attributes:
        human_speed_m_s: v_h, approach speed of the person. ISO 13855: 1.6 m/s walking.
        reaction_s: T_r, time until the arm begins to brake: an update and its lead.
        deceleration_m_s2: a, deceleration of the arm's points while it brakes.
        intrusion_m: C, extent of arm and person beyond the measured lines and point: half the
            thickness of a forearm and of a link.
        deviations: number of standard deviations of the tube that make up Z.
        least_speed_m_s: speed permitted at any distance, since a handover ends near the person.
    """

    human_speed_m_s: float = 1.6
    reaction_s: float = 0.1
    deceleration_m_s2: float = 3.0
    intrusion_m: float = 0.1
    deviations: float = 2.0
    least_speed_m_s: float = 0.1

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            above = name in ("deceleration_m_s2", "least_speed_m_s")
            if not (np.isfinite(value) and value >= 0.0 and (value > 0.0 or not above)):
                expected = "a finite number above 0" if above else "a finite number, 0 or more"
                raise ArgumentError.about(name, expected, value, "Change it, or leave it out.")


class PredictedPerson(NamedTuple):
    """The tube of a point of the person, in the frame of the arm's base."""

    times_ns: Integers  # increasing times (T,); the person rests before and after them
    positions: Floats  # mean (T, 3) [m]
    std: Floats  # standard deviation in the least certain direction (T,) [m]

    def at(self, times_ns: NDArray) -> tuple[Floats, Floats]:
        """Mean (S, 3) and standard deviation (S,) at some times (S,)."""
        since = (np.asarray(times_ns) - self.times_ns[0]) * 1e-9
        own = (self.times_ns - self.times_ns[0]) * 1e-9
        mean = np.column_stack([np.interp(since, own, column) for column in self.positions.T])
        return mean, np.interp(since, own, self.std)

    def moved_m(self, before: "PredictedPerson", times_ns: NDArray) -> float:
        """Largest change since an earlier prediction at some times (S,): mean and deviation [m]."""
        (mean, std), (mean_then, std_then) = self.at(times_ns), before.at(times_ns)
        way = np.linalg.norm(mean - mean_then, axis=1) + np.abs(std - std_then)
        return float(way.max())


def permitted_speed(distance_m: Floats, settings: SeparationSettings) -> Floats:
    """The arm's largest speed [m/s] at distances S - Z, any shape, from the person.

    An unknown distance (NaN) counts as zero.
    """
    s, a = settings, settings.deceleration_m_s2
    left = np.asarray(distance_m) - s.intrusion_m - s.human_speed_m_s * s.reaction_s
    linear = s.reaction_s + s.human_speed_m_s / a
    speed = a * (np.sqrt(linear**2 + 2.0 * np.fmax(left, 0.0) / a) - linear)
    return np.maximum(speed, s.least_speed_m_s)


class Separation:
    """Bounds the speed of an arm's points by where a person is predicted to be.

    The points are those of the lines through its joints to the tip.
    """

    def __init__(self, arm: Arm, settings: SeparationSettings | None = None) -> None:
        self.arm = arm
        self.settings = SeparationSettings() if settings is None else settings

    def rate_ceiling(
        self, path: JointPath, times_ns: NDArray, person: PredictedPerson, positions: Floats
    ) -> Floats:
        """Largest phase rate (G,) [1/s] in the intervals of a path's grid, near a person.

        The arm passes the points of the grid at `times_ns` (G + 1,). `positions` (G + 1, n) [rad]
        are where it is then, off the path until it has joined it; the shorter distance counts.
        """
        phase = np.linspace(0.0, 1.0, N_GRID + 1)
        points = self.arm.skeleton(path.spline(phase))
        speed = np.linalg.norm(np.gradient(points, phase, axis=0), axis=2).max(axis=1)
        there = self.distance_m(self.arm.skeleton(positions), times_ns, person)
        distance = np.minimum(self.distance_m(points, times_ns, person), there)
        rate = permitted_speed(distance, self.settings) / np.maximum(speed, 1e-6)
        return np.asarray(np.minimum(rate[:-1], rate[1:]), dtype=np.float64)

    def distance_m(self, points: Floats, times_ns: NDArray, person: PredictedPerson) -> Floats:
        """Distance of the arm from the near side of the tube (S,) [m].

        `points` (S, k, 3) are the arm's joints, from the base on, at the times (S,).
        """
        mean, std = person.at(times_ns)
        begin, way = points[:, :-1], np.diff(points, axis=1)
        off = mean[:, None] - begin
        length = np.maximum(np.einsum("skd,skd->sk", way, way), 1e-12)
        share = np.clip(np.einsum("skd,skd->sk", off, way) / length, 0.0, 1.0)
        gap = np.linalg.norm(off - share[..., None] * way, axis=2).min(axis=1)
        return np.asarray(gap - self.settings.deviations * std, dtype=np.float64)

    def excess(
        self, plan: JointPlan, start_ns: int, person: PredictedPerson, since_ns: int = 0
    ) -> float:
        """A bound on the ratio of the arm's speed to the permitted speed, over a plan.

        It holds from `since_ns` on, at any instant of the cubics of a plan that begins at
        `start_ns`. Both speeds are computed at the ends of an interval; how much they change
        within it is bounded by the joints' motion and by the speed of the tube. Intervals are
        halved until the bound is at most 1, or a ratio above 1 is found.
        """
        since_s = min((since_ns - start_ns) * 1e-9, plan.duration_s)
        knots_s = (person.times_ns - start_ns) * 1e-9
        edges = np.unique(np.clip(np.append(plan.times_s, knots_s), max(since_s, 0.0), None))
        edges = edges[edges <= plan.duration_s]
        return _worst_ratio(edges, partial(self._ratios, plan, start_ns, person))

    def worst_excess(
        self, plan: JointPlan, start_ns: int, people: Sequence[PredictedPerson], since_ns: int = 0
    ) -> float:
        """The largest `excess` over people; 0 without any."""
        found = [self.excess(plan, start_ns, person, since_ns) for person in people]
        return max(found, default=0.0)

    def _ratios(
        self, plan: JointPlan, start_ns: int, person: PredictedPerson, begin: Floats, end: Floats
    ) -> tuple[Floats, Floats]:
        """Ratios at the ends of intervals (S,) [s] without knots inside, and bounds over them."""
        times_s, where, points, speeds, most, bend = _motion(self.arm, plan, begin, end)
        times_ns = start_ns + times_s * 1e9
        distance, (mean, std) = self.distance_m(points, times_ns, person), person.at(times_ns)
        own, (first, last) = speeds.max(axis=1), where
        near = np.linalg.norm(mean[last] - mean[first], axis=1)
        near += self.settings.deviations * np.abs(std[last] - std[first])
        least = 0.5 * (distance[where].sum(axis=0) - most * (end - begin) - near)
        found = own / permitted_speed(distance, self.settings)
        fastest = np.minimum(own[where].max(axis=0) + bend, most)
        return found[where].max(axis=0), fastest / permitted_speed(least, self.settings)


_Ratios = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""Function of intervals, their begins and ends (S,) [s]. Returns the ratios of a speed to the
permitted speed at their ends, and bounds over them."""


def _worst_ratio(edges: Floats, ratios: _Ratios) -> float:
    """A bound on a ratio over intervals, which are halved until it is clearly below or above 1."""
    begin, end, worst = edges[:-1], edges[1:], 0.0
    while begin.size:
        found, bound = ratios(begin, end)
        if found.max() > 1.0:
            return float(found.max())
        undecided = (bound > 1.0) & (end - begin > 1e-4)
        worst = max(worst, bound[~undecided].max(initial=0.0))
        begin, end = begin[undecided], end[undecided]
        middle = 0.5 * (begin + end)
        begin, end = np.append(begin, middle), np.append(middle, end)
    return worst


def _motion(arm: Arm, plan: JointPlan, begin: Floats, end: Floats) -> tuple[Any, ...]:
    """An arm at the ends of intervals (S,) [s]: the times (T,), and which are the ends (2, S).

    At these times the points (T, k, 3) and their speeds (T, k); and bounds (S,) on the speed of any
    point within the intervals, and on what it exceeds its speeds at their ends by. A velocity
    strays by at most c h^2 / 8 from the line between those, where c bounds its second derivative.
    """
    times_s, where = np.unique(np.stack([begin, end]), return_inverse=True)
    where, h = where.reshape(2, -1), (end - begin)[:, None]
    q, v, a = plan.sampled(times_s)
    a = a[where[0]]
    jerk = np.abs(plan.sampled(0.5 * (begin + end))[2] - a) / (0.5 * h)
    fastest = np.abs(v[where]).max(axis=0) + jerk * h**2 / 8.0
    most, change = arm.most_motion(fastest, np.abs(a) + jerk * h, jerk)
    return times_s, where, *arm.moving_skeleton(q, v), most, change * h[:, 0] ** 2 / 8.0


def phase_times_ns(plan: JointPlan, start_ns: int) -> Floats:
    """Times at which a plan is at the points of its path's grid (G + 1,); its start if passed."""
    grid = np.linspace(0.0, 1.0, N_GRID + 1)
    first = np.searchsorted(plan.phase, grid - 1e-12)
    return start_ns + 1e9 * plan.times_s[np.minimum(first, len(plan.times_s) - 1)]


_N_LOOKS = 5
"""Samples of the hand per interval of the grid, near places: 2 mm apart on a path of 1 m."""


class SlowPlaces:
    """Bounds the speed of an arm's tip at places (n, 5) in the frame of its base.

    Each row holds x, y, z, a radius [m], and a largest speed [m/s].
    """

    def __init__(self, arm: Arm, places: Floats) -> None:
        self._arm, self._places = arm, places

    def rate_ceiling(self, path: JointPath) -> Floats:
        """Largest phase rate (G,) [1/s] in the intervals of a path's grid; infinite away from all.

        Each interval is sampled `_N_LOOKS` times. Places are widened by half that spacing, and by
        two short steps of a plan, which speeds up one step before its first faster sample.
        """
        phase = np.linspace(0.0, 1.0, _N_LOOKS * N_GRID + 1)
        hand = self._arm.skeleton(path.spline(phase))[:, -1]
        way = np.linalg.norm(np.gradient(hand, phase, axis=0), axis=1)
        away = np.linalg.norm(hand[:, None] - self._places[:, :3], axis=2)
        reach = self._places[:, 3] + 2.0 * STEP_S * self._places[:, 4]
        there = away <= reach + 0.5 * way[:, None] * phase[1]
        speed = np.where(there, self._places[:, 4], np.inf).min(axis=1) / np.maximum(way, 1e-6)
        least = speed[:-1].reshape(N_GRID, _N_LOOKS).min(axis=1)
        return np.asarray(np.minimum(least, speed[_N_LOOKS::_N_LOOKS]))

    def excess(self, plan: JointPlan, since_s: float = 0.0) -> float:
        """A bound on the ratio of the tip's speed to the speed of its place, over a plan.

        It holds from a time on at any instant of the plan's cubics, like `Separation.excess`.
        """
        edges = np.unique(np.maximum(plan.times_s, since_s))
        return _worst_ratio(edges[edges <= plan.duration_s], partial(self._ratios, plan))

    def _ratios(self, plan: JointPlan, begin: Floats, end: Floats) -> tuple[Floats, Floats]:
        _, where, points, speeds, most, bend = _motion(self._arm, plan, begin, end)
        away = np.linalg.norm(points[:, -1, None] - self._places[:, :3], axis=2)
        nearest = 0.5 * (away[where].sum(axis=0) - (most * (end - begin))[:, None])
        permitted, least = (
            np.where(gap < self._places[:, 3], self._places[:, 4], np.inf).min(axis=1)
            for gap in (away, nearest)
        )
        own = speeds[:, -1]
        fastest = np.minimum(own[where].max(axis=0) + bend, most)
        return (own / permitted)[where].max(axis=0), fastest / least


def parse_places(texts: Sequence[str]) -> Floats:
    """Parse places (n, 5) from texts 'x y z radius speed'.

    Raises:
        ArgumentError: a text does not describe a place.
    """
    places = []
    for text in filter(None, texts):
        try:
            place = [float(word) for word in text.split()]
        except ValueError:
            place = []
        if len(place) != 5 or not np.all(np.isfinite(place)) or min(place[3:]) <= 0.0:
            expected = "'x y z radius speed', the last two above 0"
            raise ArgumentError.about("slow_at", expected, text, "In metres and m/s.")
        places.append(place)
    return np.array(places, dtype=np.float64).reshape(-1, 5)
