# SPDX-License-Identifier: Apache-2.0
"""Iterative inverse kinematics of the LWR 4+'s hand position by damped least squares.

Buss 2004, "Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and damped
least squares methods", eq. 11.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics.forward import hand_position, jacobian, joint_vector
from intent_recognition.kinematics.lwr import LWR_LIMITS

_DAMPING_M2 = 1e-3
"""Added to the diagonal of J J^T [m^2]. Convention."""
_N_STEPS = 200
"""Most steps taken. Convention: a few do near the goal."""
_TOLERANCE_M = 1e-9
"""Distance at which to stop [m]. Convention."""
_LARGEST_STEP_RAD = 0.3
"""Largest change of a joint in one step [rad]. Convention: the Jacobian holds about so far."""
_LARGEST_ERROR_M = 1e-4
"""Largest distance left [m]. Convention: a tenth of a millimetre."""


def reach_position(position_m: ArrayLike, seed: ArrayLike) -> NDArray[np.float64]:
    """Return joint angles (7,) [rad] near the seed with the hand at position_m (3,) [m].

    Joints are clamped into the limits after each step; the hand's orientation is free.

    Raises:
        KinematicsError: not finite, or out of reach; names the distance left.
    """
    target = np.array(position_m, dtype=np.float64)
    if not np.all(np.isfinite(target)):
        cure = "Check the input for NaN."
        raise KinematicsError.about("position_m", "finite numbers", target, cure)
    lower, upper = LWR_LIMITS.lower, LWR_LIMITS.upper
    q = np.clip(joint_vector(seed, "seed"), lower, upper)
    for _ in range(_N_STEPS):
        error = target - hand_position(q)
        if np.linalg.norm(error) < _TOLERANCE_M:
            return q
        J = jacobian(q)[:3]
        # The damping fades with the error: safe far away, quadratic convergence near the goal.
        square = _DAMPING_M2 * min(1.0, float(np.linalg.norm(error))) + 1e-12
        step = J.T @ np.linalg.solve(J @ J.T + square * np.eye(3), error)
        step *= min(1.0, _LARGEST_STEP_RAD / max(float(np.abs(step).max()), 1e-12))
        q = np.clip(q + step, lower, upper)
    distance = float(np.linalg.norm(target - hand_position(q)))
    if distance > _LARGEST_ERROR_M:
        raise KinematicsError.about(
            "position_m",
            "a position within reach and joint limits",
            f"one still {distance:.4f} m away after {_N_STEPS} steps",
            "Start from a nearer seed or bring the position nearer.",
        )
    return q
