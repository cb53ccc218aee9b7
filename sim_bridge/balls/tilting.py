# SPDX-License-Identifier: Apache-2.0
"""Tilting a container with balls about its lip, and what leaves it.

Gravity turns and the container stands still: a container that is moved at 240 Hz lets balls
through its wall, one that stands still does not. At these speeds the two differ by the inertial
forces of the turn, 0.1 % of gravity.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Flags, Floats
from sim_bridge.balls.hollow import Hollow
from sim_bridge.balls.world import STEP_S, BallWorld


@dataclass(frozen=True)
class Tilted:
    """What came of tilting a container."""

    left: Floats  # (N,) which balls left over the rim
    exit_time_s: Floats  # (N,) when, from the start of the turn; NaN for those that stayed
    # (N, 3) where, relative to the lip, in axes that do not turn: x in the direction of pouring, z
    # up; NaN for those that stayed
    exit_position_m: Floats
    exit_velocity_m_s: Floats  # (N, 3) how fast, in the same axes; NaN for those that stayed
    through_wall: int  # how many balls were seen in or beyond the wall without leaving over the rim


def level_axes(tilt_rad: float) -> Floats:
    """Rotation (3, 3) from the container's axes into axes with z up and x toward the pour."""
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def tilt_along(world: BallWorld, balls_m: Floats, tilts_rad: Floats) -> Tilted:
    """Fill a container and tilt it toward +x about its lip, until the end or until it is empty.

    Balls with settled centres (N, 3) replace those of the world; the tilts (K,) [rad] are those in
    each physics step.
    """
    world.fill(balls_m)
    world.step(round(0.05 / STEP_S))
    lip_m = world.hollow.lip_m(np.array([1.0, 0.0]))
    guard = WallGuard(world.hollow, world.ball_radius_m, world.positions_m())
    exit_time_s = np.full(len(balls_m), np.nan)
    position, velocity = np.full((2, len(balls_m), 3), np.nan)
    for k, angle in enumerate(tilts_rad.tolist(), 1):
        world.set_gravity(np.array([np.sin(angle), 0.0, -np.cos(angle)]))  # as the cup sees it
        world.step()
        if k % 4:  # 17 ms, in which none crosses a wall
            continue
        positions, axes = world.positions_m(), level_axes(angle)
        inside, from_lip = guard.look(positions), (positions - lip_m) @ axes.T
        fell = ~inside & (from_lip[:, 2] < -world.ball_radius_m) & np.isnan(exit_time_s)
        if fell.any():
            exit_time_s[fell], position[fell] = k * STEP_S, from_lip[fell]
            velocity[fell] = (world.velocities_m_s() @ axes.T)[fell]
        if np.isfinite(exit_time_s).all():
            break
    return Tilted(np.isfinite(exit_time_s), exit_time_s, position, velocity, guard.count)


class WallGuard:
    """Counts balls that got into or through a wall, from how they were seen one after another.

    A ball leaves through the opening, where its centre is above the rim less its radius. One
    whose centre is beyond wall or floor, and was inside and below that height when last seen,
    went through.
    """

    def __init__(self, hollow: Hollow, radius_m: float, positions_m: Floats) -> None:
        self._hollow = hollow
        self._opening_m = hollow.rim_height_m - radius_m
        self._below = self._deep(positions_m) & (hollow.clearance_m(positions_m) >= 0.0)
        self.count = 0

    def look(self, positions_m: Floats) -> Flags:
        """Take note of centres (N, 3); return which of them are inside, below the rim (N,)."""
        hollow, z = self._hollow, positions_m[:, 2]
        clearance = hollow.clearance_m(positions_m)
        beyond = (z < self._opening_m) & ((clearance < 0.0) | (z < hollow.heights_m[0]))
        self.count += int(np.sum(self._below & beyond))
        self._below = self._deep(positions_m) & (clearance >= 0.0)
        return (z >= hollow.heights_m[0]) & (z < hollow.rim_height_m) & (clearance >= 0.0)

    def add(self, n_balls: int) -> None:
        """Watch further balls, which come in from outside."""
        self._below = np.append(self._below, np.zeros(n_balls, dtype=bool))

    def _deep(self, positions_m: Floats) -> Flags:
        z = positions_m[:, 2]
        return (z < self._opening_m) & (z >= self._hollow.heights_m[0])
