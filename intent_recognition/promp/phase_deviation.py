# SPDX-License-Identifier: Apache-2.0
"""The phase deviation: how far a person is ahead of, or behind, steady progress.

At a recorded phase u, the share of the movement's duration that has passed, a person has reached
the reference phase u + s(u) e. The phase deviation e is a stationary Ornstein-Uhlenbeck process of
unit scale along u, so that hesitations and hurries pass again. Its stationary distribution is
Student's, because a few demonstrations show few of the long ones. The scale s(u) is learned from
the warps that align the demonstrations (`learning.timing`). The deviation is filtered on a grid,
beside the Gaussian over the weights.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from intent_recognition.array_types import Floats, read_only

N_DEVIATIONS, DEVIATION_SPAN = 15, 3.5
"""Values of the phase deviation on its grid, and the reach of that to either side, in scales
(docs/decisions/one_filter.md)."""
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the Student distributions of the phase deviation, of the log duration, as
new people are often slower or faster than any demonstration, and of evidence
(docs/decisions/one_filter.md)."""


@dataclass(frozen=True)
class PhaseDeviation:
    """Prior of a person's phase deviation.

    Attributes:
        deviation_std: scale at even recorded phases from 0 to 1, (U,); with zeros, progress is
            steady and there is a single deviation.
        correlation: recorded phase after which the autocorrelation has fallen to 1/e.
        evidence: exponent of an observation's likelihood in the posterior of the deviation;
            residuals last along a movement, so that its samples are not independent.
        controlled_follows: whether the controlled agent deviates with the observed one; if not, it
            keeps steady progress.
        duration_exponent: of the relative duration in the odds of the phase (`steady_phase`).
    """

    deviation_std: Floats
    correlation: float
    evidence: float
    controlled_follows: bool = True
    duration_exponent: float = 0.0

    @cached_property
    def grid(self) -> Floats:
        """Values of the phase deviation in its scales, (E,)."""
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
    """Probability of each phase deviation before anything is seen, (E,)."""
    return _student(phase_deviation.grid)


def deviation_transition(phase_deviation: PhaseDeviation, passed: Floats) -> Floats:
    """Transition of the phase deviation while recorded phase passes, (..., E, E), rows sum to one.

    It keeps the prior, and two transitions one after the other equal that of their sum, however
    short they are, so that it does not matter how often one looks.

    Args:
        phase_deviation: prior of the phase deviation.
        passed: recorded phase, (...); less than zero counts as zero.
    """
    grid = phase_deviation.grid
    if len(grid) == 1:
        return np.ones((*np.shape(passed), 1, 1))
    decay, modes = _modes(len(grid))
    share = np.maximum(passed, 0.0) / phase_deviation.correlation
    kernel = np.exp(-share[..., None] * decay) @ modes
    kernel = kernel.reshape(*share.shape, len(grid), len(grid))
    np.maximum(kernel, 0.0, out=kernel)
    kernel += 1e-12 * _student(grid)  # so that none is ruled out
    kernel /= kernel.sum(axis=-1, keepdims=True)
    return kernel


def steady_phase(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float
) -> Floats:
    """Reference phases without a deviation, in [0, 1]: (...).

    People who take longer do not do everything more slowly. The odds z / (1 - z) of the reference
    phase are those of the recorded one times a power of the relative duration: with an exponent of
    1 a movement begins at the same speed however long it takes, with -1 it ends so.

    Args:
        phase_deviation: with the exponent.
        recorded: recorded phases, (...); clipped to [0, 1].
        relative: duration in parts of what the task usually takes, of a shape that goes with them.
    """
    recorded = np.minimum(np.maximum(recorded, 0.0), 1.0)
    if not phase_deviation.duration_exponent:
        return recorded
    ahead = recorded * relative**phase_deviation.duration_exponent
    return np.asarray(ahead / (1.0 - recorded + ahead))


def steady_rate(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float
) -> Floats:
    """Derivative of `steady_phase` by the recorded phase, zero beyond [0, 1]: (...)."""
    within = (recorded >= 0.0) & (recorded <= 1.0)
    factor = relative**phase_deviation.duration_exponent
    return np.where(within, factor / (1.0 + (factor - 1.0) * np.clip(recorded, 0.0, 1.0)) ** 2, 0.0)


def reference_phase(
    phase_deviation: PhaseDeviation, recorded: Floats, relative: Floats | float = 1.0
) -> Floats:
    """Reference phases of all deviations, clipped to [0, 1]: (..., E).

    The arguments are those of `steady_phase`.
    """
    steady = steady_phase(phase_deviation, recorded, relative)
    if len(phase_deviation.grid) == 1:
        return steady[..., None]
    ahead = phase_deviation.scale(steady)[..., None] * phase_deviation.grid
    return np.minimum(np.maximum(steady[..., None] + ahead, 0.0), 1.0)


def _student(grid: Floats) -> Floats:
    """Probabilities of deviations under their prior, (E,)."""
    weight = (1.0 + grid**2 / STUDENT_FREEDOM) ** (-0.5 * (STUDENT_FREEDOM + 1.0))
    return weight / weight.sum()


@lru_cache(maxsize=4)
def _modes(n_deviations: int) -> tuple[Floats, Floats]:
    """Modes of an Ornstein-Uhlenbeck process on a grid: decay (E,), transitions flat (E, E E).

    Neighbours i and j change places at a rate of sqrt(p_j / p_i), which keeps the prior p by
    detailed balance; rates are relative to that of the slowest mode, the process's own.
    """
    root = np.sqrt(_student(np.linspace(-DEVIATION_SPAN, DEVIATION_SPAN, n_deviations)))
    generator = np.eye(n_deviations, k=1) + np.eye(n_deviations, k=-1)
    generator -= np.diag(generator @ root / root)
    rate, vectors = np.linalg.eigh(generator)
    rate = np.maximum(-rate[::-1], 0.0)
    vectors = vectors[:, ::-1]
    modes = (vectors / root[:, None]).T[:, :, None] * (vectors.T * root)[:, None]
    return rate / rate[1], modes.reshape(n_deviations, -1)
