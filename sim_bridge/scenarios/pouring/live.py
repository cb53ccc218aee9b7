# SPDX-License-Identifier: Apache-2.0
"""A cup in the hand of an arm that nodes control, and what a camera sees of it."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import inverse_kinematics
from intent_recognition.warping import ObjectCloud
from sim_bridge.arm import SimulatedArm
from sim_bridge.containers import scan
from sim_bridge.scenarios.pouring.novel import (
    BALLS_ABOVE,
    N_BALLS,
    container_named,
    half_full_radius_m,
)
from sim_bridge.scenarios.pouring.table import PouringTable
from sim_bridge.scenarios.pouring.task_space import OPENING_M, SEED_POSTURE, PourPath, SideGrasp

STAND_M = np.array([-0.27, 0.0, 0.10])
"""Initial offset of the lip from the second opening's default place: along, across, up [m]."""


class LiveCounts(NamedTuple):
    """Numbers of balls by place."""

    in_cup: int
    in_second: int
    spilled: int
    through_wall: int


def balls_above_m(cup: str) -> float:
    """Height to which balls in a cup rise above its lip before they leave [m]."""
    return BALLS_ABOVE * half_full_radius_m(container_named(cup))


def start_posture(cup: str) -> Floats:
    """Joint angles (7,) [rad] that hold a cup upright beside the second container."""
    held = container_named(cup)
    stand = PourPath(np.zeros(1), STAND_M[None], np.zeros(1))
    poses = SideGrasp(held.lip_point, held.height_m).hand_poses(stand, OPENING_M)
    return inverse_kinematics(poses[0], SEED_POSTURE)


class LivePouring:
    """A half-full cup of balls in the hand, and the second container, in an arm's world.

    The arm is at rest in `start_posture`. `opening_m` is the centre of the second opening (3,),
    world.
    """

    def __init__(
        self, arm: SimulatedArm, cup: str, second: str, opening_m: Floats, seed: int
    ) -> None:
        rng = np.random.default_rng(seed)
        held, other = container_named(cup), container_named(second)
        radius = half_full_radius_m(held)
        self._table = PouringTable(arm, held, other, radius, N_BALLS, rng, opening_m)
        self._scans = [scan(one.mesh, rng) for one in (held, other)]

    def look(self) -> LiveCounts:
        """Count the balls by place; call this every few milliseconds."""
        in_cup, in_second = (int(where.sum()) for where in self._table.look())
        spilled = self._table.n_balls - in_cup - in_second
        return LiveCounts(in_cup, in_second, spilled, self._table.through_wall)

    def clouds(self) -> tuple[ObjectCloud, ObjectCloud]:
        """Scans of the cup and the second container at their present poses, world."""
        poses = (self._table.cup_pose(), self._table.second_pose)
        cup, second = (
            ObjectCloud(seen.points @ pose[:3, :3].T + pose[:3, 3], seen.normals @ pose[:3, :3].T)
            for seen, pose in zip(self._scans, poses, strict=True)
        )
        return cup, second
