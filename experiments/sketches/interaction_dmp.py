# SPDX-License-Identifier: Apache-2.0
"""Interaction primitives made of DMPs: the baseline of Maeda et al. 2014 (IP), part III-D.

The weights are those of a forcing function instead of positions (Ben Amor et al. 2014; Ijspeert et
al. 2013). Here time is the phase of the movement, so the tau of IP Eq. 13-14 is one. Each DOF has
N + 3 parameters: the weights, then goal, position and velocity at the start. All that is observed
or predicted is linear in them:

    q'' + alpha q' + alpha beta q = psi(z)^T w + alpha beta g        (IP Eq. 13, 12)

so the goal need not be known while the movement is watched, and a rollout is a matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from experiments.sketches.differentiation import Smoother, derivative_operators
from intent_recognition.array_types import Floats
from intent_recognition.promp import NormalizedRBFBasis, fit_weights

N_ENDS = 3
"""Parameters of a DOF beside the weights: goal, start, velocity at the start."""
ROLLOUT_STEPS = 400
"""Steps in which a DMP is integrated over the movement."""


ALPHA, STIFFNESS = 25.0, 25.0**2 / 4.0
"""The attractor q'' = alpha (beta (goal - q) - q') + f per unit of phase, critically damped: alpha,
and alpha beta with beta = alpha / 4."""


class Motion(NamedTuple):
    """Positions and their first and second derivatives by the phase, arrays of one shape."""

    position: Floats
    velocity: Floats
    acceleration: Floats


@dataclass(frozen=True)
class DmpModel:
    """What a DOF's parameters mean; rows of its matrices are for one DOF.

    Attributes:
        basis: N basis functions of the forcing function.
    """

    basis: NormalizedRBFBasis

    @property
    def n_parameters(self) -> int:
        """Parameters of one DOF, N + 3."""
        return self.basis.n_basis + N_ENDS

    def drive(self, motion: Motion) -> Floats:
        """q'' + alpha q' + alpha beta q: what a motion shows of its forcing function and goal."""
        return motion.acceleration + ALPHA * motion.velocity + STIFFNESS * motion.position

    def observation_matrix(self, phase: Floats) -> Floats:
        """Rows that take one DOF's parameters to its drive at phases (T,), (T, N + 3)."""
        rows = np.zeros((len(phase), self.n_parameters))
        rows[:, :-N_ENDS] = self.basis.design_matrix(phase)
        rows[:, -N_ENDS] = STIFFNESS
        return rows

    def start_matrix(self) -> Floats:
        """Rows that take one DOF's parameters to its position and velocity at phase 0, (2, N + 3).

        A drive holds no information on them: differentiating twice removes a straight line.
        """
        return np.eye(2, self.n_parameters, k=self.n_parameters - 2)

    def rollout_matrix(self, phase: Floats) -> Floats:
        """Rows that take one DOF's parameters to its positions at phases in [0, 1], (T, N + 3).

        The attractor integrated with every parameter one in turn.
        """
        grid, position, velocity = _responses(self)
        return CubicHermiteSpline(grid, position, velocity)(np.clip(phase, 0.0, 1.0))

    def fit(self, phase: Floats, motion: Motion, ridge: float = 1e-4) -> Floats:
        """Parameters of demonstrated motions by ridge regression (IP Eq. 12, 14), (D, N + 3).

        Args:
            phase: (T,), increasing; the goal is the position at the last.
            motion: arrays (T, D).
            ridge: relative weight of the curvature penalty, as of `fit_weights`.
        """
        goal = motion.position[-1]
        forces = self.drive(motion) - STIFFNESS * goal
        weights = fit_weights(self.basis, phase, forces, ridge).weights
        ends = np.stack([goal, motion.position[0], motion.velocity[0]], axis=1)
        return np.hstack([weights, ends])


def differentiated(smoother: Smoother, values: Floats, step: float) -> Motion:
    """Smoothed positions and their derivatives of samples (T, D) a step of the phase apart."""
    return Motion(*(derivative_operators(smoother, len(values), step) @ values))


def fit_demonstrations(
    model: DmpModel, demonstrations: Sequence[Floats], smoother: Smoother, ridge: float = 1e-4
) -> Floats:
    """Stacked parameters of demonstrations, (n, D (N + 3)), grouped by DOF (IP Eq. 4).

    Args:
        model: what the parameters mean.
        demonstrations: n arrays (T_i, D) of positions at even phases from 0 to 1.
        smoother: filter of the derivatives.
        ridge: as of `DmpModel.fit`.
    """
    rows = []
    for values in demonstrations:
        phase = np.linspace(0.0, 1.0, len(values))
        motion = differentiated(smoother, values, float(phase[1]))
        rows.append(model.fit(phase, motion, ridge).ravel())
    return np.array(rows)


@lru_cache(maxsize=16)
def _responses(model: DmpModel) -> tuple[Floats, Floats, Floats]:
    """Grid (S + 1,), and positions and velocities there for each parameter, (S + 1, N + 3).

    Between grid points the forcing function is a straight line; for that the step is exact.
    """
    grid = np.linspace(0.0, 1.0, ROLLOUT_STEPS + 1)
    step = grid[1]
    drive = model.observation_matrix(grid)
    state = np.zeros((ROLLOUT_STEPS + 1, 2, model.n_parameters))
    state[0] = model.start_matrix()
    # The drive at the left end of a step and its slope, as two more states.
    system = np.zeros((4, 4))
    system[0, 1] = system[2, 3] = 1.0
    system[1, :3] = -STIFFNESS, -ALPHA, 1.0
    onward = expm(system * step)[:2]
    slope = np.diff(drive, axis=0) / step
    for k in range(ROLLOUT_STEPS):
        state[k + 1] = onward @ np.vstack([state[k], drive[k], slope[k]])
    return grid, state[:, 0], state[:, 1]
