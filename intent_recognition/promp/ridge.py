# SPDX-License-Identifier: Apache-2.0
"""Ridge regression of the controlled weights on the observed ones, from demonstrations alone.

The slopes of a shrunk covariance are partly those of its target. A new person may move far from
what was shown, and there the target's part of a slope is an error of centimetres. Ridge regression
(Hoerl and Kennard 1970) of the controlled weights on the observed ones has the slopes

    A = S_co (S_oo + l R)^-1,

with S the covariance of the demonstrations, R the squared ranges of the DOFs, and l the random
variance of a weight relative to R. Slopes along directions in which people differ much are kept,
whatever the target; slopes along directions of noise vanish.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import symmetrize

MOST_SPENT = 0.8
"""Largest share of the demonstrations that counts as spent on slopes. Scatter of residuals is
divided by the rest, which must not vanish."""


def ridge_slopes(scatter: Floats, chance: Floats, demonstrations: float) -> tuple[Floats, float]:
    """Slopes A, (Q N, P N), and the share of the demonstrations that is spent on them.

    This share is the effective number of parameters tr(S_oo (S_oo + l R)^-1) over the number of
    demonstrations (Hastie et al. 2009, Eq. 3.50), at most `MOST_SPENT`.

    Args:
        scatter: covariance of all weights, observed first, (D N, D N).
        chance: random variance of each observed weight, l R, (P N,).
        demonstrations: equivalent sample size of the covariance.
    """
    size = len(chance)
    known = scatter[:size, :size]
    found = np.linalg.solve(known + np.diag(chance), np.hstack([scatter[:size, size:], known]))
    width = len(scatter) - size
    spent = min(float(np.trace(found[:, width:])) / demonstrations, MOST_SPENT)
    return np.ascontiguousarray(found[:, :width].T), spent


def with_slopes(known: Floats, slopes: Floats, left: Floats) -> Floats:
    """Joint covariance of observed and controlled weights with given slopes, (D N, D N).

    Args:
        known: covariance of the observed weights, (P N, P N).
        slopes: slopes of the controlled on the observed weights, (Q N, P N).
        left: covariance of the regression's residuals, (Q N, Q N).
    """
    cross = slopes @ known
    return symmetrize(np.block([[known, cross.T], [cross, left + cross @ slopes.T]]))
