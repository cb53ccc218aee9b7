# SPDX-License-Identifier: Apache-2.0
"""From the predicted path of a hand to the joints of the arm that shall move it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import TrajectoryError, describe
from intent_recognition.kinematics import Arm

N_POSES = 25
"""Poses of a predicted path that are solved; a spline joins them. Convention: on hand paths of half
a metre it stays within 0.1 mm of them, and takes 5 to 10 ms."""
LARGEST_SHORTFALL_M = 0.005
"""A path that ends so short of a prediction is still executed [m]. Convention: a fifth of what the
hand may be off."""
LARGEST_JUMP_RAD = 0.8
"""A joint that turns further from one of the poses to the next has changed its branch [rad].
Convention: a hand path of half a metre turns none by more than a tenth of a radian."""
HAND_FIELDS = tuple(f"pose.position.{axis}" for axis in "xyz")


def is_hand(names: Sequence[str]) -> bool:
    """Whether controlled DOFs of these names are the position of a hand."""
    return len(names) == 3 and all(map(str.endswith, names, HAND_FIELDS))


def joints_along(
    arm: Arm,
    times_s: NDArray[np.float64],
    positions_m: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and joint positions that take the hand along a predicted path.

    Args:
        arm: its inverse kinematics; positions are in the frame of its base.
        times_s: of the prediction (T,), increasing.
        positions_m: of the hand (T, 3).
        rest: posture the arm begins near, and that redundant joints are drawn to (n,) [rad].

    Returns:
        Times (T',) [s], at most `N_POSES` of those given with the first and the last among them,
        and joint positions (T', n) [rad], within the arm's limits.

    Raises:
        TrajectoryError: a part of the path is out of reach, or no continuous motion was found; says
            where.
    """
    chosen = np.unique(np.linspace(0, len(times_s) - 1, N_POSES).round().astype(int))
    times_s, positions_m = times_s[chosen], positions_m[chosen]
    path = arm.follow(positions_m, rest, rest)
    missed = path.distance_m > LARGEST_SHORTFALL_M
    if missed.any():
        worst = int(np.argmax(path.distance_m))
        expected = f"a path that {arm.tip} can reach"
        got = (
            f"{path.distance_m[worst]:.3f} m too far at {positions_m[worst].round(3).tolist()} m,"
            f" {times_s[missed][0]:.2f} to {times_s[missed][-1]:.2f} s"
        )
        raise TrajectoryError(describe("prediction", expected, got, "Move the base nearer."))
    if path.largest_jump_rad > LARGEST_JUMP_RAD:
        got = f"one in which a joint jumps by {path.largest_jump_rad:.2f} rad"
        cure = "Choose a home posture that leads along the path."
        raise TrajectoryError(describe("prediction", "a continuous motion", got, cure))
    return times_s, path.positions
