# SPDX-License-Identifier: Apache-2.0
"""What is known of the scene, such as where a box stands, jointly Gaussian with the weights.

A context c (M,) is constant in time. With the weights w of a task it has the joint distribution

    c ~ N(m, S),    w | c ~ N(mu + G (c - m), V),    w ~ N(mu, V + G S G^T),

of which a library holds the marginal of w. Knowing c, or a part of it, conditions the weights; not
knowing it leaves them as they are. G comes from nu demonstrations, so that the weights are less
certain in a context far from those shown: the conditional of their Student predictive has the
covariance of the Gaussian one times 1 + d^2 / nu, with d the Mahalanobis distance of the context.

A context says nothing about the task by itself: it is what the demonstrator set up, and p(c | task)
is how the recordings were arranged, not how often a task is done in a scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import cholesky, solve_lower, symmetrize

CONTEXT_STRENGTH = 0.1
"""Equivalent sample size, in demonstrations, of the prior that the weights do not depend on the
context: one standard deviation of it moves them by about three of what it leaves. Convention."""


class Given(NamedTuple):
    """How known contexts change the weights of K tasks."""

    shift: Floats  # of the means, (K, d)
    reduction: Floats  # of the covariances, (K, d, d)
    scale: Floats  # factor of what remains of the covariances, (K,)


@dataclass(frozen=True)
class ContextModel:
    """Context of K tasks, M numbers."""

    names: tuple[str, ...]  # of the M numbers
    units: tuple[str, ...]
    mean: Floats  # m, (K, M)
    covariance: Floats  # S, (K, M, M)
    gain: Floats  # G, (K, D N, M)
    freedom: Floats  # nu, (K,)
    groups: tuple[int, ...]  # number of DOFs of each context signal, in order; they sum to M

    @property
    def tolerance(self) -> Floats:
        """Changes of the context that make no difference, (M,)."""
        least = np.min(np.diagonal(self.covariance, axis1=1, axis2=2), axis=0)
        return 0.05 * np.sqrt(least)

    def given(self, values: Floats) -> Given:
        """Condition the weights on a context (M,); NaN for what is not known."""
        known = np.flatnonzero(np.isfinite(values))
        factor = cholesky(self.covariance[:, known[:, None], known], name="covariance of context")
        cross = np.matmul(self.gain, self.covariance[:, :, known])
        whitened = solve_lower(factor, np.swapaxes(cross, 1, 2))
        apart = solve_lower(factor, (values[known] - self.mean[:, known])[..., None])
        distance = np.sum(apart[..., 0] ** 2, axis=-1)
        return Given(
            np.matmul(np.swapaxes(whitened, 1, 2), apart)[..., 0],
            symmetrize(np.matmul(np.swapaxes(whitened, 1, 2), whitened)),
            1.0 + distance / self.freedom,
        )


def as_context(context: ArrayLike, names: Sequence[str]) -> Floats:
    """The values (M,) of a context; NaN for what is not known.

    Raises:
        ShapeError: it is not one number for each of the names.
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
