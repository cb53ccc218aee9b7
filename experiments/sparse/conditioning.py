# SPDX-License-Identifier: Apache-2.0
"""Conditioning on a few irregular positions: a ProMP directly, a DMP by way of a spline."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from experiments.sketches.curves import PHASE
from experiments.sketches.differentiation import SavitzkyGolay, spline_operators
from experiments.sketches.interaction_dmp import Motion, differentiated
from experiments.sketches.models import (
    BASIS,
    DMP,
    SHRINKAGES,
    STEP,
    Learned,
    folds,
    learn_dmp,
    learn_promp,
    predictor,
    prior,
)
from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, condition

NOISE_VARIANCE = 0.01
N_FOLDS = 5
CLOSEST = 0.03
"""Least phase between two observations."""
N_SPLINE = 41
"""Even phases at which a spline is differentiated."""
N_PHASE_SETS = 4
"""Sets of phases on which each fold of cross validation tries a spline."""
ROUGHNESSES = (0.0, 1e-5, 1e-4, 1e-3)
MISFITS = (10.0, 1e2, 1e3, 1e4, 1e5)
START_MISFITS = (0.01, 1e4)
"""Variances tried for the start; with the second, nothing is known of it."""
WIDE = SavitzkyGolay(0.16)
"""Filter of what stands for the true acceleration: wide enough for the pixels not to show."""


class SplineChoice(NamedTuple):
    """How sparse samples become accelerations, and how far these are trusted.

    Attributes:
        roughness: of the smoothing spline.
        misfit: variance assumed for the error of its drive, beside the noise.
        start_misfit: the same for the start, to which the spline is continued as a straight line.
        shrinkage: share of the diagonal in the covariance.
    """

    roughness: float
    misfit: float
    start_misfit: float
    shrinkage: float


def sparse_phases(rng: np.random.Generator, count: int) -> Floats:
    """Irregular phases, none closer than `CLOSEST` to the next, (count,)."""
    free = np.sort(rng.uniform(0.0, 1.0 - CLOSEST * (count - 1), count))
    return free + CLOSEST * np.arange(count)


def observe(
    rng: np.random.Generator, curve: Floats, at: Floats, variance: float = NOISE_VARIANCE
) -> Floats:
    """Noisy positions of a curve (T,) at some phases (m,)."""
    return np.interp(at, PHASE, curve) + np.sqrt(variance) * rng.normal(size=len(at))


def promp_curves(
    learned: Learned, shrinkage: float, at: Floats, seen: Floats, variance: float = NOISE_VARIANCE
) -> tuple[Floats, Floats]:
    """Mean and standard deviation of both agents' curves given positions seen, (2, T) each."""
    distribution = prior(learned.parameters, shrinkage)
    rows = learned.observed(BASIS.design_matrix(at))
    noise = (variance + learned.residual_variance) * np.eye(len(at))
    posterior, _ = condition(distribution, rows, seen, noise)
    return curves_of(learned, posterior)


def curves_of(learned: Learned, distribution: Gaussian) -> tuple[Floats, Floats]:
    """Mean and standard deviation of both agents' curves, (2, T) each."""
    variance = np.einsum("sd,de,se->s", learned.both, distribution.covariance, learned.both)
    mean = (learned.both @ distribution.mean).reshape(2, -1)
    return mean, np.sqrt(variance.reshape(2, -1) + learned.curve_variance[:, None])


def spline_predictor(learned: Learned, choice: SplineChoice, at: Floats) -> tuple[Floats, Floats]:
    """Matrix and offset from sparse positions to the controlled curve of a DMP."""
    dense = np.linspace(at[0], at[-1], N_SPLINE)
    motion = Motion(*spline_operators(at, dense, choice.roughness))
    start = motion.position[0] - at[0] * motion.velocity[0]
    operator = np.vstack([DMP.drive(motion), start])
    misfit = np.append(np.full(N_SPLINE, choice.misfit), choice.start_misfit)
    noise = NOISE_VARIANCE * np.sum(operator**2, axis=1) + misfit
    rows = np.vstack([DMP.observation_matrix(dense), DMP.start_matrix()[:1]])
    distribution = prior(learned.parameters, choice.shrinkage)
    matrix, offset = predictor(
        distribution, learned.observed(rows), np.diag(noise), learned.controlled
    )
    return matrix @ operator, offset


def choose_shrinkage(rng: np.random.Generator, train: Floats, counts: Sequence[int]) -> float:
    """The ProMP's, by cross validation over all numbers of observations."""
    errors = np.zeros(len(SHRINKAGES))
    for kept, left_out in folds(len(train), N_FOLDS):
        learned = learn_promp(train[kept])
        for count in counts:
            for pair in train[left_out]:
                at = sparse_phases(rng, count)
                seen = observe(rng, pair[:, 0], at)
                for number, shrinkage in enumerate(SHRINKAGES):
                    curves, _ = promp_curves(learned, shrinkage, at, seen)
                    errors[number] += np.sum((curves[1] - pair[:, 1]) ** 2)
    return SHRINKAGES[int(np.argmin(errors))]


def spline_choices(quick: bool) -> list[SplineChoice]:
    """Choices for cross validation; some of them lay the spline through the samples."""
    return [
        SplineChoice(roughness, misfit, start_misfit, shrinkage)
        for roughness in (ROUGHNESSES[::2] if quick else ROUGHNESSES)
        for misfit in (MISFITS[1::2] if quick else MISFITS)
        for start_misfit in START_MISFITS
        for shrinkage in SHRINKAGES[: 1 if quick else 2]
    ]


def choose_splines(
    rng: np.random.Generator, train: Floats, count: int, choices: Sequence[SplineChoice]
) -> tuple[SplineChoice, SplineChoice]:
    """The best spline through the samples, and the best of all, by cross validation."""
    errors = np.zeros(len(choices))
    for kept, left_out in folds(len(train), N_FOLDS):
        learned, held = learn_dmp(train[kept]), train[left_out]
        for _ in range(N_PHASE_SETS):
            at = sparse_phases(rng, count)
            seen = np.array([observe(rng, pair[:, 0], at) for pair in held])
            for number, choice in enumerate(choices):
                matrix, offset = spline_predictor(learned, choice, at)
                errors[number] += np.sum((seen @ matrix.T + offset - held[..., 1]) ** 2)
    through = [number for number, choice in enumerate(choices) if choice.roughness == 0.0]
    return choices[min(through, key=lambda k: errors[k])], choices[int(np.argmin(errors))]


def true_acceleration(curve: Floats, at: Floats) -> Floats:
    """Second derivative by the phase of a clean curve (T,) at some phases."""
    return np.interp(at, PHASE, differentiated(WIDE, curve[:, None], STEP).acceleration[:, 0])
