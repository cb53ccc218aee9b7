# SPDX-License-Identifier: Apache-2.0
"""Tilt a container with balls about its lip, and record which balls leave it.

Gravity turns while the container is fixed, because a container that moves at 240 Hz lets balls
through its wall. At these speeds, this neglects the inertial forces of the turn, 0.1 % of gravity.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Flags, Floats
from sim_bridge.balls.hollow import Hollow
from sim_bridge.balls.world import STEP_S, BallWorld


@dataclass(frozen=True)
class Tilted:
    """Result of tilting a container; exit values are NaN for balls that stayed."""

    left: Floats  # whether each ball left over the rim (N,)
    exit_time_s: Floats  # time of leaving, from the start of the turn (N,)
    # position of leaving relative to the lip, in level axes: x in the direction of pouring, z up
    # (N, 3)
    exit_position_m: Floats
    exit_velocity_m_s: Floats  # velocity of leaving, in the same axes (N, 3)
    through_wall: int  # number of balls that went into or through the wall


def level_axes(tilt_rad: float) -> Floats:
    """Rotation (3, 3) from the container's axes into axes with z up and x toward the pour."""
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def tilt_along(world: BallWorld, balls_m: Floats, tilts_rad: Floats) -> Tilted:
    """Fill a container and tilt it toward +x about its lip, until the end or until it is empty.

    Balls with settled centres (N, 3) replace those of the world. `tilts_rad` (K,) has one tilt per
    physics step.
    """
    world.fill(balls_m)
    world.step(round(0.05 / STEP_S))
    lip_m = world.hollow.lip_m(np.array([1.0, 0.0]))
    guard = WallGuard(world.hollow, world.ball_radius_m, world.positions_m())
    exit_time_s = np.full(len(balls_m), np.nan)
    position, velocity = np.full((2, len(balls_m), 3), np.nan)
    for k, angle in enumerate(tilts_rad.tolist(), 1):
        world.set_gravity(np.array([np.sin(angle), 0.0, -np.cos(angle)]))  # in the cup's frame
        world.step()
        if k % 4:  # 17 ms, in which no ball crosses a wall
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
    """Counts balls that went into or through a wall, from their successive positions.

    A ball leaves through the opening if its centre is above the rim less its radius. A ball went
    through a wall if its centre is below that height and beyond wall or floor, and was inside and
    below that height in the observation before.
    """

    def __init__(self, hollow: Hollow, radius_m: float, positions_m: Floats) -> None:
        self._hollow = hollow
        self._opening_m = hollow.rim_height_m - radius_m
        self._below = self._deep(positions_m) & (hollow.clearance_m(positions_m) >= 0.0)
        self.count = 0

    def look(self, positions_m: Floats) -> Flags:
        """Observe centres (N, 3); return whether each is inside and below the rim, (N,)."""
        hollow, z = self._hollow, positions_m[:, 2]
        clearance = hollow.clearance_m(positions_m)
        beyond = (z < self._opening_m) & ((clearance < 0.0) | (z < hollow.heights_m[0]))
        self.count += int(np.sum(self._below & beyond))
        self._below = self._deep(positions_m) & (clearance >= 0.0)
        return (z >= hollow.heights_m[0]) & (z < hollow.rim_height_m) & (clearance >= 0.0)

    def add(self, n_balls: int) -> None:
        """Observe further balls, which enter from outside."""
        self._below = np.append(self._below, np.zeros(n_balls, dtype=bool))

    def _deep(self, positions_m: Floats) -> Flags:
        z = positions_m[:, 2]
        return (z < self._opening_m) & (z >= self._hollow.heights_m[0])
