# SPDX-License-Identifier: Apache-2.0
"""Coupling of the two agents' residuals (positions less the primitives), local in time.

The residuals of the observed and the controlled agent, r_o and r_c, are jointly Gaussian and
stationary, with the covariance B exp(-|t - t'| / tau) between two times (a separable
Ornstein-Uhlenbeck process). The observed residual is known at the measurements. The controlled one
follows by the regression

    E[r_c(t)] = G E[r_o(t)],    G = B_co B_oo^-1,

where E[r_o(t)] interpolates the observed residuals between measurements and decays after the last.
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats


class ResidualCoupling(NamedTuple):
    """Regression of the controlled agent's residual on the observed agent's, for each task.

    Attributes:
        gain: coefficients of the regression, G, (K, Q, P); zero where held-out demonstrations do
            not support one.
        explained: share of the controlled agent's variance that the regression explains at a
            measurement, (K, Q), in [0, 1).
        decay_s: time after which the residuals' correlation has fallen to 1/e [s], (K,).
    """

    gain: Floats
    explained: Floats
    decay_s: Floats

    @classmethod
    def none(cls, n_tasks: int, n_controlled: int, n_observed: int) -> "ResidualCoupling":
        """No coupling in any task."""
        gain = np.zeros((n_tasks, n_controlled, n_observed))
        return cls(gain, np.zeros((n_tasks, n_controlled)), np.ones(n_tasks))


def residual_weights(seen_s: Floats, times_s: Floats, decay_s: float) -> tuple[Floats, Floats]:
    """Weights of the measured residuals in the expected residual at other times.

    They give the conditional mean of an Ornstein-Uhlenbeck process. It is Markov, so only the last
    measurement before a time and the first one after it have weight.

    Args:
        seen_s: ascending times of the n measurements, at least one.
        times_s: times of the expected residual, (T,).
        decay_s: time after which the correlation has fallen to 1/e.

    Returns:
        Weights (T, n), and the share of the residual's variance that is known, (T,).
    """
    n, rows = len(seen_s), np.arange(len(times_s))
    after = np.searchsorted(seen_s, times_s)
    before = np.maximum(after - 1, 0)
    has_before, has_after = after > 0, after < n
    after = np.minimum(after, n - 1)
    past = np.where(has_before, np.exp(-np.abs(times_s - seen_s[before]) / decay_s), 0.0)
    future = np.where(has_after, np.exp(-np.abs(seen_s[after] - times_s) / decay_s), 0.0)
    both = np.maximum(1.0 - (past * future) ** 2, 1e-12)
    of_before, of_after = past * (1.0 - future**2) / both, future * (1.0 - past**2) / both
    weights = np.zeros((len(times_s), n))
    weights[rows, before] += of_before
    weights[rows, after] += of_after
    return weights, np.clip(of_before * past + of_after * future, 0.0, 1.0)
