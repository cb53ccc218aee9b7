# SPDX-License-Identifier: Apache-2.0
"""One kinesthetic demonstration beside the pole: the arm in gravity compensation, led by hand."""

from dataclasses import dataclass

import numpy as np

from experiments.pole.plan import Way
from experiments.pole.world import Pole
from experiments.teaching.lesson import SENSOR_NOISE
from experiments.teaching.virtual_hand import Grip, HandTarget, pull
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from sim_bridge.arm import STEPS_PER_SAMPLE, ArmState, SimulatedArm

_RATE_HZ = 200.0
"""Sampling rate of the demonstrator's path [Hz]."""


@dataclass(frozen=True)
class PoleLesson:
    """The robot's half of a demonstration, measured every 10 ms.

    Attributes:
        positions_rad, velocities_rad_s, torques_nm: what the sensors said (T, 7).
        true_positions_rad: where the joints really were (T, 7).
        clearance_m: distance from the pole (T,).
        strongest_pull_n: largest force of the demonstrator's hand.
    """

    positions_rad: Floats
    velocities_rad_s: Floats
    torques_nm: Floats
    true_positions_rad: Floats
    clearance_m: Floats
    strongest_pull_n: float


class _Hand:
    """The demonstrator's hand along a way."""

    def __init__(self, way: Way, start_s: float, arrival_s: float, length_s: float) -> None:
        stamps = np.arange(round(length_s * _RATE_HZ) + 1) / _RATE_HZ
        frames = frame_poses(way.timed(stamps, start_s, arrival_s))
        self._hand, self._turn = frames[:, 7, :3, 3], frames[:, 7, :3, :3]
        self._elbow = frames[:, 3, :3, 3]
        self._hand_velocity = np.gradient(self._hand, stamps, axis=0)
        self._elbow_velocity = np.gradient(self._elbow, stamps, axis=0)
        self._grip = Grip()
        self.strongest_pull_n = 0.0

    def lead(self, arm: SimulatedArm) -> None:
        """Pull for one step."""
        place = min(arm.time_s * _RATE_HZ, len(self._hand) - 1.001)
        low, share = int(place), place - int(place)

        def between(values: Floats) -> Floats:
            return values[low] + share * (values[low + 1] - values[low])

        target = HandTarget(
            between(self._hand),
            self._turn[low],
            between(self._hand_velocity),
            between(self._elbow),
            between(self._elbow_velocity),
        )
        self.strongest_pull_n = max(self.strongest_pull_n, pull(arm, target, self._grip))


def lead_around(
    rng: np.random.Generator, way: Way, start_s: float, arrival_s: float, n_samples: int
) -> PoleLesson:
    """Lead the arm along a way, from `start_s` to `arrival_s`, in a fresh world with the pole.

    Its sensors are recorded `n_samples` times, every 10 ms.
    """
    hand = _Hand(way, start_s, arrival_s, (n_samples - 1) * 0.01)
    states, distance = [], []
    with SimulatedArm(way.start) as arm:
        pole = Pole(arm)
        arm.set_gravity_compensation(True)
        arm.before_step.append(hand.lead)
        for k in range(n_samples):
            if k:
                arm.step(STEPS_PER_SAMPLE)
            states.append(arm.state())
            distance.append(pole.clearance(states[-1].q))
    true = ArmState.together(states)
    said = SENSOR_NOISE.measure(true, rng)
    return PoleLesson(*said[:3], true.q, np.array(distance), hand.strongest_pull_n)
