# SPDX-License-Identifier: Apache-2.0
"""Where the demonstrator leads the arm: a human-like path to the handover, as pure functions.

Plate and screw begin with a hand-coded fetch (Ewerton et al. 2015, footnote 4): from home to the
stand, grasp, lift. It is the same in every demonstration but for the tempo.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from experiments.teaching.virtual_hand import RATE_HZ
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from intent_recognition.promp import minimum_jerk
from intent_recognition.signals import homogeneous
from sim_bridge.coworker import HOLD, PLATE, SCREW, bow_profile
from sim_bridge.scenarios.toolbox import (
    LIFT_M,
    STANDS_M,
    arm_posture,
    handover_point,
    handover_rotation,
    home_pose,
    stand_pose,
)

REACTION_SHARE = 0.12
"""Share of the human's movement that passes before the demonstrator begins."""
GRASP_SHARE = 0.34
"""Share of the robot's movement after which the object is grasped."""
LIFTED_SHARE = 0.53
"""Share after which it has been lifted."""
TEACHING_STD_M = 0.005
"""Scatter with which a person brings the hand to its place per axis [m]."""
TEACHING_STD_RAD = 0.03
"""Scatter with which a person turns the hand per axis [rad]."""
_BOW_M = {
    PLATE: np.array([-0.01, -0.01, 0.035]),
    SCREW: np.array([0.0, -0.02, 0.02]),
    HOLD: np.array([-0.02, -0.03, -0.02]),
}
_BOW_STD_M = 0.010
"""Standard deviation of the bow of a taught path along each axis [m]."""


@dataclass(frozen=True)
class TeachingTimes:
    """When the arm does what, in seconds since the recording began.

    Attributes:
        start_s: it leaves home.
        taught_s: the fetch is over and the demonstrator takes the arm by the hand.
        arrival_s: it arrives at the handover.
        grasp_s: it takes the object from its stand; for the screwdriver, from the worker.
    """

    start_s: float
    taught_s: float
    arrival_s: float
    grasp_s: float


@dataclass(frozen=True)
class TeachingPath:
    """Where the hand is led, sampled at 200 Hz over the whole recording.

    Attributes:
        task: label.
        times: phases of the movement.
        stamps_s: times of the samples (T,).
        hand_m: target positions of the hand (T, 3), world.
        rotations: target rotations of the hand (T, 3, 3), world.
        joints_rad: the posture a person would hold the arm in (T, 7).
        elbow_m: the elbow in that posture (T, 3).
        end_error_m: how far the demonstrator stops from the rule's point (3,).
    """

    task: str
    times: TeachingTimes
    stamps_s: Floats
    hand_m: Floats
    rotations: Floats
    joints_rad: Floats
    elbow_m: Floats
    end_error_m: Floats


def teaching_times(task: str, onset_s: float, arrival_s: float) -> TeachingTimes:
    """Phases of the arm's movement for a human onset and an arrival of the robot, in seconds."""
    total = arrival_s - onset_s
    start = onset_s + REACTION_SHARE * total
    if task not in STANDS_M:
        return TeachingTimes(start, start, arrival_s, arrival_s)
    return TeachingTimes(
        start, onset_s + LIFTED_SHARE * total, arrival_s, onset_s + GRASP_SHARE * total
    )


def plan_teaching(
    rng: np.random.Generator,
    task: str,
    goal_m: Floats,
    onset_s: float,
    arrival_s: float,
    length_s: float,
) -> TeachingPath:
    """Draw the path of one kinesthetic demonstration of `length_s`.

    The worker's movement begins at `onset_s` and its wrist stops at `goal_m` (3,), world; the
    robot's hand is to arrive at `arrival_s`.
    """
    times = teaching_times(task, onset_s, arrival_s)
    error = TEACHING_STD_M * rng.standard_normal(3)
    bow = _BOW_M[task] + _BOW_STD_M * rng.standard_normal(3)
    skew = rng.uniform(1.0, 1.5)
    wrong_turn = Rotation.from_rotvec(TEACHING_STD_RAD * rng.standard_normal(3))
    stamps = np.arange(round(length_s * RATE_HZ) + 1) / RATE_HZ
    home = home_pose()
    hand, carry_start = _fetch(task, times, stamps, home)
    carried = minimum_jerk((stamps - times.taught_s) / (arrival_s - times.taught_s))[:, None]
    goal = handover_point(task, goal_m) + error
    hand = hand + (goal - carry_start) * carried + bow * bow_profile(carried, skew)
    turns = Rotation.from_matrix(np.stack((home[:3, :3], handover_rotation(task))))
    turns = Rotation.concatenate((turns[0], wrong_turn * turns[1]))
    rotations = Slerp([0.0, 1.0], turns)(carried[:, 0]).as_matrix()
    joints = np.array(list(map(arm_posture, homogeneous(rotations, hand))))
    elbow = frame_poses(joints)[:, 3, :3, 3]
    return TeachingPath(task, times, stamps, hand, rotations, joints, elbow, error)


def _fetch(
    task: str, times: TeachingTimes, stamps_s: Floats, home: Floats
) -> tuple[Floats, Floats]:
    """Positions (T, 3) of the fetch, held at its end, and that end (3,)."""
    start = home[:3, 3]
    if task not in STANDS_M:
        return np.tile(start, (len(stamps_s), 1)), start
    stand = stand_pose(task)[:3, 3]
    approach = minimum_jerk((stamps_s - times.start_s) / (times.grasp_s - times.start_s))
    lift = minimum_jerk((stamps_s - times.grasp_s) / (times.taught_s - times.grasp_s))
    hand = start + np.outer(approach, stand - start) + np.outer(lift, LIFT_M)
    return hand, stand + LIFT_M
