# SPDX-License-Identifier: Apache-2.0
"""Joint vectors along a path of poses.

The path is followed from its first pose: each solution begins at the one before, and glides a
little along its self-motion toward the rest posture. Where a limit ends such a path although its
poses can be reached, the search begins again at other solutions of the first pose.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics.pose_search import REACHED, PoseSearch, Solution, Target

LARGEST_JUMP_RAD = 0.5
"""A joint that turns further between two poses has changed its branch [rad]. Convention: a path of
50 poses turns no joint by more than a tenth of a radian from one to the next."""
_GLIDE_RAD = 0.05
"""Longest glide along the self-motion from one pose to the next [rad]. Convention."""


class FollowedPath(NamedTuple):
    """Postures along T poses, and how far from them they are.

    Attributes:
        positions: joint vectors (T, n) [rad].
        distance_m: from each position (T,); zero where it is reached.
        angle_rad: from each orientation (T,), zero where it is free.
    """

    positions: NDArray[np.float64]
    distance_m: NDArray[np.float64]
    angle_rad: NDArray[np.float64]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Which poses are reached (T,)."""
        return (self.distance_m <= REACHED) & (self.angle_rad <= REACHED)

    @property
    def largest_jump_rad(self) -> float:
        """The furthest that a joint turns between two poses."""
        return float(np.abs(np.diff(self.positions, axis=0)).max(initial=0.0))

    def unreached(self) -> str:
        """Which poses are not reached, and by how much; empty if all are."""
        missed = np.flatnonzero(~self.reached)
        if not missed.size:
            return ""
        parts = np.split(missed, np.flatnonzero(np.diff(missed) > 1) + 1)
        worst = float(self.distance_m.max()), float(self.angle_rad.max())
        where = ", ".join(f"{p[0]}-{p[-1]}" if p.size > 1 else f"{p[0]}" for p in parts)
        turned = f" and {worst[1]:.3f} rad" if worst[1] > REACHED else ""
        return f"poses {where} of {len(self.reached)}: up to {worst[0]:.4f} m{turned} out of reach"


def follow(
    search: PoseSearch,
    targets: Sequence[Target],
    seed: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> FollowedPath:
    """The best path found; see `Arm.follow`.

    Args:
        search: of the arm.
        targets: T poses.
        seed: where to begin (n,).
        rest: what redundant joints are drawn to (n,).
    """
    best: FollowedPath | None = None
    for start in _first_postures(search, targets[0], seed, rest):
        path = _follow_from(search, targets, start, rest)
        if best is None or _badness(path) < _badness(best):
            best = path
        if best.reached.all() and best.largest_jump_rad <= LARGEST_JUMP_RAD:
            break
    assert best is not None  # the first posture always is one
    return best


def _first_postures(
    search: PoseSearch, target: Target, seed: NDArray[np.float64], rest: NDArray[np.float64]
) -> Iterator[Solution]:
    yield search.solve(target, seed, rest)
    for start in search.starts(target):
        yield search.slide(target, search.descend(target, start), rest)


def _follow_from(
    search: PoseSearch, targets: Sequence[Target], first: Solution, rest: NDArray[np.float64]
) -> FollowedPath:
    solutions = [first]
    for target in targets[1:]:
        found = search.descend(target, solutions[-1].q)
        solutions.append(search.slide(target, found, rest, 1, _GLIDE_RAD))
    positions, distances, angles = zip(*solutions, strict=True)
    return FollowedPath(np.array(positions), np.array(distances), np.array(angles))


def _badness(path: FollowedPath) -> tuple[int, bool, float]:
    """Poses missed or, with all reached, jumps: fewer are better; then the distance missed."""
    missed = int(np.sum(~path.reached))
    jumps = path.largest_jump_rad > LARGEST_JUMP_RAD
    return missed, jumps, float(np.sum(path.distance_m + path.angle_rad))
