# SPDX-License-Identifier: Apache-2.0
"""ProMP and DMP of pairs of sketches: two linear Gaussian models that share all but what they see.

A ProMP observes positions; an Interaction DMP observes what twice differentiated positions say of
its forcing function. Both have the same basis, the same kind of shrinkage of the covariance, and
every free choice of either is made by cross validation on the training demonstrations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, cho_solve

from experiments.sketches.curves import PHASE
from experiments.sketches.differentiation import (
    Butterworth,
    SavitzkyGolay,
    Smoother,
    derivative_operators,
)
from experiments.sketches.interaction_dmp import (
    DmpModel,
    Motion,
    differentiated,
    fit_demonstrations,
)
from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, cholesky, symmetrize
from intent_recognition.promp import NormalizedRBFBasis, fit_weights

BASIS = NormalizedRBFBasis(20)
DMP = DmpModel(BASIS)
STEP = float(PHASE[1])
CLEAN = SavitzkyGolay(0.1)
"""Filter of demonstrations, which hold no noise but their pixels'."""
START_VARIANCE = 1e-5
"""Variance of a filtered start and its velocity, beside the noise."""
FLOOR = 1e-6
"""Variance added to each of d parameters, as a share of their mean variance over d."""

SHRINKAGES = (0.003, 0.03, 0.1)
"""Shares of the diagonal in the covariance that are tried."""
VARIANCES = (1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 1.0)
"""Noise variances of the observed positions that are tried, on curves that span 2 units."""
SMOOTHERS: tuple[Smoother, ...] = (
    *(SavitzkyGolay(width) for width in (0.1, 0.16, 0.25, 0.4, 0.6, 0.9)),
    *(Butterworth(cutoff) for cutoff in (1.5, 2.5, 4.0, 6.5, 10.0)),
)


@dataclass(frozen=True)
class Learned:
    """Parameters of the demonstrated pairs and what takes them to curves.

    Attributes:
        parameters: of both agents, the observed one's first, (n, 2 p).
        positions: rows from one agent's parameters to its positions at `PHASE`, (T, p).
        residual_variance: of the observed agent's positions (ProMP) or drives (DMP).
        curve_variance: what the parameters leave unexplained of both agents' positions, (2,).
    """

    parameters: Floats
    positions: Floats
    residual_variance: float
    curve_variance: Floats

    @property
    def both(self) -> Floats:
        """Rows from all parameters to both agents' positions, (2 T, 2 p)."""
        return block_diag(self.positions, self.positions)

    @property
    def controlled(self) -> Floats:
        """Rows from all parameters to the controlled agent's positions, (T, 2 p)."""
        return np.hstack([np.zeros_like(self.positions), self.positions])

    def observed(self, rows: Floats) -> Floats:
        """Rows (m, p) for the observed agent's parameters as rows for all, (m, 2 p)."""
        return np.hstack([rows, np.zeros_like(rows)])


class ModelChoice(NamedTuple):
    """One way to learn and to observe.

    Attributes:
        shrinkage: share of the diagonal in the covariance.
        variance: noise variance assumed for the observed positions.
        smoother: filter of what is observed (DMP); None for a ProMP, which needs none.
        white: whether a drive's noise is independent from sample to sample, with the variance the
            filter gives it (as in IP Eq. 6); otherwise it has the filter's covariance.
    """

    shrinkage: float
    variance: float
    smoother: Smoother | None = None
    white: bool = True


def learn(pairs: Floats, smoother: Smoother | None) -> Learned:
    """A DMP through a filter, or a ProMP where there is none."""
    return learn_promp(pairs) if smoother is None else learn_dmp(pairs, smoother)


def learn_promp(pairs: Floats) -> Learned:
    """Weights of pairs (n, T, 2)."""
    design = BASIS.design_matrix(PHASE)
    fits = [fit_weights(BASIS, PHASE, pair) for pair in pairs]
    residual = np.mean([fit.residual_variance for fit in fits], axis=0)
    weights = np.array([fit.weights.ravel() for fit in fits])
    return Learned(weights, design, float(residual[0]), residual)


def learn_dmp(pairs: Floats, smoother: Smoother = CLEAN) -> Learned:
    """Parameters of pairs (n, T, 2).

    The observed agent's curves pass the same filter as its observations, so that what the filter
    takes away is taken from both.
    """
    observed = fit_demonstrations(DMP, list(pairs[:, :, :1]), smoother)
    parameters = np.hstack([observed, fit_demonstrations(DMP, list(pairs[:, :, 1:]), CLEAN)])
    rows = DMP.observation_matrix(PHASE)
    drives = np.array(
        [DMP.drive(differentiated(smoother, pair[:, :1], STEP))[:, 0] for pair in pairs]
    )
    curves = np.stack(np.split(parameters, 2, axis=1), axis=1) @ DMP.rollout_matrix(PHASE).T
    error = curves - np.swapaxes(pairs, 1, 2)
    return Learned(
        parameters,
        DMP.rollout_matrix(PHASE),
        float(np.mean((drives - observed @ rows.T) ** 2)),
        np.mean(error**2, axis=(0, 2)),
    )


