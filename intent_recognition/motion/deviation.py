# SPDX-License-Identifier: Apache-2.0
"""Does somebody push the arm? Tracking errors beyond what its controller explains, and for long.

The error e of an undisturbed joint follows from what is asked of it, e = b0 + b1 v + b2 a + r with
the velocity v and the acceleration a of its reference: what sags, lags behind and is hard to
accelerate. A person pushes where |r| of a joint stays beyond its bound for `sustained_s` without
a break.

The bound is chosen on undisturbed executions. The level of an execution is the largest number of
standard deviations of r that some joint kept up for so long. Undisturbed executions are
exchangeable, so that the next one reaches the j-th largest of m levels with a probability of at
most j / (m + 1), whatever the distribution (conformal prediction; Vovk, Gammerman & Shafer 2005):
that is the rate of false alarms, per execution.
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
"""A deviation is taken for a push if it lasts so long [s]. Measurement: a blow of 60 N for 0.2 s
moves the simulated LWR for a shorter time (docs/correcting.md)."""
LEAST_DEVIATION_RAD = 0.01
"""Smaller deviations are never taken as one [rad]. Measurement: 4 N at the hand of the
simulated LWR (docs/correcting.md)."""


class TrackedMotion(NamedTuple):
    """An execution, sampled evenly, each (T, n)."""

    step_s: float  # time between two samples [s]
    error: Floats  # measured positions less those of the reference [rad]
    velocity: Floats  # of the reference [rad/s]
    acceleration: Floats  # of the reference [rad/s^2]

    def explaining(self, joint: int) -> Floats:
        """One, velocity and acceleration of a joint's reference, (T, 3)."""
        velocity, acceleration = self.velocity[:, joint], self.acceleration[:, joint]
        return np.stack([np.ones_like(velocity), velocity, acceleration], axis=1)


@dataclass(frozen=True, eq=False)
class DeviationDetector:
    """What the controller explains of the n joints' errors, and what it does not."""

    coefficients: Floats  # b0, b1, b2, (3, n) [rad, s, s^2]
    explained: Floats  # residuals that undisturbed executions keep up, (n,) [rad]
    sustained_s: float  # how long a deviation must last [s]
    false_alarm_rate: float  # at most so many undisturbed executions of one are taken for pushed
    least_rad: float = LEAST_DEVIATION_RAD  # no smaller deviation counts [rad]

    @property
    def bound(self) -> Floats:
        """Residuals beyond which somebody pushes, (n,) [rad]."""
        return np.maximum(self.explained, self.least_rad)

    def residual(self, position: Floats, reference: JointReference) -> Floats:
        """What the controller does not explain of an error, (n,) [rad]."""
        b0, b1, b2 = self.coefficients
        expected = b0 + b1 * reference.velocity + b2 * reference.acceleration
        return position - reference.position - expected

    def deviates(self, position: Floats, reference: JointReference) -> bool:
        """Whether a joint is beyond its bound now."""
        return bool(np.any(np.abs(self.residual(position, reference)) > self.bound))


def calibrate_detector(
    executions: Sequence[TrackedMotion],
    false_alarm_rate: float,
    *,
    sustained_s: float = SUSTAINED_S,
    least_rad: float = LEAST_DEVIATION_RAD,
) -> DeviationDetector:
    """A detector that takes at most this share of undisturbed executions for pushed.

    Every second execution, in any order, gives the model of the errors, the others the bound: m of
    them allow a rate of 1 / (m + 1) at least. A deviation must last `sustained_s`; none below
    `least_rad` counts.

    Raises:
        ArgumentError: too few executions for this rate.
    """
    fitted, held_out = executions[::2], executions[1::2]
    rank = int(false_alarm_rate * (len(held_out) + 1) + 1e-9)  # of 1 / (m + 1), 1
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
    """Largest number of standard deviations beyond which some joint stays for so long."""
    explained = np.stack([motion.explaining(j) @ c for j, c in enumerate(coefficients.T)], axis=1)
    worst = np.max(np.abs(motion.error - explained) / std, axis=1)
    n = min(max(round(sustained_s / motion.step_s), 0) + 1, len(worst))
    return float(sliding_window_view(worst, n).min(axis=1).max())
