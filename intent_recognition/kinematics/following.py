# SPDX-License-Identifier: Apache-2.0
"""Joint vectors along a path of poses.

The path is followed from its first pose: the search for each pose starts at the solution before,
and moves a little along the self-motion toward the rest posture. If a limit stops the path although
its poses can be reached, the search restarts from other solutions of the first pose. There is no
restart if the worst pose is out of reach, and a path is given up once it cannot become the best.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.kinematics.pose_search import REACHED, PoseSearch, PoseTarget, Solution

LARGEST_JUMP_RAD = 0.5
"""A joint that turns further between two poses has changed its branch [rad]. In a path of 50 poses,
joints turn by up to a tenth of a radian from one pose to the next."""


class FollowedPath(NamedTuple):
    """Postures along T poses, and their errors."""

    positions: Floats  # joint vectors (T, n) [rad]
    distance_m: Floats  # distance from each position (T,)
    angle_rad: Floats  # angle from each orientation (T,), zero if the orientation is free

    @property
    def reached(self) -> Flags:
        """Whether each pose is reached (T,)."""
        return (self.distance_m <= REACHED) & (self.angle_rad <= REACHED)

    @property
    def largest_jump_rad(self) -> float:
        """Largest joint motion between two poses."""
        return float(np.abs(np.diff(self.positions, axis=0)).max(initial=0.0))


def follow(
    search: PoseSearch, targets: Sequence[PoseTarget], seed: Floats, rest: Floats
) -> FollowedPath:
    """The best path found; see `Arm.follow`."""
    first = search.solve(targets[0], seed, rest)
    best = _follow_from(search, targets, first, rest, len(targets) + 1)
    assert best is not None  # no path misses as many
    if best.reached.all() and best.largest_jump_rad <= LARGEST_JUMP_RAD:
        return best
    worst = int(np.argmax(best.distance_m + best.angle_rad))
    if search.solve(targets[worst], best.positions[worst], rest).error > REACHED:
        return best
    for start in search.starts(targets[0]):
        first = search.slide(targets[0], search.descend(targets[0], start), rest)
        path = _follow_from(search, targets, first, rest, int(np.sum(~best.reached)))
        if path is not None and _badness(path) < _badness(best):
            best = path
        if best.reached.all() and best.largest_jump_rad <= LARGEST_JUMP_RAD:
            break
    return best


def _follow_from(
    search: PoseSearch,
    targets: Sequence[PoseTarget],
    first: Solution,
    rest: Floats,
    most_missed: int,
) -> FollowedPath | None:
    """The path from a posture at its first pose; None beyond `most_missed` (jumps count once)."""
    solutions, missed, jumps = [first], int(first.error > REACHED), False
    for target in targets[1:]:
        if missed + jumps > most_missed:
            return None
        before = solutions[-1].q
        found = search.slide(target, search.descend(target, before), rest, 1, largest_rad=0.05)
        missed += found.error > REACHED
        jumps |= bool(np.abs(found.q - before).max() > LARGEST_JUMP_RAD)
        solutions.append(found)
    positions, distances, angles = zip(*solutions, strict=True)
    return FollowedPath(np.array(positions), np.array(distances), np.array(angles))


def _badness(path: FollowedPath) -> tuple[int, bool, float]:
    """Key for comparing paths: number of missed poses, whether the path jumps, total error."""
    missed = int(np.sum(~path.reached))
    jumps = path.largest_jump_rad > LARGEST_JUMP_RAD
    return missed, jumps, float(np.sum(path.distance_m + path.angle_rad))
