# SPDX-License-Identifier: Apache-2.0
"""Iterative inverse kinematics of the LWR 4+ by damped least squares (Levenberg-Marquardt).

Buss 2004, "Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and damped
least squares methods", eq. 11.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intent_recognition.errors import KinematicsError, describe
from intent_recognition.kinematics.forward import forward_kinematics, jacobian, joint_vector
from intent_recognition.kinematics.inverse import checked_pose
from intent_recognition.kinematics.limits import JointLimits, clamp_position
from intent_recognition.kinematics.lwr import LWR_LIMITS

_LARGEST_STEP_RAD = 0.3
"""Largest change of a joint in one step [rad]. Convention: the Jacobian holds about so far."""
_LARGEST_ERROR = 1e-4
"""Largest norm of the remaining error (m, and rad for the orientation). Convention: a tenth of a
millimetre, and as many milliradians."""


def refine(
    pose: ArrayLike,
    seed: ArrayLike,
    *,
    damping: float = 1e-3,
    n_iterations: int = 50,
    limits: JointLimits = LWR_LIMITS,
    position_only: bool = False,
    tolerance_m: float = 1e-9,
) -> NDArray[np.float64]:
    """Return joint angles (7,) [rad] reaching the pose from the seed by damped least squares.

    Args:
        pose: the hand's pose (4, 4) in the base frame.
        seed: joint vector (7,) [rad] to start at.
        damping: added to the diagonal of J J^T (m^2 and rad^2).
        n_iterations: most steps to take.
        limits: joints are clamped into them after each step.
        position_only: leave the hand's orientation free.
        tolerance_m: error (m, and rad for the orientation) at which to stop.

    Raises:
        KinematicsError: still off by more than 0.1 mm (or 0.1 mrad) at the end; names the distance.
    """
    target = checked_pose(pose)
    q = clamp_position(joint_vector(seed, "seed"), limits)
    rows = slice(0, 3 if position_only else 6)
    for _ in range(n_iterations):
        error = _pose_error(target, forward_kinematics(q))[rows]
        if np.linalg.norm(error) < tolerance_m:
            return q
        J = jacobian(q)[rows]
        # The damping fades with the error: safe far away, quadratic convergence near the pose.
        square = damping * min(1.0, float(np.linalg.norm(error))) + 1e-12
        step = J.T @ np.linalg.solve(J @ J.T + square * np.eye(len(error)), error)
        step *= min(1.0, _LARGEST_STEP_RAD / max(float(np.abs(step).max()), 1e-12))
        q = clamp_position(q + step, limits)
    distance = float(np.linalg.norm(_pose_error(target, forward_kinematics(q))[rows]))
    if distance > _LARGEST_ERROR:
        raise KinematicsError(
            describe(
                "pose",
                "a pose within reach and joint limits",
                f"one still {distance:.4f} m away after {n_iterations} steps",
                "Start from a nearer seed or bring the pose nearer.",
            )
        )
    return q


def reach_position(
    position_m: ArrayLike, seed: ArrayLike, limits: JointLimits = LWR_LIMITS
) -> NDArray[np.float64]:
    """Return joint angles (7,) [rad] near the seed with the hand at position_m (3,) [m].

    Raises:
        KinematicsError: out of reach; names the distance left.
    """
    pose = forward_kinematics(joint_vector(seed, "seed"))
    pose[:3, 3] = position_m
    return refine(pose, seed, n_iterations=200, limits=limits, position_only=True)


def _pose_error(target: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return position error [m] and rotation vector [rad] from pose to target, base axes (6,)."""
    turn = target[:3, :3] @ pose[:3, :3].T
    sine = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    norm = float(np.linalg.norm(sine))
    angle = np.arctan2(norm, 0.5 * (np.trace(turn) - 1.0))
    rotation = sine * (angle / norm) if norm > 1e-12 else sine
    return np.concatenate([target[:3, 3] - pose[:3, 3], rotation])
