# SPDX-License-Identifier: Apache-2.0
"""A demonstrator's hands on the arm: springs and dampers at the end effector and at the elbow.

The grip is three points of the hand, each drawn toward where it should be, so that the demonstrator
holds position and orientation; a second, weak hand steadies the elbow, since a seven-joint arm in
gravity compensation would otherwise drift in its redundancy.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses, jacobian
from sim_bridge.arm import SimulatedArm

RATE_HZ = 200.0
"""Sampling rate of a demonstrator's path [Hz]."""
_GRIP_POINTS_M = np.array([[0.0, 0.0, 0.10], [0.14, 0.0, -0.05], [-0.07, 0.12, -0.05]])
"""Points of the hand that are held, in the hand frame (3, 3) [m]."""


@dataclass(frozen=True)
class Grip:
    """How firmly the arm is held.

    Attributes:
        stiffness_n_m: of each of the three points at the hand.
        damping_n_s_m: of the same points.
        elbow_stiffness_n_m: of the hand at the elbow.
        elbow_damping_n_s_m: of the same.
        max_force_n: strongest pull at one point.
    """

    stiffness_n_m: float = 1000.0
    damping_n_s_m: float = 24.0
    elbow_stiffness_n_m: float = 600.0
    elbow_damping_n_s_m: float = 25.0
    max_force_n: float = 60.0


@dataclass(frozen=True)
class HandTarget:
    """Where the demonstrator's hands are.

    Attributes:
        position_m: of the arm's hand (3,), world.
        rotation: of the arm's hand (3, 3), world.
        velocity_m_s: of the arm's hand (3,).
        elbow_m: of the arm's elbow (3,).
        elbow_velocity_m_s: of the arm's elbow (3,).
    """

    position_m: Floats
    rotation: Floats
    velocity_m_s: Floats
    elbow_m: Floats
    elbow_velocity_m_s: Floats


def pull(arm: SimulatedArm, target: HandTarget, grip: Grip) -> float:
    """Pull the arm toward a target for the next physics step; return the strongest pull [N].

    The arm's base must stand at the origin of the world, and its state must be noise-free.
    """
    measured = arm.state()
    q, qd = measured.q, measured.qd
    frames = frame_poses(q)
    hand = frames[7]
    twist = jacobian(q) @ qd
    strongest = 0.0
    for point in _GRIP_POINTS_M:
        lever = hand[:3, :3] @ point
        velocity = twist[:3] + np.cross(twist[3:], lever)
        error = target.position_m + target.rotation @ point - hand[:3, 3] - lever
        force = grip.stiffness_n_m * error + grip.damping_n_s_m * (target.velocity_m_s - velocity)
        strongest = max(strongest, _push(arm, force, grip, arm.hand_link, point))
    elbow_link = arm.joint_indices[3]
    origin = np.array(arm.client.getLinkState(arm.body, elbow_link)[4])
    axes = frames[:3, :3, 2]
    elbow_velocity = np.cross(axes, frames[3, :3, 3] - frames[:3, :3, 3]).T @ qd[:3]
    force = grip.elbow_stiffness_n_m * (target.elbow_m - origin)
    force = force - grip.elbow_damping_n_s_m * (elbow_velocity - target.elbow_velocity_m_s)
    return max(strongest, _push(arm, force, grip, elbow_link, np.zeros(3)))


class LedWay:
    """The hands of a person who leads the arm along a way, sampled at `RATE_HZ`.

    Args:
        hand_m: of the arm's hand (T, 3), world.
        rotations: of the arm's hand (T, 3, 3), world.
        elbow_m: of the arm's elbow (T, 3), world.
        rate: samples, and the seconds they take: shipped recordings depend on its last bit.

    Attributes:
        strongest_pull_n: largest pull so far.
    """

    def __init__(
        self,
        hand_m: Floats,
        rotations: Floats,
        elbow_m: Floats,
        rate: tuple[float, float] = (RATE_HZ, 1.0),
    ) -> None:
        self._rotations, self._places, self._rate = rotations, (hand_m, elbow_m), rate
        stamps = np.arange(len(hand_m)) / RATE_HZ
        self._velocities = [np.gradient(places, stamps, axis=0) for places in self._places]
        self.strongest_pull_n = 0.0

    def lead(self, arm: SimulatedArm) -> None:
        """Pull for the next physics step."""
        row = min(arm.time_s * self._rate[0] / self._rate[1], len(self._rotations) - 1.001)
        low, share = int(row), row - int(row)
        (hand, elbow), (hand_velocity, elbow_velocity) = (
            [one[low] + share * (one[low + 1] - one[low]) for one in pair]
            for pair in (self._places, self._velocities)
        )
        target = HandTarget(hand, self._rotations[low], hand_velocity, elbow, elbow_velocity)
        self.strongest_pull_n = max(self.strongest_pull_n, pull(arm, target, Grip()))


def _push(arm: SimulatedArm, force: Floats, grip: Grip, link: int, point: Floats) -> float:
    """Apply a force, no stronger than the grip allows, for one step; return its size."""
    size = float(np.linalg.norm(force))
    if size > grip.max_force_n:
        force = force * (grip.max_force_n / size)
    arm.apply_force(force, point_m=tuple(point), link=link)
    return min(size, grip.max_force_n)
