# SPDX-License-Identifier: Apache-2.0
"""The pole in the arm's physics world: clearance and contact of the arm."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from experiments.pole.geometry import POLE_HEIGHT_M, POLE_M, POLE_RADIUS_M, finger_clearance
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import forward_kinematics
from sim_bridge.arm import STEPS_PER_SAMPLE, SimulatedArm
from sim_bridge.physics import pybullet

LOOK_M = 0.5
"""Distances are measured up to here [m]."""
WATCH_M = 0.05
"""Distance [m] beyond which no touch is possible within the next sample: that would be 5 m/s."""


class Pole:
    """A fixed pole in the world of an arm, whose base stands at the origin."""

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm
        size = {"radius": POLE_RADIUS_M}
        shape = arm.client.createCollisionShape(
            pybullet.GEOM_CYLINDER, height=POLE_HEIGHT_M, **size
        )
        look = arm.client.createVisualShape(
            pybullet.GEOM_CYLINDER, length=POLE_HEIGHT_M, rgbaColor=(0.35, 0.25, 0.2, 1.0), **size
        )
        self.body = arm.client.createMultiBody(
            0.0, shape, look, (float(POLE_M[0]), float(POLE_M[1]), POLE_HEIGHT_M / 2)
        )

    def clearance(self, q: Floats) -> float:
        """Distance of the arm and its finger from the pole, in metres; negative when inside.

        Args:
            q: where the arm is in its world (7,) [rad], for the finger.
        """
        found = self._arm.client.getClosestPoints(self._arm.body, self.body, LOOK_M)
        hand = forward_kinematics(q)
        finger = finger_clearance(hand[:3, 3], hand[:3, 2])
        return min([finger, *(point[8] for point in found)])

    def touched(self) -> bool:
        """Whether any link of the arm is in contact with the pole after the last step."""
        return bool(self._arm.client.getContactPoints(self._arm.body, self.body))


@dataclass(frozen=True)
class PoleRun:
    """A motion that the arm carried out beside the pole.

    Attributes:
        positions_rad: where the joints were every 10 ms (T, 7).
        clearance_m: least distance from the pole on the way (T,); negative inside.
        touched: whether arm or finger touched the pole.
    """

    positions_rad: Floats
    clearance_m: Floats
    touched: bool


def execute(positions_rad: Floats, times_s: Floats, rest_s: float = 0.5) -> PoleRun:
    """Let the arm follow postures (T, 7) at times (T,) from 0 on, from rest, and watch it for
    `rest_s` more.

    The arm is compliant: a pole in its way stops it, which counts as a touch.
    """
    curve = CubicSpline(times_s, positions_rad, bc_type="clamped")
    end_s, touched = float(times_s[-1]), False
    reached: list[Floats] = []
    distance: list[float] = []
    with SimulatedArm(positions_rad[0]) as arm:
        pole = Pole(arm)

        def follow(arm: SimulatedArm) -> None:
            now = min(arm.time_s, end_s)
            moving = float(arm.time_s < end_s)
            arm.set_reference(curve(now), moving * curve(now, 1), moving * curve(now, 2))

        arm.before_step.append(follow)
        for _ in range(round((end_s + rest_s) * 100.0)):
            near = not distance or distance[-1] < WATCH_M
            for _ in range(STEPS_PER_SAMPLE):
                arm.step()
                touched = touched or (near and pole.touched())
            q = arm.state().q
            reached.append(q)
            distance.append(pole.clearance(q))
    clearance = np.array(distance)
    return PoleRun(np.array(reached), clearance, touched or bool(clearance.min() <= 0.0))
