# SPDX-License-Identifier: Apache-2.0
"""Containers with balls for a fluid: tilting, pouring and catching, each in a world of its own."""

from sim_bridge.balls.collision import HULL_MARGIN_M, wall_pieces, write_obj
from sim_bridge.balls.fluid import ball_radius_m, balls_in, hollow_of, settled
from sim_bridge.balls.hollow import Hollow, offset
from sim_bridge.balls.table import TRIALS_FILE, Trials, read_trials, write_trials
from sim_bridge.balls.tilting import Tilted, WallGuard, level_axes, tilt_along
from sim_bridge.balls.trials import (
    COLUMNS,
    CONTAINER_SEED,
    FILLING,
    FILLING_TILT_RAD,
    POURING,
    SECOND,
    TRIALS_PER_OBJECT,
    TrialBlock,
    blocks,
    container,
    make,
)
from sim_bridge.balls.world import CONTACT_BREAKING_M, DENSITY_KG_M3, STEP_S, BallWorld

__all__ = [
    "COLUMNS",
    "CONTACT_BREAKING_M",
    "CONTAINER_SEED",
    "DENSITY_KG_M3",
    "FILLING",
    "FILLING_TILT_RAD",
    "HULL_MARGIN_M",
    "POURING",
    "SECOND",
    "STEP_S",
    "TRIALS_FILE",
    "TRIALS_PER_OBJECT",
    "BallWorld",
    "Hollow",
    "Tilted",
    "TrialBlock",
    "Trials",
    "WallGuard",
    "ball_radius_m",
    "balls_in",
    "blocks",
    "container",
    "hollow_of",
    "level_axes",
    "make",
    "offset",
    "read_trials",
    "settled",
    "tilt_along",
    "wall_pieces",
    "write_obj",
    "write_trials",
]
