# SPDX-License-Identifier: Apache-2.0
"""Closed-form inverse kinematics of the LWR 4+ over the swivel angle of its elbow.

Joints 1-3 meet in the shoulder and 5-7 in the wrist (S-R-S). The hand's pose leaves one free angle,
the swivel of the elbow about the line from shoulder to wrist, and three signs (Shimizu et al. 2008,
"Analytical inverse kinematic computation for 7-DOF redundant manipulators with joint limits and its
application to redundancy resolution"). With the DH parameters of `lwr` the hand's rotation is
Rz(q1) Ry(-q2) Rz(q3) . Ry(q4) . Rz(q5) Ry(-q6) Rz(q7). Solutions lie in (-pi, pi].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.errors import KinematicsError, ShapeError
from intent_recognition.kinematics.limits import JointLimits, within_position_limits
from intent_recognition.kinematics.lwr import (
    FOREARM_M,
    HAND_OFFSET_M,
    LWR_LIMITS,
    SHOULDER_HEIGHT_M,
    UPPER_ARM_M,
    forward_kinematics,
    jacobian,
    joint_vector,
)
from intent_recognition.kinematics.pose_search import REACHED, PoseSearch, checked_target

_SHOULDER = np.array([0.0, 0.0, SHOULDER_HEIGHT_M])
_REACH_M = UPPER_ARM_M + FOREARM_M
_MAX_STEP_RAD = 0.25
"""Largest joint motion between sampled swivels [rad], so small that a local minimum of the distance
to the seed spans several samples."""


class Branch(NamedTuple):
    """Signs (+1 or -1) of q2, q4 and q6, which distinguish the eight solutions of one swivel."""

    shoulder: int
    elbow: int
    wrist: int


def branch_of(q: ArrayLike) -> Branch:
    """Return the branch of one joint vector (7,) [rad]; a zero angle counts as positive."""
    q = joint_vector(q)
    return Branch(*(1 if angle >= 0.0 else -1 for angle in (q[1], q[3], q[5])))


def swivel_angle(q: ArrayLike) -> float:
    """Return the swivel [rad] of one joint vector (7,): zero where the elbow's plane is vertical.

    It is measured about the line from shoulder to wrist, from the posture with q3 = 0.
    """
    q = joint_vector(q)
    upper = Rotation.from_euler("ZYZ", [q[0], -q[1], q[2]]).as_matrix()
    wrist = upper @ _wrist_in_upper_arm(q[3])
    turn = Rotation.from_matrix(upper @ _reference_rotation(wrist, q[3]).T)
    return float(turn.as_rotvec() @ wrist / np.linalg.norm(wrist))


def solve(pose: ArrayLike, swivel_rad: ArrayLike, branch: Branch) -> Floats:
    """Return closed-form solutions, shape (..., 7) [rad], without regard to joint limits.

    `pose` is the hand's pose (4, 4) in the base frame, `swivel_rad` the swivels of the elbow (...).

    Raises:
        KinematicsError: the wrist is farther from the shoulder than the arm is long, or nearer
            than it can fold.
    """
    circle = _elbow_circle(checked_pose(pose), branch.elbow)
    swivel = np.asarray(swivel_rad, dtype=np.float64)
    return _postures(circle, swivel, branch.shoulder, branch.wrist)


def inverse_kinematics(
    pose: ArrayLike, seed: ArrayLike, limits: JointLimits = LWR_LIMITS
) -> Floats:
    """Return the joint vector (7,) nearest to the seed (7,) that reaches a pose within the limits.

    The pose (4, 4) is that of the hand in the base frame. The search covers all swivels of all
    branches. A path followed with each solution as the next seed therefore stays on its branch and
    passes singularities of shoulder and wrist without a flip. In an exactly singular posture, where
    two joints line up, the first of them is zero.

    Raises:
        KinematicsError: the pose is out of reach, or has no solution inside the joint limits.
    """
    target, posture = checked_pose(pose), joint_vector(seed, "seed")
    start, elbow = swivel_angle(posture), branch_of(posture).elbow
    best, nearest = np.inf, None
    for sign in (elbow, -elbow):
        circle = _elbow_circle(target, sign)
        if abs(circle.elbow_angle - posture[3]) >= best:
            continue  # no posture of this branch can be nearer
        distance, q = _nearest_on_circle(circle, posture, start, limits)
        if distance < best:
            best, nearest = distance, q
    if nearest is None:
        expected = "a pose with a solution inside the joint limits"
        got = f"none at {target[:3, 3].round(3).tolist()} m"
        cure = "Turn the hand or bring it nearer to the middle of the workspace."
        raise KinematicsError.about("pose", expected, got, cure)
    return nearest


def follow_poses(poses: Floats, seed: Floats) -> Floats:
    """Joint vectors (T, 7) [rad] for poses of the hand (T, 4, 4), each near the previous one.

    Raises:
        KinematicsError: a pose is out of reach.
    """
    joints = np.empty((len(poses), 7))
    for k, pose in enumerate(poses):
        seed = joints[k] = inverse_kinematics(pose, seed)
    return joints


_SEARCH = PoseSearch(
    lambda q: (forward_kinematics(q), jacobian(q)),
    LWR_LIMITS.lower,
    LWR_LIMITS.upper,
    np.zeros(7, bool),
)


def reach_position(position_m: ArrayLike, seed: ArrayLike) -> Floats:
    """Joint angles (7,) [rad] near the seed with the hand at position_m (3,) [m], freely oriented.

    Raises:
        KinematicsError: the position is out of reach; the message gives the remaining distance.
        ShapeError: `position_m` is not three finite numbers, or `seed` is no joint vector.
    """
    target = checked_target(position_m, "position_m")
    found = _SEARCH.descend(target, joint_vector(seed, "seed"))
    if found.distance_m > REACHED:
        expected = "a position within reach and joint limits"
        got = f"one still {found.distance_m:.4f} m away"
        cure = "Start from a nearer seed or bring the position nearer."
        raise KinematicsError.about("position_m", expected, got, cure)
    return found.q


class _ElbowCircle(NamedTuple):
    """All elbow positions of one hand pose and elbow angle.

    The upper arm's rotation in the base and the hand's rotation in the forearm are linear in
    (1, sin(swivel), cos(swivel)) (Shimizu et al. 2008, eqs. 13 and 16); each array (3, 3, 3) holds
    the matrices of these three terms.
    """

    elbow_angle: float
    shoulder: Floats
    wrist: Floats


def _elbow_circle(pose: Floats, elbow_sign: int) -> _ElbowCircle:
    wrist = pose[:3, 3] - HAND_OFFSET_M * pose[:3, 2] - _SHOULDER
    elbow_angle = elbow_sign * _elbow_angle(wrist)
    x, y, z = wrist / np.linalg.norm(wrist)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    terms = np.stack([np.eye(3) + K @ K, K, -K @ K])  # Rodrigues
    shoulder = terms @ _reference_rotation(wrist, elbow_angle)
    forearm = shoulder @ Rotation.from_euler("y", elbow_angle).as_matrix()
    return _ElbowCircle(elbow_angle, shoulder, np.swapaxes(forearm, -1, -2) @ pose[:3, :3])


def _postures(
    circle: _ElbowCircle,
    swivel: Floats,
    shoulder_sign: NDArray[np.int_] | int,
    wrist_sign: NDArray[np.int_] | int,
) -> Floats:
    """Return joint vectors (..., 7); swivel (...) and signs broadcast."""
    terms = np.stack([np.ones_like(swivel), np.sin(swivel), np.cos(swivel)], axis=-1)
    upper = np.tensordot(terms, circle.shoulder, axes=1)
    lower = np.tensordot(terms, circle.wrist, axes=1)
    q = np.empty((*np.broadcast(swivel, shoulder_sign, wrist_sign).shape, 7))
    q[..., 0], q[..., 1], q[..., 2] = _spherical_angles(upper, shoulder_sign)
    q[..., 3] = circle.elbow_angle
    q[..., 4], q[..., 5], q[..., 6] = _spherical_angles(lower, wrist_sign)
    return q


_SHOULDER_SIGNS = np.array([[1], [1], [-1], [-1]])
_WRIST_SIGNS = np.array([[1], [-1], [1], [-1]])


def _nearest_on_circle(
    circle: _ElbowCircle, seed: Floats, start: float, limits: JointLimits
) -> tuple[float, Floats | None]:
    """Return (distance, q) of the posture nearest to the seed; (inf, None) outside the limits."""

    def distances(
        swivels: Floats, shoulder: NDArray[np.int_], wrist: NDArray[np.int_]
    ) -> tuple[Floats, Floats]:
        q = _postures(circle, swivels, shoulder, wrist)
        distance = np.linalg.norm(q - seed, axis=-1)
        return np.where(within_position_limits(q, limits), distance, np.inf), q

    swivels = _sampled_swivels(circle, start, limits)
    distance, _ = distances(swivels, _SHOULDER_SIGNS, _WRIST_SIGNS)
    if not np.isfinite(distance.min()):
        return np.inf, None
    fence = np.pad(distance, ((0, 0), (1, 1)), constant_values=np.inf)
    minimum = (distance <= fence[:, :-2]) & (distance <= fence[:, 2:])
    # No posture between two samples is nearer by more than one step of all joints.
    minimum &= distance <= distance.min() + _MAX_STEP_RAD * np.sqrt(seed.size)
    branch, k = np.nonzero(minimum)
    shoulder, wrist = _SHOULDER_SIGNS[branch], _WRIST_SIGNS[branch]
    low, middle = swivels[np.maximum(k - 1, 0)], swivels[k]
    high = swivels[np.minimum(k + 1, swivels.size - 1)]
    rows, share = np.arange(k.size), np.linspace(0.0, 1.0, 9)
    for _ in range(8):  # 8^-8 of 0.35 rad: a quadratic minimum in double precision
        below = low[:, None] + share[:-1] * (middle - low)[:, None]
        above = middle[:, None] + share * (high - middle)[:, None]
        zoomed = np.hstack([below, above])
        distance, q = distances(zoomed, shoulder, wrist)
        k = np.argmin(distance, axis=1)
        low, middle = zoomed[rows, np.maximum(k - 1, 0)], zoomed[rows, k]
        high = zoomed[rows, np.minimum(k + 1, zoomed.shape[1] - 1)]
    row = int(np.argmin(distance[rows, k]))
    return float(distance[row, k[row]]), q[row, k[row]]


def _sampled_swivels(circle: _ElbowCircle, start: float, limits: JointLimits) -> Floats:
    """Return increasing swivels around the circle from start - pi to start + pi.

    Every swivel at which a joint may enter or leave its limits is among them, so that no feasible
    interval is missed, however short; between them joints move by at most `_MAX_STEP_RAD`.
    """
    grid = np.linspace(-np.pi, np.pi, 37)  # every 10 degrees
    crossings = (_limit_crossings(circle, limits) - start + np.pi) % (2.0 * np.pi) - np.pi
    edges = np.sort(np.concatenate([grid, crossings]))
    edges = edges[np.diff(edges, prepend=-np.inf) > 1e-12]  # not rounding
    # The middle of each section shows whether it is inside; rounding may spoil its ends.
    swivels = start + np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])]))
    while True:
        q = _postures(circle, swivels, 1, 1)  # the other branches turn by as much
        turn = np.abs((np.diff(q, axis=0) + np.pi) % (2.0 * np.pi) - np.pi).max(axis=1)
        # where joints turn half a revolution in a smaller section, the posture is singular
        split = (turn > _MAX_STEP_RAD) & (np.diff(swivels) > 1e-7)
        if not split.any():
            return swivels
        middles = 0.5 * (swivels[:-1] + swivels[1:])[split]
        swivels = np.sort(np.concatenate([swivels, middles]))


def _limit_crossings(circle: _ElbowCircle, limits: JointLimits) -> Floats:
    """Return all swivels at which a joint of shoulder or wrist is at a limit, in any branch.

    A limit L of the first, second or third joint of R = Rz(a) Ry(-b) Rz(c) is met where
    R02 sin(L) = R12 cos(L), R22 = cos(L) or R21 cos(L) = -R20 sin(L): each is linear in (1, sin,
    cos) of the swivel and has up to two roots. The most nearly singular swivels, where R22 is
    extreme, and those where an angle wraps from pi to -pi are included.
    """
    equations = []
    for R, first in ((circle.shoulder, 0), (circle.wrist, 4)):
        for bound in (limits.lower, limits.upper, np.full(7, np.pi)):
            a, b, c = bound[first : first + 3]
            equations.append(R[:, 0, 2] * np.sin(a) - R[:, 1, 2] * np.cos(a))
            equations.append(R[:, 2, 2] - np.array([np.cos(b), 0.0, 0.0]))
            equations.append(R[:, 2, 1] * np.cos(c) + R[:, 2, 0] * np.sin(c))
    constant, sine, cosine = np.array(equations).T
    amplitude = np.hypot(sine, cosine)
    peak = np.arctan2(sine, cosine)
    solvable = (amplitude > 0.0) & (np.abs(constant) <= amplitude)
    half = np.arccos(-constant[solvable] / amplitude[solvable])
    extremes = peak[[1, 10]]  # of R22 of shoulder and wrist
    roots = [peak[solvable] + half, peak[solvable] - half, extremes, extremes + np.pi]
    return np.concatenate(roots)


def _elbow_angle(wrist: Floats) -> float:
    distance = float(np.linalg.norm(wrist))
    cosine = (distance**2 - UPPER_ARM_M**2 - FOREARM_M**2) / (2.0 * UPPER_ARM_M * FOREARM_M)
    if not -1.0 <= cosine <= 1.0 + 1e-9:
        nearest = abs(UPPER_ARM_M - FOREARM_M)
        expected = f"a wrist {nearest:.3f} to {_REACH_M:.3f} m from the shoulder"
        got = f"{distance:.4f} m, {max(distance - _REACH_M, nearest - distance):.4f} m too much"
        cure = "Bring the hand back into the workspace."
        raise KinematicsError.about("pose", expected, got, cure)
    return float(np.arccos(min(cosine, 1.0)))


def _wrist_in_upper_arm(elbow_angle: float) -> Floats:
    """Return the vector from shoulder to wrist (3,) in the axes of the upper arm."""
    return np.array(
        [FOREARM_M * np.sin(elbow_angle), 0.0, UPPER_ARM_M + FOREARM_M * np.cos(elbow_angle)]
    )


def _reference_rotation(wrist: Floats, elbow_angle: float) -> Floats:
    """Return the upper arm's rotation with q3 = 0 that puts the wrist where it is."""
    in_arm = _wrist_in_upper_arm(elbow_angle)
    lateral = float(np.hypot(wrist[0], wrist[1]))
    azimuth = float(np.arctan2(wrist[1], wrist[0])) if lateral > 1e-9 else 0.0
    polar = np.arctan2(lateral, wrist[2])
    angles = [azimuth, polar - np.arctan2(in_arm[0], in_arm[2])]
    return Rotation.from_euler("ZY", angles).as_matrix()


