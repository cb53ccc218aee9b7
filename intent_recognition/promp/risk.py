# SPDX-License-Identifier: Apache-2.0
"""How sure one must be of a task, so that a stated share of interactions is acted on wrongly.

Split conformal prediction (Vovk et al. 2005). Each demonstration is followed with a library that
does not know it. Its score is the largest log odds of the other tasks against its own, at any
moment. Of a new interaction of the same population the odds against its task exceed the quantile
of these scores with at most the stated probability, at any moment; so whoever waits until the odds
for a task exceed that quantile acts wrongly at most as often.

Interactions of one person are alike. Where demonstrations have groups, the bound is therefore one
for an interaction of a new group: each group counts once, however many demonstrations it has
(hierarchical conformal prediction, Lee, Barber and Willett 2023).
"""

from typing import NamedTuple

import numpy as np
from scipy.special import expit, ndtri

from intent_recognition.array_types import Floats


class LeftOutOdds(NamedTuple):
    """What demonstrations that were left out say about the risk of acting.

    Attributes:
        odds: largest log odds of the other tasks against the true one along each, (n,).
        groups: whose demonstration each is, such as a pair of people; "" for nobody's, (n,).
    """

    odds: tuple[float, ...] = ()
    groups: tuple[str, ...] = ()

    def weights(self) -> Floats:
        """What each counts for, (n,): a group as much as a demonstration of nobody's.

        They sum to the share of all groups that is known, G / (G + 1).
        """
        names = [group or f" {k}" for k, group in enumerate(self.groups)]
        _, place, counts = np.unique(names, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / ((len(counts) + 1.0) * counts[place]), dtype=np.float64)

    @property
    def n_groups(self) -> int:
        """G: groups, and demonstrations of nobody's."""
        return len({group or f" {k}" for k, group in enumerate(self.groups)})


NO_ODDS = LeftOutOdds()
"""Nothing was left out."""


class Risk(NamedTuple):
    """When to act, and how often that is wrong."""

    threshold: float  # probability that a task must have among the tasks
    max_wrong: float  # the share of interactions that was asked for
    # largest share that is acted on wrongly, of interactions with new people where people are
    # known, else of those like the recorded ones
    bound: float
    n_groups: int  # people, or demonstrations where these have no groups, that the bound rests on
    grouped: bool  # whether these are people

    @property
    def n_needed(self) -> int:
        """How many it takes for the bound that was asked for."""
        return int(np.ceil(1.0 / self.max_wrong - 1e-9)) - 1

    def __str__(self) -> str:
        who = "groups of demonstrations" if self.grouped else "demonstrations"
        whose = "with new people" if self.grouped else "like those recorded"
        text = (
            f"acts from a probability of {self.threshold:.3f} among the tasks: of interactions"
            f" {whose} at most {self.bound:.0%} are acted on wrongly, by {self.n_groups} {who}"
        )
        if self.n_groups >= self.n_needed:
            return text
        return f"{text}; max_wrong {self.max_wrong:g} takes {self.n_needed} {who}: record more"


def risk_of(left_out: LeftOutOdds, max_wrong: float) -> Risk:
    """When to act, so that at most a share of interactions is acted on wrongly.

    Fewer groups than that takes bound the share by 1 / (G + 1); the threshold is extrapolated by a
    normal distribution then.

    Args:
        left_out: two demonstrations or more.
        max_wrong: the share, in (0, 0.5].
    """
    odds, weights = np.array(left_out.odds), left_out.weights()
    n_groups = left_out.n_groups
    quantile = conformal_bound(odds, max_wrong, weights)
    bound = max(max_wrong, 1.0 / (n_groups + 1.0))
    threshold = max(float(expit(quantile)), 0.6)
    grouped = any(left_out.groups)
    return Risk(min(threshold, 1.0), max_wrong, bound, n_groups, grouped)


def conformal_bound(values: Floats, accepted: float, weights: Floats | None = None) -> float:
    """What one more value of the same kind exceeds with at most a probability.

    Whatever the distribution (Vovk et al. 2005). Fewer values than that takes are extrapolated by
    a normal distribution.

    Args:
        values: (n,), two or more.
        accepted: the probability, in (0, 1).
        weights: probability that one more is like each of them, (n,); they sum to less than one.
            None for 1 / (n + 1) each.
    """
    n = len(values)
    share = np.full(n, 1.0 / (n + 1.0)) if weights is None else weights
    order = np.argsort(values)
    rank = int(np.searchsorted(np.cumsum(share[order]), 1.0 - accepted - 1e-12))
    if rank < n:
        return float(values[order[rank]])
    own = share / share.sum()
    mean = float(own @ values)
    variance = float(own @ (values - mean) ** 2) / max(1.0 - float(own @ own), 1e-12)
    return max(mean + float(ndtri(1.0 - accepted)) * variance**0.5, float(values.max()))
