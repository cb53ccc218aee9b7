# SPDX-License-Identifier: Apache-2.0
"""Kinesthetic teaching in physics: the arm in gravity compensation, led by a person's hand.

What is recorded are the measured joint states, with the arm's lag behind the hand, its sag and the
noise of its sensors; never the plan.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.teaching.objects import ObjectHolder, ToolboxObjects
from experiments.teaching.path import TeachingPath
from experiments.teaching.virtual_hand import LedWay
from intent_recognition.array_types import Floats
from sim_bridge.arm import STEPS_PER_SAMPLE, ArmState, SensorNoise, SimulatedArm
from sim_bridge.coworker import HOLD
from sim_bridge.scenarios.toolbox import HOME, STANDS_M

HOME_STD_RAD = 0.004
"""Scatter of the arm's posture at rest per joint [rad]."""
RELEASE_AFTER_S = 0.3
"""Time from the arrival until the object is let go [s]."""
SENSOR_NOISE = SensorNoise(position_std_rad=1e-4, velocity_std_rad_s=2e-3, torque_std_nm=0.05)
"""Noise of the arm's sensors when it is taught."""


@dataclass(frozen=True)
class TaughtArm:
    """The robot's half of a demonstration, measured every 10 ms.

    Attributes:
        times_s: since the recording began (T,).
        positions_rad: measured joint positions (T, 7).
        velocities_rad_s: measured joint velocities (T, 7).
        torques_nm: joint torques (T, 7).
        hand_m: where the hand really was (T, 3), world.
        strongest_pull_n: largest force of the demonstrator's hand.
        holders: who held the task's object at each sample.
        object_m: where the task's object was (T, 3), world.
    """

    times_s: Floats
    positions_rad: Floats
    velocities_rad_s: Floats
    torques_nm: Floats
    hand_m: Floats
    strongest_pull_n: float
    holders: tuple[ObjectHolder, ...]
    object_m: Floats


class _Lesson:
    """One demonstration in progress: the arm, the object and the leading hand."""

    def __init__(self, arm: SimulatedArm, path: TeachingPath, wrist_m: Floats) -> None:
        self.arm, self.path = arm, path
        self.objects = ToolboxObjects(arm)
        if path.task == HOLD:
            self.objects.worker_brings(HOLD)
        self._wrist_m = wrist_m
        self._home_error = arm.state().q - path.joints_rad[0]
        self._joints = CubicSpline(path.stamps_s, path.joints_rad)
        rate = len(path.stamps_s) - 1, path.stamps_s[-1]
        self.hands = LedWay(path.hand_m, path.rotations, path.elbow_m, rate)
        self._released = False
        arm.before_step.append(self._before_step)

    def _before_step(self, arm: SimulatedArm) -> None:
        now = arm.time_s
        times = self.path.times
        if arm.n_steps % STEPS_PER_SAMPLE == 0:
            self.objects.move_worker(self._wrist_m[arm.n_steps // STEPS_PER_SAMPLE])
            self._take_or_release(now)
        if now < times.taught_s:
            self._follow(now)
            return
        arm.set_gravity_compensation(True)
        self.hands.lead(arm)

    def _follow(self, now: float) -> None:
        """Let the controller run the hand-coded part."""
        q = self._joints(now) + self._home_error
        self.arm.set_reference(q, self._joints(now, 1), self._joints(now, 2))

    def _take_or_release(self, now: float) -> None:
        task, times = self.path.task, self.path.times
        if self.objects.holders[task] is not ObjectHolder.ROBOT and not self._released:
            if now >= times.grasp_s:
                self.objects.give_to_robot(task)
        elif task in STANDS_M and not self._released and now >= times.arrival_s + RELEASE_AFTER_S:
            self.objects.give_to_worker(task)
            self._released = True


def teach(rng: np.random.Generator, path: TeachingPath, wrist_m: Floats) -> TaughtArm:
    """Teach the arm one path in a fresh physics world and record what its sensors say.

    `wrist_m` is where the worker's wrist is every 10 ms from the start on (T, 3), world.
    """
    start = HOME + HOME_STD_RAD * rng.standard_normal(7)
    rows = []
    with SimulatedArm(start) as arm:
        lesson = _Lesson(arm, path, wrist_m)
        for k in range(len(wrist_m)):
            if k:
                arm.step(STEPS_PER_SAMPLE)
            state = arm.state()
            rows.append(
                (state, arm.hand_pose().position, lesson.objects.holders[path.task],
                 lesson.objects.position(path.task))
            )  # fmt: skip
    said = SENSOR_NOISE.measure(ArmState.together([row[0] for row in rows]), rng)
    return TaughtArm(
        np.arange(len(rows), dtype=np.float64) * 0.01,
        *said[:3],
        np.array([row[1] for row in rows]),
        lesson.hands.strongest_pull_n,
        tuple(row[2] for row in rows),
        np.array([row[3] for row in rows]),
    )
