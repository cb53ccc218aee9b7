# SPDX-License-Identifier: Apache-2.0
"""One kinesthetic demonstration beside the pole: the arm in gravity compensation, led by hand."""

from dataclasses import dataclass

import numpy as np

from experiments.pole.plan import Way
from experiments.pole.world import Pole
from experiments.teaching.lesson import SENSOR_NOISE
from experiments.teaching.virtual_hand import RATE_HZ, LedWay
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from sim_bridge.arm import STEPS_PER_SAMPLE, ArmState, SimulatedArm


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


def lead_around(
    rng: np.random.Generator, way: Way, start_s: float, arrival_s: float, n_samples: int
) -> PoleLesson:
    """Lead the arm along a way, from `start_s` to `arrival_s`, in a fresh world with the pole.

    Its sensors are recorded `n_samples` times, every 10 ms.
    """
    stamps = np.arange(round((n_samples - 1) * 0.01 * RATE_HZ) + 1) / RATE_HZ
    frames = frame_poses(way.timed(stamps, start_s, arrival_s))
    hand = LedWay(frames[:, 7, :3, 3], frames[:, 7, :3, :3], frames[:, 3, :3, 3])
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
