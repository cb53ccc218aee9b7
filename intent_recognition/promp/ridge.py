# SPDX-License-Identifier: Apache-2.0
"""Regression of the controlled weights on the observed ones, from demonstrations alone.

A target's regression holds within what its structure expects. A new person is far outside of what
was shown, and there a part of each slope that is the target's alone is an error of centimetres.
Ridge regression (Hoerl and Kennard 1970) of the controlled weights on the observed ones has

    A = S_co (S_oo + l R)^-1,

with S the covariance of the demonstrations, R the squares of the DOFs' ranges, and l the variance
of a weight that is taken to be chance, in parts of it. Directions in which people differ much keep
their slopes, whatever the target says; those of noise lose theirs.
"""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import symmetrize

MOST_SPENT = 0.8
"""Largest part of the demonstrations that slopes are said to take up. Convention: what they leave
unexplained is divided by the rest."""


def ridge_slopes(scatter: Floats, chance: Floats, demonstrations: float) -> tuple[Floats, float]:
    """Slopes A, (Q N, P N), and the part of the demonstrations that they take up.

    This part is the effective number of parameters tr(S_oo (S_oo + l R)^-1) over the number of
    demonstrations (Hastie et al. 2009, Eq. 3.50), `MOST_SPENT` at most.

    Args:
        scatter: covariance of all weights, observed first, (D N, D N).
        chance: variance of each observed weight that is chance, l R, (P N,).
        demonstrations: equivalent sample size of the covariance.
    """
    size = len(chance)
    known = scatter[:size, :size]
    found = np.linalg.solve(known + np.diag(chance), np.hstack([scatter[:size, size:], known]))
    width = len(scatter) - size
    spent = min(float(np.trace(found[:, width:])) / demonstrations, MOST_SPENT)
    return np.ascontiguousarray(found[:, :width].T), spent


def with_slopes(known: Floats, slopes: Floats, left: Floats) -> Floats:
    """Joint covariance (D N, D N) of observed weights and of those that follow them.

    Args:
        known: of the observed weights, (P N, P N).
        slopes: of the others on them, (Q N, P N).
        left: what they leave unexplained, (Q N, Q N).
    """
    cross = slopes @ known
    return symmetrize(np.block([[known, cross.T], [cross, left + cross @ slopes.T]]))
