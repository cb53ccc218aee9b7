# SPDX-License-Identifier: Apache-2.0
"""Movements that begin while the one before still ends: the hand makes both at once.

So do people who go over from one reach to another (superposition: Flash and Henis 1991).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_bridge.coworker.reach import WristMovement


@dataclass(frozen=True)
class SuperposedMovement:
    """A movement, and what remains of the one before.

    Attributes:
        movement: from where the one before ends.
        before: the other.
        into_s: time after its onset at which the movement begins.
    """

    movement: WristMovement
    before: WristMovement
    into_s: float

    @property
    def task(self) -> str:
        """Label of the task it ends in, or ""."""
        return self.movement.task

    @property
    def start_m(self) -> NDArray[np.float64]:
        """Where it begins, (3,), world."""
        return self.positions(np.zeros(1))[0]

    @property
    def goal_m(self) -> NDArray[np.float64]:
        """Where it stops, (3,), world."""
        return self.movement.goal_m

    @property
    def duration_s(self) -> float:
        """Time from onset to end."""
        return self.movement.duration_s

    def positions(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Planned wrist positions (T, 3) in the world at `time_s` (T,) after the onset."""
        remains = self.before.positions(time_s + self.into_s) - self.before.goal_m
        return self.movement.positions(time_s) + remains

    def rotations(
        self, time_s: NDArray[np.float64], before_rad: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Rotation vectors (T, 3) relative to rest, of a wrist that had `before_rad` (3,)."""
        return self.movement.rotations(time_s, before_rad)
