# SPDX-License-Identifier: Apache-2.0
"""What plans have in common: sample spacing, limits, the margin to them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics import JointLimits

POSITION_MARGIN_RAD = 0.01
"""Paths keep this far away from position limits [rad]. Convention: no cubic strays farther
between its samples (`plan_step`)."""


STEP_S = 0.02
"""Time between the samples of a plan [s]; longer motions get longer steps (`plan_step`).
Convention: a cubic strays from a path of 8 rad/s^2 by 0.4 mrad at most."""
N_SAMPLES = 200
"""The step grows so that the nominal duration has about so many samples. Convention: a message of
200 points."""


def scaled_limits(
    limits: JointLimits, velocity_scale: float = 0.9, acceleration_scale: float = 1.0
) -> JointLimits:
    """The limits plans are held to: a share of the arm's own."""
    return replace(
        limits,
        velocity=limits.velocity * velocity_scale,
        acceleration=limits.acceleration * acceleration_scale,
    )


def plan_step(duration_s: float, limits: JointLimits) -> float:
    """Time between the samples of a plan [s].

    Longer for longer motions, but a cubic with the largest acceleration a strays from the line
    between its samples by a h^2 / 8, which is to be less than `POSITION_MARGIN_RAD`.
    """
    longest_s = float(np.sqrt(8.0 * POSITION_MARGIN_RAD / limits.acceleration.max()))
    return max(STEP_S, min(duration_s / N_SAMPLES, longest_s))


def sample_times(duration_s: float, step_s: float) -> NDArray[np.float64]:
    """Evenly spaced times from 0 to a duration, (T,) [s], at most step_s apart."""
    n = max(int(np.ceil(duration_s / step_s - 1e-9)), 1)
    return np.linspace(0.0, duration_s, n + 1)
