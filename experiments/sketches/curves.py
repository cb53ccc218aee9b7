# SPDX-License-Identifier: Apache-2.0
"""Pairs of curves as one draws them with a computer mouse: one DOF of each of two agents.

Stands in for the sketches of Maeda et al. 2014, part IV-A, whose data were not published. Three
causes move the heights of both curves of a pair together. Each curve also has its drawer's wobble
and timing, and the pixels of the screen.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from intent_recognition.array_types import Floats

N_SAMPLES = 101
"""Samples of each drawn curve."""
PHASE = np.linspace(0.0, 1.0, N_SAMPLES)
NAMES = ("observed", "controlled")
VIA = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
HEIGHTS = np.array([[0.0, 0.7, 1.5, 1.2, 0.2, -0.3], [0.3, -0.2, -0.5, 0.3, 1.1, 1.4]])
"""Mean heights of both curves at `VIA`, in units of the sketch."""
SPREAD = 0.3
"""Standard deviation of a height by a cause whose entry in `MIXING` is one."""
OWN = 0.008
"""Standard deviation of the drawer's wobble, independent for each curve and height."""
TIMING = 0.002
"""Standard deviation of the timing of the via points, in phase."""
PIXEL = 0.005
"""Height of a pixel: a mouse reports whole ones."""
BEND = 0.03
"""Dependence of the controlled curve on the squares of the causes, in `SPREAD`s."""

MIXING = np.array(
    [
        [
            [0.2, 0.7, 0.9, 0.6, 0.2, 0.0],
            [0.0, 0.1, -0.5, -0.9, -0.3, 0.3],
            [0.5, 0.1, 0, 0, 0.6, 1],
        ],
        [
            [0.0, -0.4, -0.8, -0.4, 0.4, 0.8],
            [0.3, 0.6, 0.2, -0.5, -0.7, -0.2],
            [0.4, 0.3, 0, 0, 0, 0.5],
        ],
    ]
)
"""What each of three causes does to the heights of both curves, (2, 3, V)."""


def sketch_pairs(rng: np.random.Generator, n_pairs: int) -> Floats:
    """Curves at `PHASE`, (n, T, 2): the observed agent's, then the controlled one's."""
    causes = rng.normal(size=(n_pairs, 3))
    pairs = np.empty((n_pairs, N_SAMPLES, 2))
    for pair, cause in zip(pairs, causes, strict=True):
        for agent in range(2):
            bend = BEND * (cause**2 - 1.0) if agent else np.zeros(3)
            heights = HEIGHTS[agent] + SPREAD * (cause + bend) @ MIXING[agent]
            heights = heights + OWN * rng.normal(size=VIA.size)
            pair[:, agent] = _drawn(rng, heights)
    return np.round(pairs / PIXEL) * PIXEL


def _drawn(rng: np.random.Generator, heights: Floats) -> Floats:
    """A smooth stroke through heights at nearly even times, (T,)."""
    times = VIA.copy()
    times[1:-1] += TIMING * rng.normal(size=VIA.size - 2)
    return CubicSpline(times, heights, bc_type="natural")(PHASE)
