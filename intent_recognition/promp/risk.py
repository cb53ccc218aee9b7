# SPDX-License-Identifier: Apache-2.0
"""Probability of a task at which the robot may act, so that the share of wrong actions is bounded.

This is split conformal prediction (Vovk et al. 2005). Each demonstration is filtered with a library
learned without it. Its score is the largest log odds of the other tasks against its own while
`none` permits acting. In a new interaction of the same population, the probability that the odds
against its task then exceed the quantile of these scores is at most the stated one. A robot that
waits until the odds for a task exceed that quantile therefore acts wrongly at most as often.

Interactions of one person are alike. If demonstrations have groups, the bound is therefore for an
interaction of a new group, and each group counts once, however many demonstrations it has
(hierarchical conformal prediction, Lee, Barber and Willett 2023).
"""

from typing import NamedTuple

import numpy as np
from scipy.special import expit, ndtri

from intent_recognition.array_types import Floats

MAX_NONE = 0.1
"""Largest probability of none at which to act, with a risk: what the usual threshold leaves."""

LEAST_SHARE = 0.6
"""Least probability among the tasks, and least share of the evidence, at which to act. Where no
left-out demonstration has odds against it, its bound asks for even odds only, at which habits
decide (docs/decisions/habit.md)."""

UNNAMED = "unnamed person "
"""What names of groups begin with that no recording names (`learning/unnamed_people.py`)."""


class LeftOutOdds(NamedTuple):
    """Odds of n held-out demonstrations, from which the risk of acting is bounded.

    Attributes:
        odds: largest log odds of the other tasks against the true one while the robot may act in
            each, or zero if they are never positive, (n,).
        groups: group of each demonstration, such as a pair of people; "" for none, (n,).
    """

    odds: tuple[float, ...] = ()
    groups: tuple[str, ...] = ()

    def weights(self) -> Floats:
        """Weights of the demonstrations, (n,): each group, or one without a group, 1 / (G + 1).

        They sum to G / (G + 1).
        """
        names = [group or f" {k}" for k, group in enumerate(self.groups)]
        _, place, counts = np.unique(names, return_inverse=True, return_counts=True)
        return np.asarray(1.0 / ((len(counts) + 1.0) * counts[place]), dtype=np.float64)

    @property
    def n_groups(self) -> int:
        """Number G of groups, each demonstration without a group counting as one."""
        return len({group or f" {k}" for k, group in enumerate(self.groups)})


NO_ODDS = LeftOutOdds()
"""Odds of no demonstrations."""


class Risk(NamedTuple):
    """Threshold at which to act, and the bound on wrong actions that it gives."""

    threshold: float  # probability that a task must have among the known tasks
    max_wrong: float  # requested share of interactions with a wrong action
    # bound on the share of interactions with a wrong action: of interactions with new groups of
    # people if demonstrations have groups, else of interactions like the recorded ones
    bound: float
    n_groups: int  # number of groups, or of demonstrations without a group, behind the bound
    grouped: bool  # whether any demonstration has a group
    told_apart: bool  # whether the groups are people whom no recording names

    @property
    def n_needed(self) -> int:
        """Number of groups needed for the requested bound."""
        return int(np.ceil(1.0 / self.max_wrong - 1e-9)) - 1

    def __str__(self) -> str:
        who = "groups of demonstrations" if self.grouped else "demonstrations"
        whose = "with new people" if self.grouped else "like those recorded"
        text = (
            f"acts from a probability of {self.threshold:.3f} among the tasks: at most"
            f" {self.bound:.0%} of interactions {whose} are acted on wrongly, judging by"
            f" {self.n_groups} {who}{' told apart by their movements' if self.told_apart else ''}"
        )
        if self.n_groups >= self.n_needed:
            return text
        return f"{text}; max_wrong {self.max_wrong:g} takes {self.n_needed} {who}: record more"


def risk_of(left_out: LeftOutOdds, max_wrong: float) -> Risk:
    """Threshold at which to act, such that at most a share of interactions has a wrong action.

    With too few groups for this share, the bound is 1 / (G + 1), and the threshold is extrapolated
    by a normal distribution.

    Args:
        left_out: odds of at least two held-out demonstrations.
        max_wrong: requested share, in (0, 0.5].
    """
    odds, weights = np.array(left_out.odds), left_out.weights()
    n_groups = left_out.n_groups
    quantile = conformal_bound(odds, max_wrong, weights)
    bound = max(max_wrong, 1.0 / (n_groups + 1.0))
    threshold = max(float(expit(quantile)), LEAST_SHARE)
    grouped = any(left_out.groups)
    told_apart = any(name.startswith(UNNAMED) for name in left_out.groups)
    return Risk(min(threshold, 1.0), max_wrong, bound, n_groups, grouped, told_apart)


def conformal_bound(values: Floats, accepted: float, weights: Floats | None = None) -> float:
    """Bound that one more value of the same kind exceeds with at most the accepted probability.

    It holds for any distribution (Vovk et al. 2005). If there are too few values for this
    probability, it is extrapolated by a normal distribution.

    Args:
        values: two or more values, (n,).
        accepted: accepted probability, in (0, 1).
        weights: probability that one more value is like each of these, (n,), which sum to less than
            one. None for 1 / (n + 1) each.
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
