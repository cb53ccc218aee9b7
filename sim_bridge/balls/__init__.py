# SPDX-License-Identifier: Apache-2.0
"""Containers with balls for a fluid: tilting, pouring and catching, each in a world of its own."""

from sim_bridge.balls.collision import HULL_MARGIN_M, wall_pieces, write_obj
from sim_bridge.balls.fluid import N_CORNERS, N_HEIGHTS, ball_radius_m, balls_in, hollow_of, settled
from sim_bridge.balls.hollow import Hollow, offset
from sim_bridge.balls.tilting import Tilted, WallGuard, level_axes, tilt_along
from sim_bridge.balls.world import CONTACT_BREAKING_M, STEP_S, BallWorld, add_balls, ball_mass_kg
