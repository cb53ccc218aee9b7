# SPDX-License-Identifier: Apache-2.0
"""Places that the arm's hand passes slowly, however fast the person is: fingers take their time."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Arm
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.retiming import N_GRID


class SlowPlaces:
    """Bounds the speed of an arm's hand at some places.

    Args:
        arm: whose tip is the hand.
        places: x, y, z and radius [m], and largest speed [m/s] of each (n, 5), in the frame of the
            arm's base.
    """

    def __init__(self, arm: Arm, places: Floats) -> None:
        self._arm, self._places = arm, places

    def rate_ceiling(self, path: JointPath) -> Floats:
        """Largest phase rate (G + 1,) [1/s] on the grid of a path; infinite away from all."""
        phase = np.linspace(0.0, 1.0, N_GRID + 1)
        hand = self._arm.skeleton(path.spline(phase))[:, -1]
        way = np.linalg.norm(np.gradient(hand, phase, axis=0), axis=1)
        away = np.linalg.norm(hand[:, None] - self._places[:, :3], axis=2)
        speed = np.where(away <= self._places[:, 3], self._places[:, 4], np.inf).min(axis=1)
        return np.asarray(speed / np.maximum(way, 1e-6))


def parse_places(texts: Sequence[str]) -> Floats:
    """Places (n, 5) of texts 'x y z radius speed'.

    Raises:
        ArgumentError: a text is no place.
    """
    places = []
    for text in filter(None, texts):
        try:
            place = [float(word) for word in text.split()]
        except ValueError:
            place = []
        if len(place) != 5 or not np.all(np.isfinite(place)) or min(place[3:]) <= 0.0:
            expected = "'x y z radius speed', the last two above 0"
            raise ArgumentError.about("slow_at", expected, text, "In metres and m/s.")
        places.append(place)
    return np.array(places, dtype=np.float64).reshape(-1, 5)
