# SPDX-License-Identifier: Apache-2.0
"""A demonstration shown by the page: the wrist reaches its goal while the arm moves to its own.

Both follow minimum-jerk motions (Flash and Hogan 1985); the arm starts and arrives slightly later,
as a helper does.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import JointPlan, JointReference, decay, sample_times
from intent_recognition.promp import minimum_jerk

REACTION_SHARE = 0.15
"""Delay of the arm's start, as a fraction of the wrist's duration."""
PEAK_SPEED, PEAK_ACCELERATION = 15.0 / 8.0, 10.0 / np.sqrt(3.0)
"""Peaks of a minimum-jerk motion from 0 to 1 in unit time (Flash and Hogan 1985)."""


@dataclass(frozen=True)
class SyntheticDemonstration:
    """A demonstration to be shown; times are seconds since its start.

    Attributes:
        start_m, goal_m: start and goal of the wrist (3,).
        bow_m: offset of the path's middle from the straight line (3,).
        duration_s: duration of the wrist's movement.
        rest_s: rest of both before the movement, which onset detection needs, and after it.
    """

    start_m: Floats
    goal_m: Floats
    bow_m: Floats
    duration_s: float
    rest_s: float = 0.9

    @property
    def arm_start_s(self) -> float:
        """Time at which the arm starts to move."""
        return self.rest_s + REACTION_SHARE * self.duration_s

    @property
    def arm_duration_s(self) -> float:
        """Duration of the arm's movement."""
        return (1.0 - REACTION_SHARE) * self.duration_s + 0.3

    @property
    def length_s(self) -> float:
        """Duration from the start of the first rest to the end of the last."""
        return self.arm_start_s + self.arm_duration_s + self.rest_s

    def wrist(self, time_s: float) -> Floats:
        """Position of the wrist (3,) [m] at a time."""
        share = minimum_jerk((time_s - self.rest_s) / self.duration_s)
        straight = self.start_m + share * (self.goal_m - self.start_m)
        return straight + 4.0 * share * (1.0 - share) * self.bow_m


def sample_demonstration(
    rng: np.random.Generator, start_m: Floats, goal_m: Floats, duration_s: float, variation_m: float
) -> tuple[SyntheticDemonstration, Floats]:
    """Sample a demonstration and the shift (3,) [m] of its goal, which also applies to the arm's.

    Args:
        rng: source of the variation.
        start_m: start of the wrist (3,).
        goal_m: mean goal of the wrist (3,).
        duration_s: mean duration; its standard deviation is a tenth.
        variation_m: standard deviation of the goal along each axis.
    """
    shift = variation_m * rng.standard_normal(3)
    way = goal_m + shift - start_m
    bow = 0.08 * np.linalg.norm(way) * rng.standard_normal(3)
    along = way / max(float(np.linalg.norm(way)), 1e-9)
    bow -= along * (bow @ along)
    duration = duration_s * float(np.clip(1.0 + 0.1 * rng.standard_normal(), 0.7, 1.3))
    return SyntheticDemonstration(start_m, goal_m + shift, bow, duration), shift


def shortest_s(way_rad: Floats, limits: JointLimits) -> float:
    """Shortest duration [s] of a motion from rest to rest by way_rad (d,) within the limits."""
    way = np.abs(way_rad)
    by_speed = PEAK_SPEED * way / limits.velocity
    by_acceleration = np.sqrt(PEAK_ACCELERATION * way / limits.acceleration)
    return float(np.maximum(by_speed, by_acceleration).max())


def arm_motion(
    start: JointReference, goal_rad: Floats, duration_s: float, limits: JointLimits
) -> JointPlan:
    """Motion to rest at a posture (d,) in `duration_s`, or longer if the limits require it."""
    offset = decay(
        start.position - goal_rad,
        start.velocity,
        start.acceleration,
        max_velocity=limits.velocity,
        max_acceleration=limits.acceleration,
        shortest_s=max(duration_s, shortest_s(start.position - goal_rad, limits)),
    )
    times = sample_times(offset.duration_s, 0.05)
    positions, velocities = offset.sample(times)
    still = np.zeros_like(times)
    return JointPlan(times, goal_rad + positions, velocities, still, still, "home")
