# SPDX-License-Identifier: Apache-2.0
"""A second container catches what left the first: do all balls end up in it?

The two containers stand in worlds of their own, joined by the balls' positions and velocities
where they leave the first, so that neither container is in the other's way and none moves.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Flags, Floats
from sim_bridge import GRAVITY_M_S2
from sim_bridge.balls import STEP_S, BallWorld, Tilted, WallGuard, tilt_along

LAST_WAIT_S = 0.6
"""How long balls are watched after the last one was thrown [s]: several falls from the rim."""
RADII_BEYOND = 1.5
"""Radii beyond the wall at which a ball has missed the container."""
_STEPS_PER_LOOK = 4
"""Physics steps between two looks at the balls: 17 ms, in which none crosses a wall."""
TURN_RAD_S = 2.0
"""Speed at which a container is tilted [rad/s]."""
HOLD_S = 0.3
"""How long the final tilt is held [s]."""


@dataclass(frozen=True)
class Caught:
    """Whether every ball ended up in the second container.

    Attributes:
        success: whether no ball was seen outside.
        through_wall: how many balls went into or through a wall.
    """

    success: bool
    through_wall: int


def tilt(world: BallWorld, balls_m: Floats, tilt_rad: float, *, hold_s: float = HOLD_S) -> Tilted:
    """Fill a container with settled balls (N, 3), tilt it toward +x about its lip, and wait.

    It ends early when the container is empty.
    """
    turning = round(abs(tilt_rad) / TURN_RAD_S / STEP_S)
    steps = range(turning + round(hold_s / STEP_S))
    share = [min((k + 1) / turning, 1.0) if turning else 1.0 for k in steps]
    return tilt_along(world, balls_m, tilt_rad * np.array(share))


def catch(world: BallWorld, inside_m: Floats, poured: Tilted, lip_m: Floats) -> Caught:
    """Let the balls that left the first container fall onto the second.

    It ends as soon as one ball is outside.

    Args:
        world: of the second container; its balls are replaced.
        inside_m: settled balls (N, 3) that are in it already.
        poured: what left the first container.
        lip_m: where the first container's lip is (3,), in the second's frame.
    """
    order = np.argsort(poured.exit_time_s)[: int(poured.left.sum())]
    starts = poured.exit_position_m[order] + lip_m
    velocities = poured.exit_velocity_m_s[order]
    if _misses(world, starts, velocities).any():
        return Caught(False, 0)
    world.fill(inside_m)
    guard = WallGuard(world.hollow, world.ball_radius_m, inside_m)
    if not len(order):
        return Caught(True, 0)
    steps = np.round((poured.exit_time_s[order] - poured.exit_time_s[order[0]]) / STEP_S)
    added = 0
    for k in range(int(steps[-1]) + round(LAST_WAIT_S / STEP_S)):
        now = slice(added, int(np.searchsorted(steps, k, side="right")))
        if now.stop > added:
            world.add(starts[now], velocities[now])
            guard.add(now.stop - added)
            added = now.stop
        world.step()
        if k % _STEPS_PER_LOOK == 0:
            positions = world.positions_m()
            guard.look(positions)
            if _outside(world, positions).any():
                return Caught(False, guard.count)
    return Caught(True, guard.count)


def _outside(world: BallWorld, positions_m: Floats) -> Flags:
    """Which balls (N, 3) are below the rim and clear of the wall on its far side (N,)."""
    hollow, radius = world.hollow, world.ball_radius_m
    low = positions_m[:, 2] < hollow.rim_height_m - radius
    # Beyond the rim's own ring, which is the widest: this is no matter of wall thickness.
    rim = np.column_stack([positions_m[:, :2], np.full(len(positions_m), hollow.rim_height_m)])
    return low & (hollow.clearance_m(rim) < -RADII_BEYOND * radius)


def _misses(world: BallWorld, starts_m: Floats, velocities_m_s: Floats) -> Flags:
    """Which balls fly past the rim without touching it: (N,).

    A ball that starts below the rim's height and outside never comes in.
    """
    hollow = world.hollow
    drop = starts_m[:, 2] - hollow.rim_height_m
    up = velocities_m_s[:, 2]
    time = (up + np.sqrt(np.maximum(up**2 + 2.0 * GRAVITY_M_S2 * drop, 0.0))) / GRAVITY_M_S2
    landing = starts_m + np.maximum(time, 0.0)[:, None] * velocities_m_s
    landing[:, 2] = hollow.rim_height_m
    return hollow.clearance_m(landing) < -3.0 * world.ball_radius_m
