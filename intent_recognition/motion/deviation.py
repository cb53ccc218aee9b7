# SPDX-License-Identifier: Apache-2.0
"""Detects pushes: tracking errors that exceed what the controller explains for long enough.

The error e of an undisturbed joint is modelled as e = b0 + b1 v + b2 a + r, where v and a are the
velocity and acceleration of its reference; b0 is sag, b1 lag and b2 inertia. A person pushes the
arm if |r| of some joint is beyond its bound throughout `sustained_s`.

The bound is calibrated on undisturbed executions. The level of an execution is the largest number
of standard deviations beyond which |r| of some joint was throughout `sustained_s`. Undisturbed
executions are exchangeable, so the next one reaches the j-th largest of m levels with a probability
of at most j / (m + 1), whatever the distribution (conformal prediction; Vovk, Gammerman & Shafer
2005): this is the rate of false alarms per execution.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.motion.plan import JointReference

SUSTAINED_S = 0.8
"""Shortest deviation that counts as a push [s]. Measurement: a blow of 60 N for 0.2 s
moves the simulated LWR for a shorter time (docs/correcting.md)."""
LEAST_DEVIATION_RAD = 0.01
"""Smallest deviation that counts as a push [rad]. Measurement: 4 N at the hand of the
simulated LWR (docs/correcting.md)."""


class TrackedMotion(NamedTuple):
    """An execution, sampled evenly, each (T, n)."""

    step_s: float  # time between two samples [s]
    error: Floats  # measured positions less those of the reference [rad]
    velocity: Floats  # of the reference [rad/s]
    acceleration: Floats  # of the reference [rad/s^2]

    def explaining(self, joint: int) -> Floats:
        """Regressors of a joint's error (T, 3): one, velocity and acceleration of its reference."""
        velocity, acceleration = self.velocity[:, joint], self.acceleration[:, joint]
        return np.stack([np.ones_like(velocity), velocity, acceleration], axis=1)


@dataclass(frozen=True, eq=False)
class DeviationDetector:
    """Model of the n joints' undisturbed errors, and bounds on their residuals."""

    coefficients: Floats  # b0, b1, b2, (3, n) [rad, s, s^2]
    explained: Floats  # residuals that undisturbed executions sustain, (n,) [rad]
    sustained_s: float  # how long a deviation must last [s]
    false_alarm_rate: float  # largest share of undisturbed executions that count as pushed
    least_rad: float = LEAST_DEVIATION_RAD  # smallest deviation that counts [rad]

    @property
    def bound(self) -> Floats:
        """Residuals beyond which a joint counts as pushed, (n,) [rad]."""
        return np.maximum(self.explained, self.least_rad)

    def residual(self, position: Floats, reference: JointReference) -> Floats:
        """The part of the tracking errors that the model does not explain, (n,) [rad]."""
        b0, b1, b2 = self.coefficients
        expected = b0 + b1 * reference.velocity + b2 * reference.acceleration
        return position - reference.position - expected

    def deviates(self, position: Floats, reference: JointReference) -> bool:
        """Whether the residual of a joint is beyond its bound."""
        return bool(np.any(np.abs(self.residual(position, reference)) > self.bound))


def calibrate_detector(
    executions: Sequence[TrackedMotion],
    false_alarm_rate: float,
    *,
    sustained_s: float = SUSTAINED_S,
    least_rad: float = LEAST_DEVIATION_RAD,
) -> DeviationDetector:
    """Calibrate a detector for a largest share of undisturbed executions that count as pushed.

    Every second execution, in any order, fits the model of the errors. The m others calibrate the
    bound, and permit rates of 1 / (m + 1) or more. A deviation counts if it lasts `sustained_s` and
    exceeds `least_rad`.

    Raises:
        ArgumentError: too few executions for this rate.
    """
    fitted, held_out = executions[::2], executions[1::2]
    rank = int(false_alarm_rate * (len(held_out) + 1) + 1e-9)  # 1 for a rate of 1 / (m + 1)
    if rank < 1 or not fitted:
        needed = 2 * int(np.ceil(1.0 / max(false_alarm_rate, 1e-9)) - 1)
        expected = f"{needed} or more for a rate of {false_alarm_rate:g}"
        cure = "Record more of them, or allow more false alarms."
        raise ArgumentError.about("executions", expected, len(executions), cure)
    n_joints = fitted[0].error.shape[1]
    coefficients, std = np.zeros((3, n_joints)), np.zeros(n_joints)
    for joint in range(n_joints):
        error = np.concatenate([one.error[:, joint] for one in fitted])
        explains = np.concatenate([one.explaining(joint) for one in fitted])
        coefficients[:, joint] = np.linalg.lstsq(explains, error, rcond=None)[0]
        std[joint] = np.sqrt(np.mean((error - explains @ coefficients[:, joint]) ** 2))
    std = np.maximum(std, np.finfo(np.float64).eps)
    levels = sorted(_level(one, coefficients, std, sustained_s) for one in held_out)
    return DeviationDetector(
        coefficients, levels[-rank] * std, sustained_s, rank / (len(held_out) + 1), least_rad
    )


def _level(motion: TrackedMotion, coefficients: Floats, std: Floats, sustained_s: float) -> float:
    """Largest number of standard deviations beyond which some joint is throughout `sustained_s`."""
    explained = np.stack([motion.explaining(j) @ c for j, c in enumerate(coefficients.T)], axis=1)
    worst = np.max(np.abs(motion.error - explained) / std, axis=1)
    n = min(max(round(sustained_s / motion.step_s), 0) + 1, len(worst))
    return float(sliding_window_view(worst, n).min(axis=1).max())
