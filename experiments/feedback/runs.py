# SPDX-License-Identifier: Apache-2.0
"""Executions of one movement on the arm under disturbance, by either controller."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.feedback.controller import FeedbackPolicy
from intent_recognition.array_types import Floats
from intent_recognition.motion import JointReference
from sim_bridge.arm import STEPS_PER_SAMPLE, TIME_STEP_S, SimulatedArm

NOISE_STEPS = 5
"""Physics steps for which one draw of the disturbance lasts; far shorter than the arm's motion."""


@dataclass(frozen=True)
class Push:
    """A force at the hand, constant in the world.

    Attributes:
        start_s: since the movement began.
        length_s: how long it lasts.
        force_n: (3,) [N].
    """

    start_s: float
    length_s: float
    force_n: tuple[float, float, float]


@dataclass(frozen=True)
class FeedbackRun:
    """What the arm did, every 10 ms from the start on.

    Attributes:
        times_s: (T,).
        positions_rad: true joint positions (T, 7).
        hand_m: the hand (T, 3), world.
        saturated_steps: physics steps in which a torque reached its limit.
    """

    times_s: Floats
    positions_rad: Floats
    hand_m: Floats
    saturated_steps: int


def mean_movement(policy: FeedbackPolicy) -> Callable[[float], JointReference]:
    """The distribution's mean as a reference over time, held at rest after its end."""
    n = policy.n_joints
    spline = CubicSpline(policy.times_s, policy.mean[:, :n])
    slope, bend = spline.derivative(), spline.derivative(2)
    end = JointReference.at_rest(policy.mean[-1, :n])

    def reference(time_s: float) -> JointReference:
        if time_s >= policy.times_s[-1]:
            return end
        return JointReference(spline(time_s), slope(time_s), bend(time_s))

    return reference


def execute(
    policy: FeedbackPolicy,
    start: Floats,
    length_s: float,
    *,
    low_gain: bool = False,
    rng: np.random.Generator | None = None,
    push: Push | None = None,
) -> FeedbackRun:
    """Execute a movement once in a fresh world.

    Args:
        policy: the stochastic feedback controller, and the mean for the other one.
        start: joint positions and velocities at the start (14,).
        length_s: how long.
        low_gain: follow the policy's mean with the arm's own controller (inverse dynamics, low
            constant stiffness) instead.
        rng: of the disturbance; without one there is none.
        push: a push on top of it.
    """
    n = policy.n_joints
    mean = mean_movement(policy)
    kick = np.zeros(n)
    scale = np.sqrt(policy.disturbance / (NOISE_STEPS * TIME_STEP_S))

    def before_step(arm: SimulatedArm) -> None:
        now = arm.time_s
        if rng is not None and arm.n_steps % NOISE_STEPS == 0:
            kick[:] = scale * rng.standard_normal(n)
        if low_gain:
            q, qd, qdd = mean(now)
            arm.set_reference(q, qd, qdd + kick)
        if push is not None and push.start_s <= now < push.start_s + push.length_s:
            arm.apply_force(np.array(push.force_n))

    with SimulatedArm(start[:n]) as arm:
        for index, q, qd in zip(arm.joint_indices, start[:n], start[n:], strict=True):
            arm.client.resetJointState(arm.body, index, float(q), float(qd))
        if not low_gain:
            arm.acceleration_law = lambda t, q, qd: policy.acceleration(t, q, qd) + kick
        arm.before_step.append(before_step)
        positions, hands = [start[:n]], [arm.hand_pose().position]
        for _ in range(round(length_s / TIME_STEP_S) // STEPS_PER_SAMPLE):
            arm.step(STEPS_PER_SAMPLE)
            positions.append(arm.state().q)
            hands.append(arm.hand_pose().position)
        saturated = arm.saturated_steps
    times = np.arange(len(positions), dtype=np.float64) * STEPS_PER_SAMPLE * TIME_STEP_S
    return FeedbackRun(times, np.array(positions), np.array(hands), saturated)
