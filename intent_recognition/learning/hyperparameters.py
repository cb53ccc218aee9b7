# SPDX-License-Identifier: Apache-2.0
"""Hyperparameters that held-out validation chooses (`learning.selection`)."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import OTHERS_SAMPLE_SIZE, TargetSettings

STRENGTH, STRONG = 4.0, 30.0
"""Equivalent sample sizes of the target of the shared covariance that are tried, in demonstrations,
the default first (docs/decisions/covariance_target.md)."""
REGRESSION_STRENGTHS = (30.0, 100.0, 10.0, 3.0, 1.0)
"""Equivalent sample sizes tried for the target of each task's own covariance, which gives the
controlled agent's regression; the first is the default (docs/decisions/covariance_target.md)."""
INDEPENDENT = (0.0, 0.01, 0.1, 0.3)
"""Independent shares of the observed weights' variance in this target that are tried
(docs/decisions/covariance_target.md)."""
RIDGES = (1e-3, 1e-2, 1e-4)
"""Noise variances of an observed weight that are tried in ridge regression, relative to the square
of its DOF's range; the last is not tried where whole people are left out
(docs/decisions/covariance_target.md)."""
EXPONENTS = (0.2, 0.5, 1.0)
"""Exponents of the evidence for a duration that are tried, the default first
(docs/decisions/one_filter.md)."""
REGRESSION_VARIANCES = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Variances of a regression's coefficients that are tried, the default first
(docs/decisions/covariance_target.md)."""


class Hyperparameters(NamedTuple):
    """Hyperparameters and their score on left-out demonstrations; lower is better."""

    pace: str = "own"  # one of `PACES`
    noise_scale: float = 4.0  # factor of the observed DOFs' noise variance
    # exponent of the evidence in the posterior of the duration
    duration_evidence: float = EXPONENTS[0]
    # equivalent sample size of the other tasks in the target of each task's own covariance, in
    # demonstrations
    borrowed: float = OTHERS_SAMPLE_SIZE
    # equivalent sample size of this target, in demonstrations
    strength: float = REGRESSION_STRENGTHS[0]
    # share of an observed weight's variance in this target that no other weight shares
    independent: float = INDEPENDENT[0]
    lag: float = 0.0  # lag of the controlled agent in this target, in phase
    ridge: float = 0.0  # as in `TargetSettings`
    shared_strength: float = STRENGTH  # equivalent sample size of the shared covariance's target
    regression_variance: float = 0.0  # relative variance of each task's regression coefficients
    task_evidence: float = 1.0  # exponent of the evidence that compares tasks
    log_loss: float = float("nan")  # log loss of the task, mean over the movement, in nats
    # mean squared error of the controlled agent, each DOF relative to its variance
    error: float = float("nan")
    score: float = float("nan")  # combines both, in nats; NaN if nothing could be left out

    def target(self, n_observed: int) -> TargetSettings:
        """Settings of the target of a task's own covariance."""
        return TargetSettings(self.borrowed, self.independent, self.lag, n_observed, self.ridge)

    @property
    def aligned(self) -> bool:
        """Whether demonstrations are aligned before their weights are fitted."""
        return self.pace == "aligned"


def is_clear(gained: Floats, errors: float = 1.0) -> bool:
    """Whether a gain over n demonstrations (n,) is larger than so many standard errors."""
    return bool(gained.mean() > errors * gained.std() / np.sqrt(len(gained)))


def clearly_best(losses: Floats) -> int:
    """Index of the candidate with the least losses (c, n); 0 unless it is clearly better."""
    best = int(np.argmin(losses.mean(axis=1)))
    return best if is_clear(losses[0] - losses[best]) else 0
