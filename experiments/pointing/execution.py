# SPDX-License-Identifier: Apache-2.0
"""A predicted movement of the arm, done on the torque-controlled arm with its finger."""

from dataclasses import dataclass

import numpy as np

from experiments.pointing.finger import PointingBodies
from experiments.pointing.scene import HOME, pointed_at
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JOINT_NAMES
from sim_bridge.arm import STEPS_PER_SAMPLE, SimulatedArm, TrajectoryCommand, TrajectoryFollower

REST_S = 1.0
"""How long the arm is watched after the movement [s]: it comes to rest."""


@dataclass(frozen=True)
class PointingRun:
    """What the arm did.

    Attributes:
        times_s: every 10 ms (T,).
        positions_rad: true joint positions (T, 7).
        pointed_m: where the finger pointed at the end (3,), on the table's plane, world.
        largest_lag_rad: largest difference of a joint from its reference.
        touched: the finger or the arm touched the table.
    """

    times_s: Floats
    positions_rad: Floats
    pointed_m: Floats
    largest_lag_rad: float
    touched: bool


def execute(
    times_s: Floats, positions: Floats, velocities: Floats, start: Floats = HOME
) -> PointingRun:
    """Follow a trajectory with the low-gain controller, come to rest, and see where it points.

    Args:
        times_s: (T,) from the start, increasing, the first zero.
        positions: (T, 7) [rad].
        velocities: (T, 7) [rad/s]; the last row is taken for zero.
        start: posture of the arm before (7,) [rad].
    """
    velocities = np.array(velocities, dtype=np.float64)
    velocities[-1] = 0.0
    command = TrajectoryCommand.validated(JOINT_NAMES, times_s, positions, velocities)
    n_samples = round((float(times_s[-1]) + REST_S) * 100.0)
    rows, lag, touched = [], 0.0, False
    with SimulatedArm(start) as arm:
        bodies = PointingBodies(arm)
        follower = TrajectoryFollower(arm.reference.position, arm.limits)
        follower.accept(command, 0.0)
        arm.before_step.append(lambda _: arm.set_reference(*follower.sample(arm.time_s)))
        for _ in range(n_samples):
            arm.step(STEPS_PER_SAMPLE)
            q = arm.state().q
            rows.append(q)
            lag = max(lag, float(np.abs(arm.reference.position - q).max()))
            touched = touched or bodies.touches()
    times = 0.01 * np.arange(1, n_samples + 1, dtype=np.float64)
    return PointingRun(times, np.array(rows), pointed_at(rows[-1]), lag, touched)
