# SPDX-License-Identifier: Apache-2.0
"""How much the evidence of the tasks against each other counts, by held-out validation.

The innovations of one movement are correlated where the model does not fit a person, so that their
product counts evidence several times: n of them are worth as much as a share of n independent
ones. Evidence to the power a, the share, is what is believed of the task; a is uniform on (0, 1]
beforehand. A left-out demonstration has the log loss of its own task as its log likelihood, mean
over the movement: its moments are not independent, either. The expected share is taken, since a
few demonstrations that are all recognised tell little of it.
"""

import numpy as np

from intent_recognition.array_types import Floats, Integers

POWERS = np.linspace(0.1, 1.0, 10)
"""Shares that are tried, evenly spaced, all of the evidence last. Convention."""


def log_losses(log_evidence: Floats, own: Integers) -> Floats:
    """Log loss of each demonstration's own task under each of the powers, (A, n).

    Args:
        log_evidence: of the tasks that each demonstration is compared with, one demonstration
            after the other, (h,).
        own: places of the own tasks, each the first of its demonstration, (n,).
    """
    counted = POWERS[:, None] * log_evidence
    return np.asarray(np.logaddexp.reduceat(counted, own, axis=1) - counted[:, own])


def expected_power(losses: Floats) -> float:
    """Posterior mean of the power.

    Args:
        losses: log loss of left-out demonstrations under each of the powers, (A, n).
    """
    log_likelihood = -losses.sum(axis=1)
    weight = np.exp(log_likelihood - log_likelihood.max())
    return float(weight @ POWERS / weight.sum())
