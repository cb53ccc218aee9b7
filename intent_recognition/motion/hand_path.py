# SPDX-License-Identifier: Apache-2.0
"""From the predicted path of a hand to the joints of the arm that moves the hand."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics import Arm
from intent_recognition.signals import POSE_FIELDS, POSITION_FIELDS, homogeneous

N_POSES = 25
"""Poses of a predicted path for which joints are computed; a spline joins them. A hand path of half
a metre takes 5 to 10 ms, and the spline stays within 0.1 mm of it."""
LARGEST_SHORTFALL_M = 0.005
"""Largest distance of the hand from any predicted pose with which a path is executed [m]: a fifth
of the error permitted to the hand."""
LARGEST_JUMP_RAD = 0.8
"""Largest turn of a joint between two poses on one branch of the inverse kinematics [rad]. A hand
path of half a metre turns no joint by more than 0.1 rad."""


def is_hand(names: Sequence[str]) -> bool:
    """Whether these names are those of the position or the whole pose of a hand."""
    fields = POSE_FIELDS if len(names) > len(POSITION_FIELDS) else POSITION_FIELDS
    return len(names) == len(fields) and all(map(str.endswith, names, fields))


def hand_targets(numbers: ArrayLike) -> Floats:
    """Positions (..., 3) [m] unchanged, whole poses (..., 7) as transforms (..., 4, 4).

    Raises:
        TrajectoryError: a quaternion is zero; any other norm is accepted.
    """
    values = np.asarray(numbers, dtype=np.float64)
    if values.shape[-1] == len(POSITION_FIELDS):
        return values
    flat = values.reshape(-1, len(POSE_FIELDS))
    try:
        turns = Rotation.from_quat(flat[:, 3:]).as_matrix()
    except ValueError as error:
        cure = "Check the sender."
        raise TrajectoryError.about("prediction", "unit quaternions", str(error), cure) from error
    return homogeneous(turns, flat[:, :3]).reshape(*values.shape[:-1], 4, 4)


def joints_along(arm: Arm, times_s: Floats, hand: Floats, rest: Floats) -> tuple[Floats, Floats]:
    """Times and joint positions that take the hand along a predicted path in the base frame.

    `hand` holds positions (T, 3) [m], or positions and quaternions xyzw (T, 7), at increasing times
    (T,). The arm begins near the posture `rest` (n,), to which redundant joints are drawn.

    Returns:
        Times (T',) [s], at most `N_POSES` of the given ones including the first and the last, and
        joint positions (T', n) [rad] within the arm's limits.

    Raises:
        TrajectoryError: a part of the path is out of reach, or no continuous motion was found.
    """
    chosen = np.unique(np.linspace(0, len(times_s) - 1, N_POSES).round().astype(int))
    times_s, hand = times_s[chosen], hand[chosen]
    path = arm.follow(hand_targets(hand), rest, rest)
    # a few times what a hand can tell
    missed = (path.distance_m > LARGEST_SHORTFALL_M) | (path.angle_rad > 0.05)
    if missed.any():
        worst = int(np.argmax(path.distance_m + path.angle_rad))
        turned = f" and {path.angle_rad[worst]:.2f} rad" if path.angle_rad[worst] > 0.0 else ""
        expected = f"a path that {arm.tip} can reach"
        got = (
            f"{path.distance_m[worst]:.3f} m{turned} too far at {hand[worst, :3].round(3).tolist()}"
            f" m, {times_s[missed][0]:.2f} to {times_s[missed][-1]:.2f} s"
        )
        raise TrajectoryError.about("prediction", expected, got, "Move the base nearer.")
    if path.largest_jump_rad > LARGEST_JUMP_RAD:
        got = f"one in which a joint jumps by {path.largest_jump_rad:.2f} rad"
        cure = "Choose a home posture that leads along the path."
        raise TrajectoryError.about("prediction", "a continuous motion", got, cure)
    return times_s, path.positions
