# SPDX-License-Identifier: Apache-2.0
"""Estimates the force at the hand from joint torques and the arm's model.

Torques that the model does not explain are external (De Luca and Mattone 2005, "Sensorless robot
collision detection and hybrid force/motion control", ICRA). This implementation differentiates the
measured velocity instead of using the momentum: the same first-order filter of the same residual,
without the Coriolis matrix. A difference gives the acceleration halfway between two measurements,
so torque and posture are evaluated there, too.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ShapeError
from intent_recognition.kinematics import Arm

BANDWIDTH_RAD_S = 45.0
"""Bandwidth of the residual's filter [rad/s]. It reaches 63 % after 22 ms, to notice a slip within
50 ms (docs/transfer.md) with as little noise of differenced velocities as possible."""
CLOCK_BACK_S = 0.1
"""A state earlier than the last one by this time means that the clock was set back [s]; nodes use
the same limit (`runtime.CLOCK_BACK_NS`)."""


class LoadEstimator:
    """Filters the wrench at the hand of an arm whose base is aligned with the world's axes."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._last: tuple[float, Floats, Floats] | None = None
        self._residual = np.zeros(arm.n_joints)
        self.wrench = np.zeros(6)
        self.speed_m_s = self.rise_m_s2 = self.doubt_n = 0.0

    def update(self, time_s: float, q: Floats, velocity: Floats, torque: Floats) -> Floats:
        """Update with a joint state; return the force on the hand (3,) [N] in axes of the base.

        It also updates `wrench` (6,) [N, Nm] with the moment about the tip; `speed_m_s`, the tip's
        speed; and, through the same filter, `rise_m_s2`, the tip's upward acceleration, and
        `doubt_n`, the possible error of the vertical force if torques stepped at an unknown time
        between two measurements (after a gap: their whole change).

        A measurement (n,) [rad], [rad/s] no later than the last is ignored. `torque` (n,) [Nm] is
        that of the motors, which includes the arm's weight. After a gap of more than 0.1 s the
        filter restarts with zero acceleration.

        Raises:
            ShapeError: an argument does not fit the arm.
        """
        if np.shape(torque) != (self.arm.n_joints,):
            shape = f"({self.arm.n_joints},)"
            raise ShapeError.about("torque", shape, np.shape(torque), "Give one value per joint.")
        if self._last is not None and self._last[0] - CLOCK_BACK_S < time_s <= self._last[0]:
            return self.wrench[:3]
        J = self.arm.jacobian(q)
        state, tip_m_s = np.array([q, velocity, torque]), J[:3] @ velocity
        share, halfway, acceleration = 1.0, state, np.zeros(len(q))
        rise_m_s2, step = 0.0, None
        if self._last is not None and 0.0 < (gap_s := time_s - self._last[0]) <= 0.1:
            _, before, before_m_s = self._last
            share = 1.0 - np.exp(-BANDWIDTH_RAD_S * gap_s)
            halfway, acceleration = 0.5 * (before + state), (velocity - before[1]) / gap_s
            rise_m_s2 = float(tip_m_s[2] - before_m_s[2]) / gap_s
            step = 0.5 * (torque - before[2])
        at, moving, held = halfway
        residual = self.arm.inverse_dynamics(at, moving, acceleration) - held
        step_n = wrench_from_torques(J, residual - self._residual if step is None else step)[2]
        doubt_n = max(abs(float(step_n)) - 0.5, 0.0)  # noise of 0.1 Nm gives less in 90 % of steps
        self._residual = self._residual + share * (residual - self._residual)
        self.rise_m_s2 += share * (rise_m_s2 - self.rise_m_s2)
        self.doubt_n += share * (doubt_n - self.doubt_n)
        self._last = time_s, state, tip_m_s
        self.wrench = wrench_from_torques(J, self._residual)
        self.speed_m_s = float(np.linalg.norm(tip_m_s))
        return self.wrench[:3]


def wrench_from_torques(J: Floats, torque: Floats) -> Floats:
    """Most probable wrench w (6,) for the joint torques J^T w (n,).

    A Gaussian prior of w and noise of the torques keep it bounded at singular postures.
    """
    prior = np.repeat([20.0**2, 1.0**2], 3)  # [N], [Nm]: twice the values in a transfer
    PJ = prior[:, None] * J
    S = J.T @ PJ + 0.2**2 * np.eye(J.shape[1])  # noise in [Nm]
    return PJ @ np.linalg.solve(S, torque)
