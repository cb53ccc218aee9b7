# SPDX-License-Identifier: Apache-2.0
"""One pour with the torque-controlled arm: along a planned path, or led by a person's hand."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.teaching.virtual_hand import Grip, HandTarget, pull
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import frame_poses
from sim_bridge.arm import STEPS_PER_SAMPLE, TIME_STEP_S, ArmState, SimulatedArm
from sim_bridge.containers import Container
from sim_bridge.scenarios.pouring import (
    OPENING_M,
    PouringTable,
    PourPath,
    SideGrasp,
    plan_joints,
    seen_path,
)

LAST_WAIT_S = 0.8
"""How long balls are watched after the movement [s]."""
STEADY_GRIP = Grip(stiffness_n_m=2500.0, damping_n_s_m=60.0)
"""A firm grip: a full cup is not shaken."""


@dataclass(frozen=True)
class Poured:
    """What a pour did, measured every 10 ms.

    Attributes:
        times_s: since its start (T,).
        joints_rad: measured joint angles (T, 7).
        velocities_rad_s: measured joint velocities (T, 7).
        torques_nm: joint torques (T, 7).
        path: of the lip as the cup truly moved.
        in_cup: balls in the cup over time (T,).
        in_second: balls in the second container over time (T,).
        n_balls: balls in the cup at the start.
        through_wall: how many balls went into or through a wall.
        strongest_pull_n: of the demonstrator's hand; 0 where nobody led.
        saturated_steps: how often a torque was at its limit.
        touched_s: how long the cup touched the second container.
        strongest_touch_n: largest force of that touch.
    """

    times_s: Floats
    joints_rad: Floats
    velocities_rad_s: Floats
    torques_nm: Floats
    path: PourPath
    in_cup: Floats
    in_second: Floats
    n_balls: int
    through_wall: int
    strongest_pull_n: float
    saturated_steps: int
    touched_s: float
    strongest_touch_n: float

    @property
    def caught(self) -> int:
        """Balls in the second container at the end."""
        return int(self.in_second[-1])

    @property
    def kept(self) -> int:
        """Balls still in the cup at the end."""
        return int(self.in_cup[-1])

    @property
    def spilled(self) -> int:
        """Balls in neither at the end."""
        return self.n_balls - self.caught - self.kept


class AssumedGeometry(NamedTuple):
    """What is known of the containers' shapes, each in its own frame [m].

    Attributes:
        lip_m: of the cup (3,).
        opening_m: centre of the second one's opening (3,).
    """

    lip_m: Floats
    opening_m: Floats


def pour(
    path: PourPath,
    cup: Container,
    second: Container,
    *,
    ball_radius_m: float,
    n_balls: int,
    rng: np.random.Generator,
    led: bool = False,
    belief: AssumedGeometry | None = None,
) -> Poured:
    """Let the arm pour in a fresh physics world.

    Args:
        path: of the lip, from rest to rest.
        cup: the container in the hand.
        second: the container on the stand, its opening at `OPENING_M`.
        ball_radius_m: of every ball.
        n_balls: in the cup.
        rng: of how the balls lie.
        led: kinesthetic teaching: the arm is in gravity compensation and a person's hand leads it.
        belief: where the robot takes lip and opening to be; the truth where left out.
    """
    belief = belief or AssumedGeometry(cup.lip_point, second.opening_centre)
    opening = OPENING_M + belief.opening_m - second.opening_centre
    joints = plan_joints(path, SideGrasp(belief.lip_m, cup.height_m), opening)
    with SimulatedArm(joints(0.0)) as arm:
        table = PouringTable(arm, cup, second, ball_radius_m, n_balls, rng)
        drive = _Led(joints) if led else _Follow(joints)
        return _run(arm, table, drive, float(joints.x[-1]))


class _Follow:
    """The controller follows the plan."""

    strongest_pull_n = 0.0

    def __init__(self, joints: CubicSpline) -> None:
        self._joints = joints

    def __call__(self, arm: SimulatedArm) -> None:
        now, end = arm.time_s, float(self._joints.x[-1])
        if now < end:
            arm.set_reference(self._joints(now), self._joints(now, 1), self._joints(now, 2))
        else:
            arm.set_reference(self._joints(end))


class _Led:
    """A person's hands lead the arm, which only carries its weight."""

    def __init__(self, joints: CubicSpline) -> None:
        self._joints = joints
        self.strongest_pull_n = 0.0

    def __call__(self, arm: SimulatedArm) -> None:
        arm.set_gravity_compensation(True)
        now = min(arm.time_s, float(self._joints.x[-1]))
        here, soon = frame_poses(self._joints(np.array([now, now + 1e-3])))
        moving = 1e3 * (now < self._joints.x[-1])
        target = HandTarget(
            here[7, :3, 3],
            here[7, :3, :3],
            moving * (soon[7, :3, 3] - here[7, :3, 3]),
            here[3, :3, 3],
            moving * (soon[3, :3, 3] - here[3, :3, 3]),
        )
        self.strongest_pull_n = max(self.strongest_pull_n, pull(arm, target, STEADY_GRIP))


def _run(
    arm: SimulatedArm, table: PouringTable, drive: "_Follow | _Led", duration_s: float
) -> Poured:
    touches: list[float] = []
    arm.before_step += [drive, lambda _: touches.append(table.touch_n())]
    states, poses, counts = [], [], []
    samples = round((duration_s + LAST_WAIT_S) * 1000.0 / STEPS_PER_SAMPLE) + 1
    for k in range(samples):
        if k:
            arm.step(STEPS_PER_SAMPLE)
        states.append(arm.state())
        poses.append(table.cup_pose())
        counts.append([int(where.sum()) for where in table.look()])
    times = np.arange(samples, dtype=np.float64) * STEPS_PER_SAMPLE * 1e-3
    in_cup, in_second = np.array(counts).T
    return Poured(
        times,
        *ArmState.together(states)[:3],
        seen_path(times, np.array(poses), table.grasp.lip_m, OPENING_M),
        in_cup,
        in_second,
        table.n_balls,
        table.through_wall,
        drive.strongest_pull_n,
        arm.saturated_steps,
        TIME_STEP_S * int(np.count_nonzero(touches)),
        max(touches, default=0.0),
    )
