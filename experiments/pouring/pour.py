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
    drive = _lead if led else _follow
    pulls_n, touches_n = [0.0], [0.0]
    states, poses, counts = [], [], []
    with SimulatedArm(joints(0.0)) as arm:
        table = PouringTable(arm, cup, second, ball_radius_m, n_balls, rng)
        arm.before_step += [
            lambda arm: pulls_n.append(drive(arm, joints)),
            lambda _: touches_n.append(table.touch_n()),
        ]
        samples = round((float(joints.x[-1]) + LAST_WAIT_S) * 1000.0 / STEPS_PER_SAMPLE) + 1
        for k in range(samples):
            if k:
                arm.step(STEPS_PER_SAMPLE)
            states.append(arm.state())
            poses.append(table.cup_pose())
            counts.append([int(where.sum()) for where in table.look()])
        through_wall = table.through_wall
    times = np.arange(samples, dtype=np.float64) * STEPS_PER_SAMPLE * 1e-3
    in_cup, in_second = np.array(counts).T
    return Poured(
        times,
        *ArmState.together(states)[:3],
        seen_path(times, np.array(poses), table.grasp.lip_m, OPENING_M),
        in_cup,
        in_second,
        n_balls,
        through_wall,
        max(pulls_n),
        arm.saturated_steps,
        TIME_STEP_S * int(np.count_nonzero(touches_n)),
        max(touches_n),
    )


def _follow(arm: SimulatedArm, joints: CubicSpline) -> float:
    """Let the controller follow the plan; nobody pulls."""
    now, end = arm.time_s, float(joints.x[-1])
    if now < end:
        arm.set_reference(joints(now), joints(now, 1), joints(now, 2))
    else:
        arm.set_reference(joints(end))
    return 0.0


def _lead(arm: SimulatedArm, joints: CubicSpline) -> float:
    """Lead the arm, which only carries its weight, by hand; return the strongest pull [N]."""
    arm.set_gravity_compensation(True)
    now = min(arm.time_s, float(joints.x[-1]))
    here, soon = frame_poses(joints(np.array([now, now + 1e-3])))
    moving = 1e3 * (now < joints.x[-1])
    target = HandTarget(
        here[7, :3, 3],
        here[7, :3, :3],
        moving * (soon[7, :3, 3] - here[7, :3, 3]),
        here[3, :3, 3],
        moving * (soon[3, :3, 3] - here[3, :3, 3]),
    )
    return pull(arm, target, STEADY_GRIP)
