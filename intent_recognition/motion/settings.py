# SPDX-License-Identifier: Apache-2.0
"""How plans are made: sample spacing, shares of the limits."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics import JointLimits

POSITION_MARGIN_RAD = 0.01
"""Paths keep this far away from position limits [rad]. Convention: no cubic strays farther
between its samples (`plan_step`)."""


@dataclass(frozen=True)
class PlanSettings:
    """How plans are made.

    Attributes:
        step_s: time between samples of a plan [s]; longer motions get longer steps, see
            `plan_step`. Convention: a cubic strays from a path of 8 rad/s^2 by 0.4 mrad at most.
        offset_share: share of the acceleration limit an offset may use. Convention: the path
            keeps more than half.
        offset_velocity_share: share of the velocity limit an offset may use. Likewise.
        shortest_offset_s: an offset takes at least this long to decay [s]. Convention: several
            updates of a running plan.
        join_within_rad: the path waits until every joint of the offset is below this [rad].
            Convention: about 10 cm at the hand.
        max_rate_ratio: largest multiple of the predicted speed when catching up. Convention.
        target_samples: the step grows so that the nominal duration has about so many samples.
            Convention: a message of 200 points.
    """

    step_s: float = 0.02
    offset_share: float = 0.4
    offset_velocity_share: float = 0.35
    shortest_offset_s: float = 0.25
    join_within_rad: float = 0.15
    max_rate_ratio: float = 6.0
    target_samples: int = 200


def scaled_limits(
    limits: JointLimits, velocity_scale: float = 0.9, acceleration_scale: float = 1.0
) -> JointLimits:
    """The limits plans are held to: a share of the arm's own."""
    return replace(
        limits,
        velocity=limits.velocity * velocity_scale,
        acceleration=limits.acceleration * acceleration_scale,
    )


def plan_step(duration_s: float, limits: JointLimits, settings: PlanSettings) -> float:
    """Time between the samples of a plan [s].

    Longer for longer motions, but a cubic with the largest acceleration a strays from the line
    between its samples by a h^2 / 8, which is to be less than `POSITION_MARGIN_RAD`.
    """
    longest_s = float(np.sqrt(8.0 * POSITION_MARGIN_RAD / limits.acceleration.max()))
    return max(settings.step_s, min(duration_s / settings.target_samples, longest_s))


def sample_times(duration_s: float, step_s: float) -> NDArray[np.float64]:
    """Evenly spaced times from 0 to a duration, (T,) [s], at most step_s apart."""
    n = max(int(np.ceil(duration_s / step_s - 1e-9)), 1)
    return np.linspace(0.0, duration_s, n + 1)


DEFAULT_SETTINGS = PlanSettings()
