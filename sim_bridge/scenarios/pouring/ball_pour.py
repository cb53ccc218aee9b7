# SPDX-License-Identifier: Apache-2.0
"""A pour without the arm's physics: the cup tilts along a path, and what leaves it flies.

Gravity turns instead of the cup (`balls.tilting`); a ball that leaves the cup flies freely and is
caught if its centre comes down through the second container's opening, which holds no more than
`FULL_SHARE` of its volume. It takes far less time than `pour`; no ball bounces off the rim.
"""

from contextlib import AbstractContextManager
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Flags
from intent_recognition.warping import FULL_SHARE
from sim_bridge import GRAVITY_M_S2
from sim_bridge.balls import STEP_S, BallWorld, Tilted, balls_in, hollow_of, settled, tilt_along
from sim_bridge.containers import Container
from sim_bridge.scenarios.pouring.task_space import PourPath

N_FILLS = 8
"""How many ways the balls may lie. Convention: settling takes as long as half a pour."""


class BallCount(NamedTuple):
    """Where the balls are after a pour."""

    balls: int
    caught: int
    spilled: int
    kept: int


def capacity(container: Container, ball_radius_m: float) -> int:
    """How many balls a container takes before it overflows."""
    return int(FULL_SHARE * balls_in(container.inner_volume_m3, ball_radius_m))


class BallPours(AbstractContextManager["BallPours"]):
    """Pours with one pair of containers; use as a context, leaving it ends the physics."""

    def __init__(
        self, cup: Container, second: Container, ball_radius_m: float, n_balls: int
    ) -> None:
        self._world = BallWorld(hollow_of(cup), ball_radius_m)
        self._second, self._opening_m = hollow_of(second), second.opening_centre
        self._capacity = capacity(second, ball_radius_m)
        self._fill = lru_cache(maxsize=N_FILLS)(
            lambda fill: settled(self._world, n_balls, np.random.default_rng(fill))
        )

    def pour(self, path: PourPath, fill: int) -> BallCount:
        """Pour along a path of the lip; of how the balls lie `N_FILLS` numbers are remembered."""
        inside = self._fill(fill)
        start = path.times_s[np.argmax(path.tilt_rad > 0.3)]  # none leave it before
        end = min(path.times_s[np.argmax(path.tilt_rad)] + 0.5, path.times_s[-1])
        times = np.arange(start, end, STEP_S)
        tilted = tilt_along(self._world, inside, np.interp(times, path.times_s, path.tilt_rad))
        left = int(tilted.left.sum())
        caught = min(int(self._caught(path, start, tilted).sum()), self._capacity)
        return BallCount(len(inside), caught, left - caught, len(inside) - left)

    def _caught(self, path: PourPath, start_s: float, tilted: Tilted) -> Flags:
        """Which of the balls that left come down through the opening: their way to its plane."""
        left = tilted.left
        times = start_s + tilted.exit_time_s[left]
        speed = np.gradient(path.offset_m, path.times_s, axis=0)
        lip, moving = (
            np.column_stack([np.interp(times, path.times_s, column) for column in columns.T])
            for columns in (path.offset_m, speed)
        )
        place = tilted.exit_position_m[left] + lip
        velocity = tilted.exit_velocity_m_s[left] + moving
        up = velocity[:, 2]
        falling = np.sqrt(np.maximum(up**2 + 2.0 * GRAVITY_M_S2 * place[:, 2], 0.0))
        landing = place + ((up + falling) / GRAVITY_M_S2)[:, None] * velocity + self._opening_m
        landing[:, 2] = self._second.rim_height_m
        return self._second.clearance_m(landing) > 0.0

    def __exit__(self, *_: object) -> None:
        self._world.close()
