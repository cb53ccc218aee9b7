# SPDX-License-Identifier: Apache-2.0
"""A pour without the arm's physics: the cup tilts along a path, and balls that leave it fly freely.

Gravity turns instead of the cup (`balls.tilting`). A ball is caught if its centre comes down
through the opening of the second container, which holds no more than `FULL_SHARE` of its volume.
This takes far less time than a pour with the arm; balls do not bounce off the rim.
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
"""Number of initial arrangements of the balls; settling takes as long as half a pour."""


class BallCount(NamedTuple):
    """Numbers of balls after a pour: in all, in the second container, beside it, in the cup."""

    balls: int
    caught: int
    spilled: int
    kept: int


def capacity(container: Container, ball_radius_m: float) -> int:
    """Number of balls that a container can hold before it overflows."""
    return int(FULL_SHARE * balls_in(container.inner_volume_m3, ball_radius_m))


class BallPours(AbstractContextManager["BallPours"]):
    """Pours with one pair of containers; a context manager that ends the physics."""

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
        """Pour along a path of the lip; `fill` numbers the arrangement, `N_FILLS` are cached."""
        inside = self._fill(fill)
        start = path.times_s[np.argmax(path.tilt_rad > 0.3)]  # no ball leaves before
        end = min(path.times_s[np.argmax(path.tilt_rad)] + 0.5, path.times_s[-1])
        times = np.arange(start, end, STEP_S)
        tilted = tilt_along(self._world, inside, np.interp(times, path.times_s, path.tilt_rad))
        left = int(tilted.left.sum())
        caught = min(int(self._caught(path, start, tilted).sum()), self._capacity)
        return BallCount(len(inside), caught, left - caught, len(inside) - left)

    def _caught(self, path: PourPath, start_s: float, tilted: Tilted) -> Flags:
        """Whether each ball that left comes down through the opening, by its free flight."""
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
