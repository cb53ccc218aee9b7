# SPDX-License-Identifier: Apache-2.0
"""The context: properties of the scene, such as the place of a box, that the weights depend on.

A context c (M,) is constant in time. It is jointly Gaussian with the weights w of a task,

    c ~ N(m, S),    w | c ~ N(mu + G (c - m), V),    w ~ N(mu, V + G S G^T),

of which a library holds the marginal of w. A known context, or a known part of it, conditions the
weights; an unknown one leaves them unchanged. G is estimated from nu demonstrations, so the weights
are less certain in a context far from those shown: the Student predictive given c has the
covariance of the Gaussian one times 1 + d^2 / nu, where d is the Mahalanobis distance of c.

A context is no evidence about the task: the demonstrator chose it, so p(c | task) tells how the
recordings were arranged, not how often a task is done in a scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import symmetrize, whiten_innovation

CONTEXT_STRENGTH = 0.1
"""Equivalent sample size, in demonstrations, of the prior on the gain. Under this prior, one
standard deviation of the context moves the weights by about three of their remaining ones."""


@dataclass(frozen=True)
class ContextModel:
    """Joint distribution of a context of M numbers with the weights of K tasks."""

    names: tuple[str, ...]  # names of the M numbers
    units: tuple[str, ...]  # units of the M numbers
    mean: Floats  # m, (K, M)
    covariance: Floats  # S, (K, M, M)
    gain: Floats  # G, (K, D N, M)
    freedom: Floats  # nu, (K,)
    groups: tuple[int, ...]  # number of DOFs of each context signal, in order; they sum to M

    @property
    def tolerance(self) -> Floats:
        """Largest changes of the context that are taken for noise, (M,)."""
        least = np.min(np.diagonal(self.covariance, axis1=1, axis2=2), axis=0)
        return 0.05 * np.sqrt(least)

    def given(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """Condition the weights on a context (M,), NaN for unknown numbers.

        Returns:
            Shift of the means (K, d), reduction of the covariances (K, d, d), and factor of the
            reduced covariances (K,).
        """
        known = np.flatnonzero(np.isfinite(values))
        cross = np.matmul(self.covariance[:, known], np.swapaxes(self.gain, 1, 2))
        cross, apart, _ = whiten_innovation(
            self.covariance[:, known[:, None], known],
            cross,
            values[known] - self.mean[:, known],
            name="covariance of context",
        )
        turned = np.swapaxes(cross, 1, 2)
        shift = np.matmul(turned, apart[..., None])[..., 0]
        scale = 1.0 + np.sum(apart**2, axis=1) / self.freedom
        return shift, symmetrize(np.matmul(turned, cross)), scale


def as_context(context: ArrayLike, names: Sequence[str]) -> Floats:
    """Checked values (M,) of a context, NaN for unknown numbers.

    Raises:
        ShapeError: `context` is not one number per name.
        ArgumentError: a number is infinite.
    """
    values = np.array(context, dtype=np.float64)
    if values.shape != (len(names),):
        expected = f"shape ({len(names)},): {', '.join(names) or 'no context was learned'}"
        cure = "Pass NaN for what is not known."
        raise ShapeError.about("context", expected, f"shape {values.shape}", cure)
    if np.any(np.isinf(values)):
        cure = "Pass NaN for what is not known."
        raise ArgumentError.about("context", "finite numbers or NaN", values, cure)
    return values