def _spherical_angles(
    rotation: Floats, sign: NDArray[np.int_] | int
) -> tuple[Floats, Floats, Floats]:
    """Return (a, b, c) with rotation = Rz(a) Ry(-b) Rz(c), exact also near b = 0."""
    x, y = rotation[..., 0, 2], rotation[..., 1, 2]
    sine = np.hypot(x, y)
    b = np.asarray(sign, dtype=np.float64) * np.arctan2(sine, rotation[..., 2, 2])
    a = np.where(sine > 1e-12, np.arctan2(-sign * y, -sign * x), 0.0)
    cos, sin = np.cos(a), np.sin(a)
    c = np.arctan2(
        cos * rotation[..., 1, 0] - sin * rotation[..., 0, 0],
        cos * rotation[..., 1, 1] - sin * rotation[..., 0, 1],
    )
    return a, b, c


def checked_pose(pose: ArrayLike) -> Floats:
    """Return a finite pose (4, 4) as float64, or raise ShapeError or KinematicsError."""
    matrix = np.asarray(pose, dtype=np.float64)
    if matrix.shape != (4, 4):
        cure = "Give one homogeneous transform."
        raise ShapeError.about("pose", "shape (4, 4)", matrix.shape, cure)
    if not np.all(np.isfinite(matrix)):
        cure = "Check the transform's source."
        raise KinematicsError.about("pose", "finite values", matrix, cure)
    return matrix
