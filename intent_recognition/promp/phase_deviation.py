# SPDX-License-Identifier: Apache-2.0
"""The phase deviation: how far a person is ahead of, or behind, steady progress.

At recorded phase u, the elapsed share of the movement's duration, a person has reached the
reference phase u + s(u) e. The phase deviation e is a stationary Ornstein-Uhlenbeck process of unit
scale along u, so hesitation and hurry decay. Its stationary distribution is Student's, because few
demonstrations show few long hesitations. The scale s(u) is learned from the warps that align the
demonstrations (`learning.timing`). The deviation is filtered on a grid, together with the Gaussian
over the weights.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from intent_recognition.array_types import Floats, read_only

N_DEVIATIONS, DEVIATION_SPAN = 15, 3.5
"""Number of values of the phase deviation on its grid, and the largest value, in units of the scale
(docs/decisions/one_filter.md)."""
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the Student distributions of phase deviation, log duration and evidence:
new people are often slower or faster than any demonstration (docs/decisions/one_filter.md)."""


@dataclass(frozen=True)
class PhaseDeviation:
    """Prior of a person's phase deviation.

    Attributes:
        deviation_std: scale at U evenly spaced recorded phases from 0 to 1, (U,); if all are zero,
            progress is steady and there is a single deviation.
        correlation: recorded phase after which the autocorrelation has fallen to 1/e.
        evidence: exponent of an observation's likelihood in the posterior of the deviation, because
            residuals are correlated along a movement.
        controlled_follows: whether the controlled agent deviates with the observed one; if not, its
            progress is steady.
        duration_exponent: power of the relative duration in the odds of the phase (`steady_phase`).
    """

    deviation_std: Floats
    correlation: float
    evidence: float
    controlled_follows: bool = True
    duration_exponent: float = 0.0

    @cached_property
    def grid(self) -> Floats:
        """Values of the phase deviation in units of its scale, (E,)."""
        if not np.any(self.deviation_std):
            return read_only(np.zeros(1))
        return read_only(np.linspace(-DEVIATION_SPAN, DEVIATION_SPAN, N_DEVIATIONS))

    @cached_property
    def _phases(self) -> Floats:
        """Recorded phases of `deviation_std`, (U,)."""
        return np.linspace(0.0, 1.0, len(self.deviation_std))

    def scale(self, recorded: Floats) -> Floats:
        """Scale of the deviation at recorded phases, (...)."""
        return np.interp(recorded, self._phases, self.deviation_std)


STEADY = PhaseDeviation(np.zeros(2), 1.0, 1.0)
"""Steady progress: no phase deviation."""


def deviation_prior(phase_deviation: PhaseDeviation) -> Floats:
    """Prior probability of each phase deviation, (E,)."""
    return _student(phase_deviation.grid)


def deviation_transition(phase_deviation: PhaseDeviation, passed: Floats) -> Floats:
    """Transition matrices of the phase deviation, (..., E, E), whose rows sum to one.

    The prior is stationary under them, and two transitions in a row equal the transition over their
    sum, so the frequency of observations does not matter.

    Args:
        phase_deviation: prior of the phase deviation.
        passed: change of the recorded phase, (...); below zero counts as zero.
    """
    grid = phase_deviation.grid
    if len(grid) == 1:
        return np.ones((*np.shape(passed), 1, 1))
    decay, modes = _modes(len(grid))
    share = np.maximum(passed, 0.0) / phase_deviation.correlation
    kernel = np.exp(-share[..., None] * decay) @ modes
    kernel = kernel.reshape(*share.shape, len(grid), len(grid))
    np.maximum(kernel, 0.0, out=kernel)
    kernel += 1e-12 * _student(grid)  # keeps every deviation possible
    kernel /= kernel.sum(axis=-1, keepdims=True)
    return kernel


def steady_phase(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float
) -> Floats:
    """Reference phases without a deviation, in [0, 1]: (...).

    A longer movement is not slower throughout. The odds z / (1 - z) of the reference phase are
    those of the recorded phase times a power of the relative duration. With an exponent of 1, the
    speed at the beginning does not depend on the duration; with -1, the speed at the end does not.

    Args:
        phase_deviation: prior with the exponent.
        recorded: recorded phases, (...); clipped to [0, 1].
        relative: duration relative to the usual one of the task; broadcast against `recorded`.
    """
    recorded = np.minimum(np.maximum(recorded, 0.0), 1.0)
    if not phase_deviation.duration_exponent:
        return recorded
    ahead = recorded * relative**phase_deviation.duration_exponent
    return np.asarray(ahead / (1.0 - recorded + ahead))


def steady_rate(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float
) -> Floats:
    """Derivative of `steady_phase` by the recorded phase, zero outside [0, 1]: (...)."""
    within = (recorded >= 0.0) & (recorded <= 1.0)
    factor = relative**phase_deviation.duration_exponent
    return np.where(within, factor / (1.0 + (factor - 1.0) * np.clip(recorded, 0.0, 1.0)) ** 2, 0.0)


def reference_phase(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float = 1.0
) -> Floats:
    """Reference phases under all deviations, clipped to [0, 1]: (..., E).

    The arguments are those of `steady_phase`.
    """
    steady = steady_phase(phase_deviation, recorded, relative)
    if len(phase_deviation.grid) == 1:
        return steady[..., None]
    ahead = phase_deviation.scale(steady)[..., None] * phase_deviation.grid
    return np.minimum(np.maximum(steady[..., None] + ahead, 0.0), 1.0)


def _student(grid: Floats) -> Floats:
    """Prior probabilities of the deviations of a grid, (E,)."""
    weight = (1.0 + grid**2 / STUDENT_FREEDOM) ** (-0.5 * (STUDENT_FREEDOM + 1.0))
    return weight / weight.sum()


@lru_cache(maxsize=4)
def _modes(n_deviations: int) -> tuple[Floats, Floats]:
    """Modes of an Ornstein-Uhlenbeck process on a grid: decay rates (E,), flat matrices (E, E E).

    The rate from i to a neighbour j is sqrt(p_j / p_i): by detailed balance, the prior p is
    stationary. Decay rates are relative to that of the slowest mode that decays.
    """
    root = np.sqrt(_student(np.linspace(-DEVIATION_SPAN, DEVIATION_SPAN, n_deviations)))
    generator = np.eye(n_deviations, k=1) + np.eye(n_deviations, k=-1)
    generator -= np.diag(generator @ root / root)
    rate, vectors = np.linalg.eigh(generator)
    rate = np.maximum(-rate[::-1], 0.0)
    vectors = vectors[:, ::-1]
    modes = (vectors / root[:, None]).T[:, :, None] * (vectors.T * root)[:, None]
    return rate / rate[1], modes.reshape(n_deviations, -1)
