# SPDX-License-Identifier: Apache-2.0
"""Logistic regression by iteratively reweighted least squares (Brandl et al. III-A)."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import expit

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError


@dataclass(frozen=True)
class LogisticModel:
    """Probability `1 / (1 + exp(-(bias + weights . (features - offset) / scale)))`."""

    bias: float  # log odds of the mean feature vector
    weights: Floats  # log odds (d,) per standard deviation of each feature
    offset: Floats  # mean (d,) of the features learned from
    scale: Floats  # their standard deviation (d,), 1 where it was 0

    def log_odds(self, features: Floats) -> Floats:
        """Log odds (n,) at features (n, d)."""
        return self.bias + (features - self.offset) @ (self.weights / self.scale)

    def probability(self, features: Floats) -> Floats:
        """Probability (n,) of label 1 at features (n, d)."""
        return expit(self.log_odds(features))


def fit_logistic(features: Floats, labels: Floats, ridge: float = 1e-2) -> LogisticModel:
    """Fit by Newton steps on the ridge-penalised likelihood, halved until it rises.

    Features are standardised first; the penalty is `ridge / 2 * |weights|^2` on the standardised
    weights and leaves the bias free. With a ridge above 0, separable labels have a finite answer.

    Args:
        features: (n, d), finite.
        labels: (n,), 0 or 1, or booleans.
        ridge: strength of the penalty, above 0.

    Raises:
        TrainingError: only one label is present, or no step count sufficed.
    """
    labels = np.asarray(labels, dtype=float)
    if not 0.0 < labels.sum() < len(labels):
        got = f"{np.count_nonzero(labels)} of {len(labels)} with label 1"
        raise TrainingError.about("labels", "both 0 and 1", got, "Add samples of the other.")
    offset, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 1e-12 * (1.0 + np.abs(offset)), scale, 1.0)
    design = np.column_stack([np.ones(len(features)), (features - offset) / scale])
    penalty = np.full(design.shape[1], ridge)
    penalty[0] = 0.0
    beta = np.zeros(design.shape[1])
    beta[0] = np.log(labels.sum() / (1.0 - labels).sum())

    def loss(candidate: Floats) -> float:
        odds = design @ candidate
        misfit = np.sum(np.logaddexp(0.0, odds) - labels * odds)
        return float(misfit + 0.5 * penalty @ candidate**2)

    current = loss(beta)
    most_steps = 100
    for _ in range(most_steps):
        probability = expit(design @ beta)
        gradient = design.T @ (probability - labels) + penalty * beta
        curvature = probability * (1.0 - probability)
        hessian = (design * curvature[:, None]).T @ design + np.diag(penalty)
        # Where every probability is 0 or 1 the bias has no curvature of its own.
        hessian[0, 0] += 1e-12 * len(labels)
        step = cho_solve(cho_factor(hessian), gradient)
        length = 1.0
        while loss(beta - length * step) > current + 1e-12 * abs(current) and length > 1e-8:
            length *= 0.5
        beta = beta - length * step
        current = loss(beta)
        if np.abs(length * step).max() < 1e-9 * (1.0 + np.abs(beta).max()):
            return LogisticModel(float(beta[0]), beta[1:], offset, scale)
    got = f"a step of {np.abs(step).max():.3g} after {most_steps}"
    cure = "Raise ridge."
    raise TrainingError.about("labels", "converging weights", got, cure)
