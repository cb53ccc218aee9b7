# SPDX-License-Identifier: Apache-2.0
"""Containers with balls for a fluid: tilting, pouring and catching, each in its own world."""

from sim_bridge.balls.collision import shell_pieces, solid_pieces, wall_pieces, write_obj
from sim_bridge.balls.hollow import Hollow, hollow_of
from sim_bridge.balls.tilting import Tilted, WallGuard, level_axes, tilt_along
from sim_bridge.balls.world import (
    CONTACT_BREAKING_M,
    STEP_S,
    BallWorld,
    add_balls,
    ball_mass_kg,
    ball_radius_m,
    balls_in,
    settled,
)
