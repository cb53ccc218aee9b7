# SPDX-License-Identifier: Apache-2.0
"""Pointing drawn again from other seeds: how much the shipped recordings leave to chance.

Marker, person and teaching are drawn anew and the arm is taught in physics. The predictions are not
executed: the arm ends where it is told to, within the shipped runs' largest difference.
"""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.experiments.pointing.study import metadata_values, predicted_spot
from intent_recognition.learning import learn

N_DRAWS = 9
"""Draws beside the shipped one, ten in all. Convention."""
QUICK_SPOTS = 3


class PointingDraw(NamedTuple):
    """Largest and mean error of the predicted spots [m], from one seed."""

    seed: int
    largest_m: float
    mean_m: float


def draw_again(
    first_seed: int, quick: bool, progress: Callable[[float], None] = lambda share: None
) -> list[PointingDraw]:
    """Record, learn and predict with further seeds; with `quick` one of them and a few spots.

    Raises:
        TrainingError: the recordings cannot be learned from.
    """
    draws = []
    for k in range(1 if quick else N_DRAWS):
        draws.append(_draw(first_seed + k, QUICK_SPOTS if quick else None))
        progress((k + 1) / N_DRAWS)
    return draws


def _draw(seed: int, most: int | None) -> PointingDraw:
    from sim_bridge.scenarios.pointing import PURPOSES, make, orders

    with TemporaryDirectory() as folder:
        for order in orders(seed):
            if most is None or order.index < most:
                make(order, Path(folder))
        train, test = (
            read_demonstrations(Path(folder) / "pointing" / purpose, load_dofs())[0]
            for purpose in PURPOSES
        )
    library = learn(train)
    errors = [
        np.linalg.norm(predicted_spot(library, one) - metadata_values(one, "spot_m")[:2])
        for one in test
    ]
    return PointingDraw(seed, float(np.max(errors)), float(np.mean(errors)))
