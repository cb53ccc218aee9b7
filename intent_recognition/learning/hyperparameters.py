# SPDX-License-Identifier: Apache-2.0
"""What held-out validation chooses (`learning.selection`)."""

from typing import NamedTuple

from intent_recognition.promp import OTHERS_SAMPLE_SIZE, TargetSettings

STRENGTH = 4.0
"""Equivalent sample size of the target of the shared covariance, in demonstrations
(docs/decisions/one_filter.md)."""
REGRESSION_STRENGTHS = (30.0, 100.0, 10.0, 3.0, 1.0)
"""The same for each task's own covariance, from which the controlled agent's regression comes; the
first where nothing can be left out (docs/decisions/covariance_target.md)."""
INDEPENDENT = (0.0, 0.01, 0.1, 0.3)
"""Independent parts of the observed weights' variance in it that are tried
(docs/decisions/covariance_target.md)."""
RIDGES = (1e-3, 1e-2, 1e-4)
"""Variances of an observed weight that are taken to be chance in ridge regression, in parts of the
square of its DOF's range; the last not where whole people are left out
(docs/decisions/covariance_target.md)."""
EXPONENTS = (0.2, 0.5, 1.0)
"""Exponents of the evidence of a duration that are tried, the default first
(docs/decisions/one_filter.md)."""
REGRESSION_VARIANCES = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Variances of a regression's coefficients that are tried, the default first
(docs/decisions/covariance_target.md)."""


class Hyperparameters(NamedTuple):
    """Hyperparameters and their score on demonstrations left out, lower wins."""

    pace: str = "own"  # one of `PACES`
    noise_scale: float = 4.0  # factor of the observed DOFs' noise variance
    # exponent of the evidence in the posterior of the duration
    duration_evidence: float = EXPONENTS[0]
    # equivalent sample size of the other tasks in the target of each task's own covariance, in
    # demonstrations
    borrowed: float = OTHERS_SAMPLE_SIZE
    # equivalent sample size of this target, in demonstrations
    strength: float = REGRESSION_STRENGTHS[0]
    # part of an observed weight's variance in it that no other weight shares
    independent: float = INDEPENDENT[0]
    lag: float = 0.0  # how much later in phase the controlled agent follows, in it
    ridge: float = 0.0  # as in `TargetSettings`
    regression_variance: float = 0.0  # of the coefficients of each task's regression
    task_evidence: float = 1.0  # exponent of the evidence of the tasks against each other
    log_loss: float = float("nan")  # of the task, mean over the movement, in nats
    # mean squared error of the controlled agent, each DOF in parts of its variance
    error: float = float("nan")
    score: float = float("nan")  # both together, in nats; NaN where nothing could be left out

    def target(self, n_observed: int) -> TargetSettings:
        """What the target of a task's own covariance assumes."""
        return TargetSettings(self.borrowed, self.independent, self.lag, n_observed, self.ridge)

    @property
    def aligned(self) -> bool:
        """Whether demonstrations are aligned before their weights are fitted."""
        return self.pace == "aligned"
