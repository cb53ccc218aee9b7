# SPDX-License-Identifier: Apache-2.0
"""State of the arm as it is reported, exactly or through noisy sensors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats


class ArmState(NamedTuple):
    """State of the joints: q [rad], qd [rad/s], last commanded torque [Nm], all (n,)."""

    q: Floats
    qd: Floats
    torque: Floats
    time_s: float

    @classmethod
    def together(cls, states: Sequence["ArmState"]) -> "ArmState":
        """Stack successive states to one with arrays (T, n) and the time of the last one."""
        q, qd, torque = (np.array([state[i] for state in states]) for i in range(3))
        return cls(q, qd, torque, states[-1].time_s)


class HandPose(NamedTuple):
    """Pose of the hand in the world: position (3,) [m], orientation (4,) xyzw."""

    position: Floats
    orientation: Floats


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of the measured joint state."""

    position_std_rad: float = 2e-4
    velocity_std_rad_s: float = 5e-3
    torque_std_nm: float = 0.1

    def measure(self, state: ArmState, rng: np.random.Generator) -> ArmState:
        """Return a state, or stacked ones (T, n), with independent Gaussian noise on each joint."""
        draw = rng.standard_normal((3, *state.q.shape))
        return ArmState(
            state.q + self.position_std_rad * draw[0],
            state.qd + self.velocity_std_rad_s * draw[1],
            state.torque + self.torque_std_nm * draw[2],
            state.time_s,
        )
