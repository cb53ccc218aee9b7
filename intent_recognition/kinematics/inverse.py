# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of the LWR 4+: closed form with a swivel angle, and damped least squares.

Joints 1-3 meet in the shoulder and 5-7 in the wrist (S-R-S), so that the hand's pose leaves one
free angle, the swivel of the elbow about the line from shoulder to wrist, and three signs
(Shimizu et al. 2008, "Analytical inverse kinematic computation for 7-DOF redundant manipulators
with joint limits"). With the DH parameters of `lwr.DH` the hand's rotation is
Rz(q1) Ry(-q2) Rz(q3) . Ry(q4) . Rz(q5) Ry(-q6) Rz(q7).
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.errors import KinematicsError, ShapeError, describe
from intent_recognition.kinematics.forward import forward_kinematics, jacobian, joint_vector
from intent_recognition.kinematics.limits import JointLimits, clamp_position, within_position_limits
from intent_recognition.kinematics.lwr import (
    FOREARM_M,
    HAND_OFFSET_M,
    LWR_LIMITS,
    SHOULDER_HEIGHT_M,
    UPPER_ARM_M,
)

_SHOULDER = np.array([0.0, 0.0, SHOULDER_HEIGHT_M])
_REACH_M = UPPER_ARM_M + FOREARM_M
_GRID = np.radians(np.arange(-180.0, 180.0, 5.0))


class Branch(NamedTuple):
    """Signs (+1 or -1) of q2, q4 and q6, which tell the eight solutions of one swivel apart."""

    shoulder: int
    elbow: int
    wrist: int


BRANCHES = tuple(Branch(s, e, w) for s in (1, -1) for e in (1, -1) for w in (1, -1))


def branch_of(q: np.ndarray) -> Branch:
    """Return the branch of one joint vector (7,) [rad]; a zero angle counts as positive."""
    q = joint_vector(q)
    return Branch(*(1 if angle >= 0.0 else -1 for angle in (q[1], q[3], q[5])))


def swivel_angle(q: np.ndarray) -> float:
    """Return the swivel [rad] of one joint vector (7,): zero where the elbow's plane is vertical.

    It is measured about the line from shoulder to wrist, from the posture with q3 = 0.
    """
    q = joint_vector(q)
    upper = _rotation_z(q[0]) @ _rotation_y(-q[1]) @ _rotation_z(q[2])
    wrist = upper @ _wrist_in_upper_arm(q[3])
    reference = _reference_rotation(wrist, q[3])
    turn = upper @ reference.T
    axis = wrist / np.linalg.norm(wrist)
    sine = axis @ np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    return float(np.arctan2(0.5 * sine, 0.5 * (np.trace(turn) - 1.0)))


def solve(pose: np.ndarray, swivel_rad: np.ndarray | float, branch: Branch) -> np.ndarray:
    """Return the closed-form solution, shape (..., 7) [rad], limits not considered.

    Args:
        pose: the hand's pose (4, 4) in the base frame.
        swivel_rad: swivel of the elbow (...) [rad].
        branch: which of the eight solutions.

    Raises:
        KinematicsError: the wrist is farther from the shoulder than the arm is long, or nearer
            than it can fold.
    """
    pose = _checked_pose(pose)
    wrist = pose[:3, 3] - HAND_OFFSET_M * pose[:3, 2] - _SHOULDER
    elbow_angle = branch.elbow * _elbow_angle(wrist)
    axis = wrist / np.linalg.norm(wrist)
    swivel = _rotation_about(axis, np.asarray(swivel_rad, dtype=np.float64))
    upper = swivel @ _reference_rotation(wrist, elbow_angle)
    lower = np.swapaxes(upper @ _rotation_y(elbow_angle), -1, -2) @ pose[:3, :3]
    q = np.empty((*swivel.shape[:-2], 7))
    q[..., 0], q[..., 1], q[..., 2] = _spherical_angles(upper, branch.shoulder)
    q[..., 3] = elbow_angle
    q[..., 4], q[..., 5], q[..., 6] = _spherical_angles(lower, branch.wrist)
    return q


def inverse_kinematics(
    pose: np.ndarray, seed: np.ndarray, limits: JointLimits = LWR_LIMITS
) -> np.ndarray:
    """Return the joint vector (7,) [rad] inside the limits that is nearest to the seed.

    All swivels and branches are searched, so that a path followed with each solution as the next
    seed stays on its branch and passes the shoulder's and wrist's singularities without a flip.
    Exactly in a singular posture, where two joints line up, they share their rotation arbitrarily.

    Args:
        pose: the hand's pose (4, 4) in the base frame.
        seed: joint vector (7,) [rad] to stay near to.
        limits: joint limits to respect.

    Raises:
        KinematicsError: out of reach, or no solution inside the joint limits.
    """
    seed = joint_vector(seed, "seed")
    best: tuple[float, np.ndarray] | None = None
    start = swivel_angle(seed)
    for branch in BRANCHES:
        found = _nearest_on_branch(pose, seed, start, branch, limits)
        if found is not None and (best is None or found[0] < best[0]):
            best = found
    if best is None:
        raise KinematicsError(
            describe(
                "pose",
                "a pose with a solution inside the joint limits",
                f"none at {np.asarray(pose)[:3, 3].round(3).tolist()} m",
                "Turn the hand or bring it nearer to the middle of the workspace.",
            )
        )
    return best[1]


def refine(
    pose: np.ndarray,
    seed: np.ndarray,
    *,
    damping: float = 1e-3,
    n_iterations: int = 50,
    limits: JointLimits = LWR_LIMITS,
    position_only: bool = False,
    tolerance_m: float = 1e-9,
) -> np.ndarray:
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
        KinematicsError: still off by more than 0.1 mm (or mrad) at the end; names the distance.
    """
    pose = _checked_pose(pose)
    q = clamp_position(joint_vector(seed, "seed"), limits)
    rows = slice(0, 3 if position_only else 6)
    for _ in range(n_iterations):
        error = _pose_error(pose, forward_kinematics(q))[rows]
        if np.linalg.norm(error) < tolerance_m:
            return q
        J = jacobian(q)[rows]
        # The damping fades with the error: safe far away, quadratic convergence near the pose.
        square = damping * min(1.0, float(np.linalg.norm(error))) + 1e-12
        step = J.T @ np.linalg.solve(J @ J.T + square * np.eye(len(error)), error)
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        q = clamp_position(q + step, limits)
    distance = float(np.linalg.norm(_pose_error(pose, forward_kinematics(q))[rows]))
    if distance > 1e-4:
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
    position_m: np.ndarray, seed: np.ndarray, limits: JointLimits = LWR_LIMITS
) -> np.ndarray:
    """Return joint angles (7,) [rad] near the seed with the hand at position_m (3,) [m].

    Raises:
        KinematicsError: out of reach; names the distance left.
    """
    pose = forward_kinematics(joint_vector(seed, "seed"))
    pose[:3, 3] = position_m
    return refine(pose, seed, n_iterations=200, limits=limits, position_only=True)


def _nearest_on_branch(
    pose: np.ndarray, seed: np.ndarray, start_rad: float, branch: Branch, limits: JointLimits
) -> tuple[float, np.ndarray] | None:
    """Return (squared distance, q) of the swivel nearest to the seed on a branch, None if none."""
    swivels = start_rad + _GRID
    spacing = _GRID[1] - _GRID[0]
    best = None
    for _ in range(6):
        candidates = solve(pose, swivels, branch)
        cost = np.sum((candidates - seed) ** 2, axis=-1)
        cost[~within_position_limits(candidates, limits)] = np.inf
        k = int(np.argmin(cost))
        if not np.isfinite(cost[k]):
            return best
        if best is None or cost[k] < best[0]:
            best = (float(cost[k]), candidates[k])
        spacing /= 8.0
        swivels = swivels[k] + spacing * np.arange(-8, 9)
    return best


def _elbow_angle(wrist: np.ndarray) -> float:
    distance = float(np.linalg.norm(wrist))
    cosine = (distance**2 - UPPER_ARM_M**2 - FOREARM_M**2) / (2.0 * UPPER_ARM_M * FOREARM_M)
    if not -1.0 <= cosine <= 1.0 + 1e-9:
        nearest = abs(UPPER_ARM_M - FOREARM_M)
        raise KinematicsError(
            describe(
                "pose",
                f"a wrist {nearest:.3f} to {_REACH_M:.3f} m from the shoulder",
                f"{distance:.4f} m, {max(distance - _REACH_M, nearest - distance):.4f} m too much",
                "Bring the hand back into the workspace.",
            )
        )
    return float(np.arccos(min(cosine, 1.0)))


def _wrist_in_upper_arm(elbow_angle: float) -> np.ndarray:
    """Return the vector from shoulder to wrist (3,) in the axes of the upper arm."""
    return np.array(
        [FOREARM_M * np.sin(elbow_angle), 0.0, UPPER_ARM_M + FOREARM_M * np.cos(elbow_angle)]
    )


def _reference_rotation(wrist: np.ndarray, elbow_angle: float) -> np.ndarray:
    """Return the upper arm's rotation with q3 = 0 that puts the wrist where it is."""
    in_arm = _wrist_in_upper_arm(elbow_angle)
    lateral = float(np.hypot(wrist[0], wrist[1]))
    azimuth = float(np.arctan2(wrist[1], wrist[0])) if lateral > 1e-9 else 0.0
    polar = np.arctan2(lateral, wrist[2])
    return _rotation_z(azimuth) @ _rotation_y(polar - np.arctan2(in_arm[0], in_arm[2]))


def _spherical_angles(rotation: np.ndarray, sign: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (a, b, c) with rotation = Rz(a) Ry(-b) Rz(c) and b of the given sign."""
    sine = np.hypot(rotation[..., 0, 2], rotation[..., 1, 2])
    b = sign * np.arctan2(sine, rotation[..., 2, 2])
    regular = sine > 1e-12
    a = np.where(regular, np.arctan2(-sign * rotation[..., 1, 2], -sign * rotation[..., 0, 2]), 0.0)
    aligned = np.arctan2(rotation[..., 1, 0], rotation[..., 1, 1])
    c = np.where(
        regular, np.arctan2(-sign * rotation[..., 2, 1], sign * rotation[..., 2, 0]), aligned
    )
    return a, b, c


def _pose_error(target: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return position error [m] and rotation vector [rad] from pose to target, base axes (6,)."""
    turn = target[:3, :3] @ pose[:3, :3].T
    sine = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    norm = float(np.linalg.norm(sine))
    angle = np.arctan2(norm, 0.5 * (np.trace(turn) - 1.0))
    rotation = sine * (angle / norm) if norm > 1e-12 else sine
    return np.concatenate([target[:3, 3] - pose[:3, 3], rotation])


def _checked_pose(pose: np.ndarray) -> np.ndarray:
    pose = np.asarray(pose, dtype=np.float64)
    if pose.shape != (4, 4):
        raise ShapeError(
            describe("pose", "shape (4, 4)", pose.shape, "Give one homogeneous transform.")
        )
    if not np.all(np.isfinite(pose)):
        raise KinematicsError(
            describe("pose", "finite values", pose, "Check the transform's source.")
        )
    return pose


def _rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _rotation_about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return rotations (..., 3, 3) about a unit axis (3,) by angles (...) (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K)
