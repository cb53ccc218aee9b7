# SPDX-License-Identifier: Apache-2.0
"""The arm is taught to point: in gravity compensation, led by a person's hands, in physics."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from experiments.pointing.finger import PointingBodies
from experiments.pointing.scene import HOME, home_pose, pointed_at, pointing_pose, pointing_rotation
from experiments.teaching.lesson import HOME_STD_RAD, SENSOR_NOISE
from experiments.teaching.path import TEACHING_STD_M, TEACHING_STD_RAD
from experiments.teaching.virtual_hand import RATE_HZ, Grip, HandTarget, pull
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from intent_recognition.promp import minimum_jerk
from intent_recognition.signals import homogeneous
from sim_bridge.arm import STEPS_PER_SAMPLE, ArmState, SimulatedArm
from sim_bridge.coworker import bow_profile
from sim_bridge.scenarios.toolbox import arm_posture

GRIP = Grip()
"""How firmly the demonstrator holds the arm."""
_BOW_M, _BOW_STD_M = np.array([0.0, 0.0, 0.03]), 0.010
"""Bow of the hand's way in its middle, and standard deviation of that bow [m]."""


@dataclass(frozen=True)
class LedPath:
    """Where the demonstrator's hands are, at 200 Hz.

    Attributes:
        stamps_s: (T,) since the recording began.
        hand_m: of the arm's hand (T, 3), world.
        rotations: of the arm's hand (T, 3, 3).
        elbow_m: of the arm's elbow (T, 3).
    """

    stamps_s: Floats
    hand_m: Floats
    rotations: Floats
    elbow_m: Floats

    def target(self, time_s: float) -> HandTarget:
        """The hands at a time, with their velocities."""
        row = min(time_s * RATE_HZ, len(self.stamps_s) - 1.001)
        low, share = int(row), row - int(row)

        def at(values: Floats) -> tuple[Floats, Floats]:
            step = values[low + 1] - values[low]
            return values[low] + share * step, step * RATE_HZ

        hand, hand_velocity = at(self.hand_m)
        elbow, elbow_velocity = at(self.elbow_m)
        return HandTarget(hand, self.rotations[low], hand_velocity, elbow, elbow_velocity)


@dataclass(frozen=True)
class TaughtPointing:
    """Measurements of the arm, every 10 ms.

    Attributes:
        positions_rad, velocities_rad_s, torques_nm: (T, 7).
        pointed_m: where the finger truly pointed at the end (3,), world.
        strongest_pull_n: largest force of the demonstrator's hands.
        touched: the finger or the arm touched the table.
    """

    positions_rad: Floats
    velocities_rad_s: Floats
    torques_nm: Floats
    pointed_m: Floats
    strongest_pull_n: float
    touched: bool


def plan_path(
    rng: np.random.Generator, spot_m: Floats, start_s: float, arrival_s: float, length_s: float
) -> LedPath:
    """Draw the way on which the arm is led from home at `start_s` to a spot (3,) at `arrival_s`, in
    a recording of `length_s`.
    """
    error = np.append(TEACHING_STD_M * rng.standard_normal(2), 0.0)
    bow = _BOW_M + _BOW_STD_M * rng.standard_normal(3)
    skew = rng.uniform(1.0, 1.5)
    wrong = Rotation.from_rotvec(TEACHING_STD_RAD * rng.standard_normal(3)).as_matrix()
    goal = pointing_pose(spot_m + error, wrong @ pointing_rotation(spot_m))
    home = home_pose()
    stamps = np.arange(round(length_s * RATE_HZ) + 1) / RATE_HZ
    done = minimum_jerk((stamps - start_s) / (arrival_s - start_s))[:, None]
    hand = home[:3, 3] + done * (goal[:3, 3] - home[:3, 3]) + bow * bow_profile(done, skew)
    ends = Rotation.from_matrix(np.stack((home[:3, :3], goal[:3, :3])))
    rotations = Slerp([0.0, 1.0], ends)(done[:, 0]).as_matrix()
    postures = list(map(arm_posture, homogeneous(rotations, hand)))
    return LedPath(stamps, hand, rotations, frame_poses(np.array(postures))[:, 3, :3, 3])


def teach(rng: np.random.Generator, path: LedPath, n_samples: int) -> TaughtPointing:
    """Lead the arm along a path in a fresh world; record its sensors `n_samples` times."""
    strongest, touched, states = 0.0, False, []

    def lead(arm: SimulatedArm) -> None:
        nonlocal strongest
        strongest = max(strongest, pull(arm, path.target(arm.time_s), GRIP))

    with SimulatedArm(HOME + HOME_STD_RAD * rng.standard_normal(7)) as arm:
        bodies = PointingBodies(arm)
        arm.set_gravity_compensation(True)
        arm.before_step.append(lead)
        for k in range(n_samples):
            if k:
                arm.step(STEPS_PER_SAMPLE)
            states.append(arm.state())
            touched = touched or bodies.touches()
    said = SENSOR_NOISE.measure(ArmState.together(states), rng)
    return TaughtPointing(*said[:3], pointed_at(states[-1].q), strongest, touched)


def stand(rng: np.random.Generator, n_samples: int) -> TaughtPointing:
    """The arm standing at home, as its sensors report it; nobody leads it."""
    q = HOME + HOME_STD_RAD * rng.standard_normal(7)
    with SimulatedArm(q) as arm:
        PointingBodies(arm)
        arm.step(500)
        state = arm.state()
    said = SENSOR_NOISE.measure(ArmState.together([state] * n_samples), rng)
    return TaughtPointing(*said[:3], pointed_at(state.q), 0.0, False)
