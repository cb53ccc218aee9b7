# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of any chain, by damped least squares from several starts.

The damping is the squared error itself: steps are safe far away, unreachable poses are approached,
and convergence is quadratic near the pose (Sugihara 2011, "Solvability-unconcerned inverse
kinematics by the Levenberg-Marquardt method"). A joint at a limit is left out of a step that would
push it further out. If the first start fails, other starts are taken from a table of random
postures, those with the nearest poses first.
"""

import math
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dposv
from scipy.spatial import KDTree

from intent_recognition.array_types import Flags, Floats
from intent_recognition.errors import ShapeError

REACHED, CONVERGED = 1e-6, 1e-9
"""Largest error at which a pose counts as reached [m, and rad of the orientation], and the error at
which a search ends."""
_STALLED, _UNPROMISING = 0.95, 0.4
"""A start is given up if four steps leave more than this share of the squared error. The second
value is used while there are other starts to try, when steps without gain count as well."""
_MANIPULABILITY_WEIGHT = 0.02
"""Weight of the manipulability's logarithm relative to half the squared distance from the rest
posture [rad^2]: a loss of manipulability by a factor of ten costs 0.05 rad^2."""

PoseAndJacobian = Callable[[Floats], tuple[Floats, Floats]]
"""Function from q (n,) to the pose (4, 4) and the geometric Jacobian (6, n), in base axes."""


class PoseTarget(NamedTuple):
    """Position (3,) [m] and rotation (3, 3); None leaves the orientation free."""

    position: Floats
    rotation: Floats | None


def checked_target(target: ArrayLike, argument: str = "target") -> PoseTarget:
    """Convert a pose (4, 4) or a position (3,) to a target, or raise ShapeError."""
    array = np.asarray(target, dtype=np.float64)
    if array.shape not in ((4, 4), (3,)) or not np.all(np.isfinite(array)):
        expected = "a pose (4, 4) or a position (3,), finite"
        raise ShapeError.about(argument, expected, array.shape, "Give one of them.")
    if array.ndim == 1:
        return PoseTarget(array, None)
    rotation = array[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0:
        cure = "Orthonormalise it, for instance by scipy's Rotation."
        raise ShapeError.about(argument, "a rotation in rows 0-2", rotation.tolist(), cure)
    return PoseTarget(array[:3, 3], rotation)


class Solution(NamedTuple):
    """A posture (n,), and its distance from the target [m] and [rad]."""

    q: Floats
    distance_m: float
    angle_rad: float

    @property
    def error(self) -> float:
        """Norm of both distances."""
        return float(np.hypot(self.distance_m, self.angle_rad))


class PoseSearch:
    """Inverse kinematics of one arm."""

    def __init__(
        self, chain: PoseAndJacobian, lower: Floats, upper: Floats, continuous: Flags
    ) -> None:
        self._chain, self._lower, self._upper = chain, lower, upper
        self._ends = np.where(continuous, -np.pi, lower), np.where(continuous, np.pi, upper)

    def solve(self, target: PoseTarget, seed: Floats, rest: Floats) -> Solution:
        """The best posture found; if it reaches the target, moved along its self-motion to rest."""
        best = self.descend(target, seed, hasty=True)
        if best.error <= CONVERGED:
            return self.slide(target, best, rest)
        for start in self.starts(target):
            other = self.descend(target, start, hasty=True)
            best = min(best, other, key=lambda one: one.error)
            if best.error <= CONVERGED:
                return self.slide(target, best, rest)
        return self.descend(target, best.q)

    def descend(self, target: PoseTarget, seed: Floats, *, hasty: bool = False) -> Solution:
        """Least squares from one start (n,), inside the limits; `hasty` if there are others."""
        stalled = _UNPROMISING if hasty else _STALLED
        q = np.clip(seed, self._lower, self._upper)
        error, J = self._error(target, q)
        square, share = float(error @ error), 1.0
        past = [square]
        for _ in range(40):  # successful searches take 5 to 15
            if square < CONVERGED**2 or (len(past) > 4 and square > stalled * past[-5]):
                break
            there = self._step(q, J, J.T @ error, 0.5 * share * square)
            error_there, J_there = self._error(target, there)
            square_there = float(error_there @ error_there)
            if square_there < square:
                q, error, J, square = there, error_there, J_there, square_there
                share *= 0.3
            else:
                share *= 5.0
                if not hasty:
                    continue
            past.append(square)
        angle = float(np.linalg.norm(error[3:])) if len(error) > 3 else 0.0
        return Solution(q, float(np.linalg.norm(error[:3])), angle)

    def slide(
        self,
        target: PoseTarget,
        found: Solution,
        rest: Floats,
        n_steps: int = 3,
        largest_rad: float = 0.5,
    ) -> Solution:
        """Move along the self-motion of a solution toward rest (n,), away from singularities.

        There are at most `n_steps` steps of at most `largest_rad`. A solution that has no
        self-motion, or does not reach the target, is returned as it is.
        """
        if found.error > CONVERGED:
            return found
        cost = self._cost(target, found.q, rest)
        for _ in range(n_steps):
            step = self._slide_step(target, found.q, rest)
            length = float(np.linalg.norm(step))
            if length < 1e-2:
                break
            step *= min(1.0, largest_rad / length)
            moved = self.descend(target, np.clip(found.q + step, self._lower, self._upper))
            cost_there = self._cost(target, moved.q, rest)
            if moved.error > CONVERGED or cost_there >= cost:
                largest_rad = 0.25 * min(largest_rad, length)
                continue
            found, cost = moved, cost_there
        return found

    def starts(self, target: PoseTarget) -> Iterator[Floats]:
        """Postures of the table (n,) whose poses are near the target, nearest first."""
        postures, by_position, by_pose = self._table
        number = 16  # for 1000 random poses, no tested arm needs more
        if target.rotation is None:
            _, rows = by_position.query(target.position, number)
        else:
            place = np.concatenate([target.position, _axes_m(target.rotation)])
            _, rows = by_pose.query(place, number)
        return iter(postures[rows])

    @cached_property
    def _table(self) -> tuple[Floats, KDTree, KDTree]:
        rng = np.random.default_rng(0)
        postures = rng.uniform(*self._ends, size=(4096, len(self._lower)))  # takes 25 ms
        poses = np.array([self._chain(q)[0] for q in postures])
        positions = poses[:, :3, 3]
        places = np.concatenate([positions, _axes_m(poses[:, :3, :3])], axis=1)
        return postures, KDTree(positions), KDTree(places)

    def _step(self, q: Floats, J: Floats, gradient: Floats, damping: float) -> Floats:
        blocked = ((q <= self._lower) & (gradient < 0.0)) | ((q >= self._upper) & (gradient > 0.0))
        H = J.T @ J
        H.flat[:: len(q) + 1] += damping + 1e-12
        if blocked.any():
            H[blocked] = 0.0
            H[:, blocked] = 0.0
            H[blocked, blocked] = 1.0
            gradient = np.where(blocked, 0.0, gradient)
        _, step, _ = dposv(H, gradient)
        largest = max(float(step.max()), -float(step.min()))
        if largest > 0.4:  # [rad]: range of the linearisation
            step *= 0.4 / largest
        return np.minimum(np.maximum(q + step, self._lower), self._upper)

    def _error(self, target: PoseTarget, q: Floats) -> tuple[Floats, Floats]:
        """Error to the target, (3,) or (6,), and the corresponding rows of the Jacobian."""
        pose, J = self._chain(q)
        shift = target.position - pose[:3, 3]
        if target.rotation is None:
            return shift, J[:3]
        return np.concatenate([shift, _rotation_vector(target.rotation @ pose[:3, :3].T)]), J

    def _cost(self, target: PoseTarget, q: Floats, rest: Floats) -> float:
        J = self._chain(q)[1][: 3 if target.rotation is None else 6]
        away = q - rest
        return 0.5 * float(away @ away) - _MANIPULABILITY_WEIGHT * _log_manipulability(J)

    def _slide_step(self, target: PoseTarget, q: Floats, rest: Floats) -> Floats:
        J = self._chain(q)[1][: 3 if target.rotation is None else 6]
        pull = rest - q
        kept = ~(((q <= self._lower) & (pull < 0.0)) | ((q >= self._upper) & (pull > 0.0)))
        _, values, rows = np.linalg.svd(J[:, kept])
        rank = int(np.sum(values > 1e-6 * values[0])) if values.size else 0
        motions = np.zeros((len(rows) - rank, len(q)))
        motions[:, kept] = rows[rank:]
        here = _log_manipulability(J)
        step, small_rad = np.zeros(len(q)), 1e-4
        for motion in motions:
            there = self._chain(q + small_rad * motion)[1][: len(J)]
            slope = (_log_manipulability(there) - here) / small_rad
            step += (motion @ pull + _MANIPULABILITY_WEIGHT * slope) * motion
        return step


def _axes_m(rotation: Floats) -> Floats:
    """Two axes (..., 6) of rotations (..., 3, 3); a turn of one radian counts as 0.25 m."""
    return 0.25 * np.swapaxes(rotation[..., :2], -1, -2).reshape(*rotation.shape[:-2], 6)


def _log_manipulability(J: Floats) -> float:
    """Half the logarithm of det(J J^T) (Yoshikawa 1985), bounded below."""
    return 0.5 * float(np.log(max(np.linalg.det(J @ J.T), 1e-24)))


def _rotation_vector(turn: Floats) -> Floats:
    """Axis times angle (3,) of a rotation matrix; at half a turn the axis is of either sign."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn.tolist()
    x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    if sine > 1e-6:
        scale = math.atan2(sine, cosine) / sine
        return np.array([scale * x, scale * y, scale * z])
    if cosine > 0.0:
        return np.array([x, y, z])
    axis = np.sqrt(np.maximum(0.5 * (np.diag(turn) + 1.0), 0.0))
    signs = np.where(turn[int(np.argmax(axis))] < 0.0, -1.0, 1.0)
    return np.pi * axis * signs
