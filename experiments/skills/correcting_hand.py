# SPDX-License-Identifier: Apache-2.0
"""A person who takes the arm by the hand while it executes, leads it to a place and lets go."""

import numpy as np

from experiments.teaching.virtual_hand import Grip, HandTarget, pull
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from intent_recognition.promp import minimum_jerk
from sim_bridge.arm import SimulatedArm

GRIP = Grip(
    stiffness_n_m=400.0, damping_n_s_m=12.0, elbow_stiffness_n_m=0.0, elbow_damping_n_s_m=0.0
)
"""How firmly a person who corrects holds the hand; nobody holds the elbow."""
LEADING_S = 1.2
"""How long the way to the place takes [s]."""
THERE_M, THERE_S = 0.004, 0.4
"""Distance from the place [m] and time there [s] after which the hand lets go."""
LONGEST_S = 6.0
"""Time after which the hand lets go in any case [s]."""


class CorrectingHand:
    """Takes the hand at a time, leads it on a straight line, keeping how it is turned, and lets go.

    Call it before every physics step; the arm's base must stand at the origin of the world.

    Args:
        arm: that is corrected.
        place_m: where its hand ought to be (3,), world.

    Attributes:
        done: it has let go.
        strongest_n: strongest pull at one point of the grip so far [N].
    """

    def __init__(self, arm: SimulatedArm, place_m: Floats) -> None:
        pose = frame_poses(arm.state().q)[7]
        self._from_s, self._start_m, self._rotation = arm.time_s, pose[:3, 3], pose[:3, :3]
        self._place_m = place_m
        self._there_since_s: float | None = None
        self.done = False
        self.strongest_n = 0.0

    def __call__(self, arm: SimulatedArm) -> None:
        """Pull for the next physics step, or let go."""
        if self.done:
            return
        since_s = arm.time_s - self._from_s
        anchors = [
            self._start_m
            + minimum_jerk(np.array((since_s + ahead) / LEADING_S))
            * (self._place_m - self._start_m)
            for ahead in (0.0, 1e-3)
        ]
        target = HandTarget(
            anchors[0], self._rotation, (anchors[1] - anchors[0]) / 1e-3, np.zeros(3), np.zeros(3)
        )
        self.strongest_n = max(self.strongest_n, pull(arm, target, GRIP))
        near = np.linalg.norm(arm.hand_pose().position - self._place_m) < THERE_M
        if not near:
            self._there_since_s = None
        elif self._there_since_s is None:
            self._there_since_s = arm.time_s
        there_s = 0.0 if self._there_since_s is None else arm.time_s - self._there_since_s
        self.done = there_s >= THERE_S or since_s >= LONGEST_S
