# SPDX-License-Identifier: Apache-2.0
"""Pictures of the arm beside the pole, without a display."""

import numpy as np
from numpy.typing import NDArray

from experiments.pole.geometry import fingertip
from experiments.pole.world import Pole
from intent_recognition.array_types import Floats
from sim_bridge.arm import SimulatedArm
from sim_bridge.physics import pybullet

WIDTH, HEIGHT = 560, 470


def picture(q: Floats) -> NDArray[np.uint8]:
    """The arm in a posture (7,) with the pole and its finger's spot, RGB (H, W, 3) uint8."""
    with SimulatedArm(q) as arm:
        client = arm.client
        Pole(arm)
        _table(arm)
        tip = fingertip(q)
        look = client.createVisualShape(
            pybullet.GEOM_CYLINDER, radius=0.02, length=0.004, rgbaColor=(0.76, 0.09, 0.36, 1.0)
        )
        client.createMultiBody(0.0, -1, look, (float(tip[0]), float(tip[1]), 0.003))
        view = client.computeViewMatrix((1.25, -0.75, 1.05), (0.27, 0.0, 0.26), (0.0, 0.0, 1.0))
        lens = client.computeProjectionMatrixFOV(42.0, WIDTH / HEIGHT, 0.1, 4.0)
        image = client.getCameraImage(
            WIDTH, HEIGHT, view, lens, renderer=pybullet.ER_TINY_RENDERER,
            lightDirection=(0.6, -1.0, 2.0),
        )  # fmt: skip
    return np.reshape(np.array(image[2], dtype=np.uint8), (HEIGHT, WIDTH, 4))[..., :3]


def _table(arm: SimulatedArm) -> None:
    size = (0.55, 0.5, 0.005)
    look = arm.client.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=size, rgbaColor=(0.88, 0.86, 0.82, 1.0)
    )
    arm.client.createMultiBody(0.0, -1, look, (0.4, 0.0, -0.005))
