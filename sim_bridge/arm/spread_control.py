# SPDX-License-Identifier: Apache-2.0
"""Joint stiffness from the spread of the prediction that the arm executes.

This is the stochastic feedback controller of a ProMP (Paraschos et al. 2013) for predictions with
one standard deviation per joint: each joint is controlled separately, stiff where the prediction is
certain and compliant where it is not. The reference is still that of the commanded trajectory.
"""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics import JOINT_NAMES
from sim_bridge.arm.arm import SimulatedArm

DISTURBANCE = 0.3
"""Spectral density S of the disturbing accelerations per joint [rad^2/s^3]: after t seconds a free
joint's velocity has variance S t."""
BANDWIDTH_RAD_S = 20.0
"""Largest natural frequency of the closed loop [rad/s]."""
HOLD_S = 1.0
"""Time for which a prediction's last spread is held after its end [s], before low gains return."""


class SpreadControl:
    """Applies the controller of the latest prediction, and low gains if there is none."""

    def __init__(self, joint_names: Sequence[str] = JOINT_NAMES) -> None:
        self._names = tuple(joint_names)
        self._times_s = np.array([-np.inf])
        self._gains = np.zeros((1, 2, len(self._names)))

    def take(
        self, start_s: float, names: Sequence[str], times_s: Sequence[float], std: Sequence
    ) -> None:
        """Take a prediction's spread, which replaces the one before.

        `start_s` is on the arm's clock; `std` has one value per point and joint [rad].

        Raises:
            TrajectoryError: joints, sizes or values are wrong; the spread before stays.
        """
        if sorted(names) != sorted(self._names):
            _refuse("joint_names", f"{list(self._names)} in any order", list(names))
        sizes = {len(row) for row in std}
        if sizes != {len(names)} or len(times_s) != len(std):
            _refuse("effort", f"a standard deviation per joint in each of {len(times_s)}", sizes)
        times, values = np.array(times_s, dtype=float), np.array(std, dtype=float)
        if not (np.isfinite(times).all() and np.isfinite(values).all() and (values >= 0).all()):
            _refuse("effort, time_from_start", "finite, not negative", "another value")
        if np.any(np.diff(times) <= 0):
            _refuse("time_from_start", "increasing times", times.tolist())
        columns = [list(names).index(name) for name in self._names]
        self._gains = np.stack(resting_gains(values[:, columns]), axis=1)
        self._times_s = start_s + times

    def in_force(self, time_s: float) -> bool:
        """Whether a prediction determines the stiffness at a time."""
        return time_s <= self._times_s[-1] + HOLD_S

    def gains(self, time_s: float) -> tuple[Floats, Floats]:
        """Stiffness [1/s^2] and damping [1/s] at a time, each (n,); the ends are held."""
        times = self._times_s
        if time_s <= times[0] or len(times) == 1:
            return tuple(self._gains[0])
        high = min(int(np.searchsorted(times, time_s)), len(times) - 1)
        share = min((time_s - times[high - 1]) / (times[high] - times[high - 1]), 1.0)
        return tuple(self._gains[high - 1] + share * (self._gains[high] - self._gains[high - 1]))

    def control(self, arm: SimulatedArm) -> None:
        """Choose the controller of the next step."""
        if not self.in_force(arm.time_s):
            arm.acceleration_law = None
            return

        def law(time_s: float, q: Floats, qd: Floats) -> Floats:
            stiffness, damping = self.gains(time_s)
            wanted_q, wanted_qd, wanted_qdd = arm.reference
            return wanted_qdd + stiffness * (wanted_q - q) + damping * (wanted_qd - qd)

        arm.acceleration_law = law


def resting_gains(std: Floats) -> tuple[Floats, Floats]:
    """Stiffness [1/s^2] and damping [1/s] with which each joint stays within its spread.

    This is the controller for a slowly changing distribution with unknown correlations between
    joints: a critically damped oscillator of frequency (S / (4 std^2))^(1/3), at most
    `BANDWIDTH_RAD_S`. Both gains are positive for any spread, so the control is stable for any
    reference. The standard deviations (..., Q) [rad] are not negative.
    """
    variance = np.maximum(np.asarray(std) ** 2, DISTURBANCE / (4.0 * BANDWIDTH_RAD_S**3))
    frequency = np.cbrt(DISTURBANCE / (4.0 * variance))
    return frequency**2, 2.0 * frequency


def _refuse(argument: str, expected: str, got: object) -> None:
    cure = "Send the prediction with the estimator's standard deviations."
    raise TrajectoryError.about(argument, expected, got, cure)