def prior(parameters: Floats, shrinkage: float) -> Gaussian:
    """Mean and covariance of parameters (n, d), shrunk toward the covariance's diagonal.

    The last factor adds the uncertainty of the mean of n demonstrations.
    """
    covariance = np.cov(parameters, rowvar=False)
    variance = np.diag(covariance)
    covariance = (1.0 - shrinkage) * covariance + shrinkage * np.diag(variance)
    covariance[np.diag_indices(len(variance))] += FLOOR * variance.mean() / len(variance)
    return Gaussian(parameters.mean(axis=0), covariance * (1.0 + 1.0 / len(parameters)))


def predictor(
    distribution: Gaussian, rows: Floats, noise: Floats, output: Floats
) -> tuple[Floats, Floats]:
    """Matrix (s, m) and offset (s,) from an observation to the mean of what is predicted.

    What `gaussian.normal.condition` does, for all observations with the same rows at once.

    Args:
        distribution: of the parameters, (d,).
        rows: of the observations, (m, d).
        noise: their covariance, (m, m).
        output: rows of what is predicted, (s, d).
    """
    cross = distribution.covariance @ rows.T
    factor = cholesky(symmetrize(rows @ cross) + noise, name="innovation covariance")
    matrix = output @ cho_solve((factor, True), cross.T).T
    return matrix, (output - matrix @ rows) @ distribution.mean


def observation(
    learned: Learned, candidate: ModelChoice, n_seen: int
) -> tuple[Floats, Floats, Floats]:
    """Rows, noise, and operator from positions to what is observed, of the first samples.

    A ProMP observes the m positions; a DMP the m drives, and position and velocity at the start.

    Args:
        learned: through the candidate's filter.
        candidate: what to assume.
        n_seen: samples of the observed agent, m.

    Returns:
        Rows (o, 2 p), noise (o, o) and operator (o, m), with o = m or m + 2.
    """
    operator, rows = np.eye(n_seen), learned.positions[:n_seen]
    residual = np.full(n_seen, learned.residual_variance)
    if candidate.smoother is not None:
        filtered = derivative_operators(candidate.smoother, n_seen, STEP)
        operator = np.vstack([DMP.drive(Motion(*filtered)), filtered[:2, 0]])
        rows = np.vstack([DMP.observation_matrix(PHASE[:n_seen]), DMP.start_matrix()])
        residual = np.append(residual, [START_VARIANCE] * 2)
    noise = candidate.variance * (operator @ operator.T)
    if candidate.white:
        noise = np.diag(np.diag(noise))
    return learned.observed(rows), noise + np.diag(residual), operator


def squared_errors(
    train: Floats,
    truth: Floats,
    seen: Floats,
    candidates: Sequence[ModelChoice],
    counts: Sequence[int],
) -> Floats:
    """Mean squared error of the controlled curve, for c candidates, L noise levels, k counts.

    Args:
        train: pairs to learn from, (n, T, 2).
        truth: controlled curves of others, (t, T).
        seen: their observed curves, at L levels of noise, (L, t, T).
        candidates: what to try.
        counts: how many of the first samples are seen.

    Returns:
        (c, L, k).
    """
    learned: dict[Smoother | None, Learned] = {}
    errors = np.empty((len(candidates), len(seen), len(counts)))
    for row, candidate in enumerate(candidates):
        if candidate.smoother not in learned:
            learned[candidate.smoother] = learn(train, candidate.smoother)
        model = learned[candidate.smoother]
        distribution = prior(model.parameters, candidate.shrinkage)
        for column, n_seen in enumerate(counts):
            rows, noise, operator = observation(model, candidate, n_seen)
            matrix, offset = predictor(distribution, rows, noise, model.controlled)
            predicted = seen[..., :n_seen] @ (matrix @ operator).T + offset
            errors[row, :, column] = np.mean((predicted - truth) ** 2, axis=(1, 2))
    return errors


def standard_error(values: Floats) -> Floats:
    """Standard error of the mean over the first axis."""
    error: Floats = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return error


def folds(n: int, n_folds: int) -> Iterator[tuple[Floats, Floats]]:
    """Numbers of the demonstrations to learn from, and of those left out, fold by fold."""
    numbers = np.arange(n)
    for fold in range(n_folds):
        left_out = numbers % n_folds == fold
        yield numbers[~left_out], numbers[left_out]
