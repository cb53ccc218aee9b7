# SPDX-License-Identifier: Apache-2.0
"""One shown demonstration: the wrist reaches its goal while the arm goes to its own.

Minimum jerk (Flash and Hogan 1985) for both; the arm sets out a little later and arrives a little
later, as a helper does.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import JointPlan, JointReference, decay, sample_times
from intent_recognition.promp import minimum_jerk

REACTION_SHARE = 0.15
"""The arm sets out after this share of the wrist's movement. Convention."""
PEAK_SPEED, PEAK_ACCELERATION = 15.0 / 8.0, 10.0 / np.sqrt(3.0)
"""Of a minimum-jerk motion from 0 to 1 in unit time (Flash and Hogan 1985)."""


@dataclass(frozen=True)
class SyntheticDemonstration:
    """A demonstration to be shown, in seconds since it begins.

    Attributes:
        start_m, goal_m: of the wrist (3,).
        bow_m: how far the path bows out in its middle (3,).
        duration_s: of the wrist's movement.
        rest_s: both rest before it, as the onset is found from rest, and after the arm has arrived.
    """

    start_m: Floats
    goal_m: Floats
    bow_m: Floats
    duration_s: float
    rest_s: float = 0.9

    @property
    def arm_start_s(self) -> float:
        """When the arm sets out."""
        return self.rest_s + REACTION_SHARE * self.duration_s

    @property
    def arm_duration_s(self) -> float:
        """How long the arm moves."""
        return (1.0 - REACTION_SHARE) * self.duration_s + 0.3

    @property
    def length_s(self) -> float:
        """From the first rest to the end of the last."""
        return self.arm_start_s + self.arm_duration_s + self.rest_s

    def wrist(self, time_s: float) -> Floats:
        """Where the wrist is (3,) [m]."""
        share = minimum_jerk((time_s - self.rest_s) / self.duration_s)
        straight = self.start_m + share * (self.goal_m - self.start_m)
        return straight + 4.0 * share * (1.0 - share) * self.bow_m


def sample_demonstration(
    rng: np.random.Generator, start_m: Floats, goal_m: Floats, duration_s: float, variation_m: float
) -> tuple[SyntheticDemonstration, Floats]:
    """A demonstration toward about this goal, and the shift (3,) [m] the arm's goal makes with it.

    Args:
        rng: source of the variation.
        start_m: where the wrist rests (3,).
        goal_m: where it goes (3,).
        duration_s: usual duration; it varies by a tenth.
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
    """To a posture (d,) at rest in so much time [s], or in as much as the limits ask for."""
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
