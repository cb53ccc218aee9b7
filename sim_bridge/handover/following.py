# SPDX-License-Identifier: Apache-2.0
"""What an arm and its fingers do about the state of a transfer."""

import numpy as np

from intent_recognition.transfer import Holding
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import SimulatedArm
from sim_bridge.handover.fingers import Fingers

CARRIED = (Holding.CARRYING, Holding.OFFERING, Holding.RETURNING)


class GripFollower:
    """Presses the fingers, and carries the weight that the person has not taken over."""

    def __init__(self, arm: SimulatedArm, fingers: Fingers) -> None:
        self._arm, self._fingers, self._payload_n = arm, fingers, 0.0

    def follow(
        self, holding: Holding, share: float, weight_n: float, grip_n: float, step_s: float
    ) -> None:
        """Do what is asked for from now on, `step_s` after the last time."""
        self._fingers.press(grip_n)
        wanted_n = weight_n * (1.0 - share) if holding in CARRIED else 0.0
        # slower than it is measured, faster than people give it up
        reach_n = np.inf if holding in (Holding.EMPTY, Holding.RELEASING) else 40.0 * step_s
        self._payload_n += float(np.clip(wanted_n - self._payload_n, -reach_n, reach_n))
        self._arm.set_payload(max(self._payload_n, 0.0) / GRAVITY_M_S2)
