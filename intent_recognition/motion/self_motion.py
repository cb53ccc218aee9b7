# SPDX-License-Identifier: Apache-2.0
"""Turning a redundant arm about its hand, where the end of a path would touch something.

If a hand is predicted and not the joints, the end of a path is one of many postures that bring the
hand there. The nearest clear posture is found along the arm's self-motion, the null space of the
Jacobian J of the hand's position or pose (Liegeois 1977, "Automatic supervisory control of the
configuration and behavior of multibody mechanisms"):

    minimise d^T d   subject to   G P d >= b,   P = I - J^+ J

with distances linearised in the joints, as in `bending`. After each step Newton's method brings the
hand back. Along the path the arm turns gradually, and the hand keeps to the prediction.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Arm, Bodies, JointLimits
from intent_recognition.motion.bending import BEYOND_M, least_change
from intent_recognition.motion.hand_path import LARGEST_JUMP_RAD, LARGEST_SHORTFALL_M, N_POSES
from intent_recognition.motion.path import JointPath, make_path
from intent_recognition.motion.plan import POSITION_MARGIN_RAD
from intent_recognition.promp import minimum_jerk


class Turn(NamedTuple):
    """How the arm turns about its hand along a path."""

    since: float  # phase from which on it turns
    shift: Floats  # shift of the joints at the end (n,) [rad]


class HandKept:
    """Moves an arm and keeps its hand's position, or its whole pose if `oriented`."""

    def __init__(self, arm: Arm, oriented: bool, limits: JointLimits) -> None:
        self._arm, self._rows, self._limits = arm, 6 if oriented else 3, limits
        self._lower = limits.lower + POSITION_MARGIN_RAD
        self._upper = limits.upper - POSITION_MARGIN_RAD

    def clear_end(self, bodies: Bodies, end: Floats) -> Floats | None:
        """The nearest clear posture found (n,) with the hand where it is at the posture `end` (n,).

        None if `end` is clear already, or no clear posture was found.
        """
        if not bodies.contacts(end[None]):
            return None
        pose = self._arm.forward_kinematics(end)
        motions = null_space(self._jacobian(end)).T
        if not len(motions):
            return None
        found = self._descend(bodies, pose, end)
        if found is not None:
            return found
        # 0.6 rad is a third of the usual range of shoulder and wrist joints to one side
        starts = (end + s * 0.6 * motion for motion in motions for s in (1.0, -1.0))
        others = (self._descend(bodies, pose, self._onto(pose, start)) for start in starts)
        clear = [q for q in others if q is not None]
        return min(clear, key=lambda q: float(np.linalg.norm(q - end)), default=None)

    def turned(self, path: JointPath, turn: Turn) -> JointPath | None:
        """A path that ends turned and moves the hand alike; None if the hand cannot keep to it."""
        phases = np.linspace(0.0, 1.0, N_POSES)
        positions = path.spline(phases)
        share = minimum_jerk((phases - turn.since) / max(1.0 - turn.since, 1e-9))
        poses = self._arm.forward_kinematics(positions)
        wanted = positions + share[:, None] * turn.shift
        moved = np.array([self._onto(*pair) for pair in zip(poses, wanted, strict=True)])
        off_m = np.linalg.norm((self._arm.forward_kinematics(moved) - poses)[:, :3, 3], axis=1)
        jump_rad = np.abs(np.diff(moved, axis=0)).max()
        if off_m.max() > LARGEST_SHORTFALL_M or jump_rad > LARGEST_JUMP_RAD:
            return None
        return make_path(phases * path.duration_s, moved, self._limits)

    def _descend(self, bodies: Bodies, pose: Floats, q: Floats) -> Floats | None:
        """From a posture to a clear one with the hand at the same pose; None if none was found."""
        watched: set[int] = set()
        unit = np.eye(len(q))
        for _ in range(25):  # five radians of a joint
            touching = bodies.contacts(q[None])
            if not touching:
                return q
            watched |= {one.pair for one in touching}
            J = self._jacobian(q)
            own = unit - np.linalg.pinv(J) @ J
            gaps = [bodies.gap(q, pair) for pair in sorted(watched)]
            rows = [gradient @ own for _, gradient in gaps]
            needs = [bodies.clearance_m + BEYOND_M - gap for gap, _ in gaps]
            change = least_change(
                np.vstack([*rows, own, -own]), np.r_[needs, self._lower - q, q - self._upper]
            )
            if change is None:
                return None
            step = own @ change
            # null space and distances hold near the posture only
            step *= min(1.0, 0.2 / max(float(np.abs(step).max()), 1e-9))
            q = self._onto(pose, q + step)
        return None

    def _jacobian(self, q: Floats) -> Floats:
        return self._arm.jacobian(q)[: self._rows]

    def _onto(self, pose: Floats, q: Floats) -> Floats:
        """A posture near `q` that brings the hand back to a pose, by Newton's method."""
        for _ in range(4):  # two mostly suffice
            q = np.clip(q, self._lower, self._upper)
            there = self._arm.forward_kinematics(q)
            error = pose[:3, 3] - there[:3, 3]
            if self._rows == 6:
                turn = Rotation.from_matrix(pose[:3, :3] @ there[:3, :3].T)
                error = np.r_[error, turn.as_rotvec()]
            if np.linalg.norm(error) < 1e-5:
                break
            q = q + np.linalg.pinv(self._jacobian(q)) @ error
        return np.asarray(np.clip(q, self._lower, self._upper))
